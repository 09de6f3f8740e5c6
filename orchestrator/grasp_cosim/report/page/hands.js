// What a hand does to the traces: wheel, drag, double click.
"use strict";

const inside = (event) => event.target.closest("#plots canvas");

function timeAt(event, canvas) {
  const box = canvas.getBoundingClientRect();
  const part = (event.clientX - box.left - GUTTER) / (box.width - GUTTER - RIGHT);
  return view.from + clamp(part, 0, 1) * (view.to - view.from);
}

function wheel(event) {
  const canvas = inside(event), all = whole();
  if (!canvas) return;
  const span = view.to - view.from;
  if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
    const by = 0.001 * span * (event.deltaX || event.deltaY);
    zoom(view.from + by, view.to + by);
  } else {
    if (event.deltaY > 0 && span >= all.to - all.from) return; // all is in view: the page scrolls
    const t = timeAt(event, canvas), by = Math.exp(0.0015 * clamp(event.deltaY, -400, 400));
    zoom(t - (t - view.from) * by, t + (view.to - t) * by);
  }
  event.preventDefault();
}

function drag(event) { // over the traces: zooms in to what is drawn over; with shift it moves
  const canvas = inside(event);
  if (!canvas || event.button !== 0) return;
  const start = timeAt(event, canvas), left = event.clientX, old = { ...view };
  const band = document.createElement("div");
  band.className = "band";
  find("plots").setPointerCapture(event.pointerId);
  const frame = find("plots").getBoundingClientRect();
  const move = (now) => {
    if (event.shiftKey) {
      const by = (old.to - old.from) * (left - now.clientX) / (canvas.clientWidth - GUTTER - RIGHT);
      zoom(old.from + by, old.to + by);
    } else if (Math.abs(now.clientX - left) > 3) {
      const edge = (x) => clamp(x - frame.left, GUTTER, frame.width - RIGHT);
      const ends = [edge(left), edge(now.clientX)].sort((a, b) => a - b);
      band.style.left = `${ends[0]}px`;
      band.style.width = `${ends[1] - ends[0]}px`;
      find("plots").append(band);
    }
  };
  const up = (now) => {
    find("plots").removeEventListener("pointermove", move);
    find("plots").removeEventListener("pointerup", up);
    find("plots").removeEventListener("pointercancel", up);
    band.remove();
    if (now.type === "pointercancel" || event.shiftKey) return;
    if (Math.abs(now.clientX - left) <= 3) seek(start);
    else zoom(Math.min(start, timeAt(now, canvas)), Math.max(start, timeAt(now, canvas)));
  };
  find("plots").addEventListener("pointermove", move);
  find("plots").addEventListener("pointerup", up);
  find("plots").addEventListener("pointercancel", up);
}

function slide(event) { // over the strip: the part in view follows the pointer
  if (event.buttons !== 1) return;
  const box = find("overview").getBoundingClientRect(), all = whole();
  const part = (event.clientX - box.left - GUTTER) / (box.width - GUTTER - RIGHT);
  const t = all.from + clamp(part, 0, 1) * (all.to - all.from), half = (view.to - view.from) / 2;
  zoom(t - half, t + half);
}

function gestures() {
  const plots = find("plots");
  plots.addEventListener("wheel", wheel, { passive: false });
  plots.addEventListener("pointerdown", drag);
  plots.addEventListener("dblclick", () => zoom(recording.first, recording.last));
  plots.addEventListener("pointermove", (event) => {
    const canvas = inside(event);
    hover = canvas ? timeAt(event, canvas) : null;
    redraw();
  });
  plots.addEventListener("pointerleave", () => {
    hover = null;
    redraw();
  });
  for (const name of ["pointerdown", "pointermove"]) find("overview").addEventListener(name, slide);
}
