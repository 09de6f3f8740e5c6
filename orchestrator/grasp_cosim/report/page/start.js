// Keys and buttons of the page, and its start.
"use strict";

function key(event) {
  if (event.target.closest("input, select, textarea, button, summary")) return;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const span = view.to - view.from, middle = (view.from + view.to) / 2;
  const does = {
    ArrowLeft: () => zoom(view.from - 0.2 * span, view.to - 0.2 * span),
    ArrowRight: () => zoom(view.from + 0.2 * span, view.to + 0.2 * span),
    "+": () => zoom(middle - 0.25 * span, middle + 0.25 * span),
    "-": () => zoom(middle - span, middle + span),
    0: () => zoom(recording.first, recording.last),
    " ": () => scene && scene.toggle(),
  }[event.key];
  if (!does) return;
  event.preventDefault();
  does();
}

function connect() {
  gestures();
  offers();
  document.addEventListener("keydown", key);
  find("by").addEventListener("change", show);
  find("signals").addEventListener("change", (event) => {
    const boxes = [...find("signals").querySelectorAll("input[data-signal]")];
    if (event.target.dataset.component) {
      for (const box of boxes) {
        if (box.dataset.of === event.target.dataset.component) box.checked = event.target.checked;
      }
    }
    const ticked = boxes.filter((box) => box.checked).map((box) => box.dataset.signal);
    const kept = chosen.filter((name) => ticked.includes(name));
    choose([...kept, ...ticked.filter((name) => !kept.includes(name))]); // new ones come last
  });
  find("search").addEventListener("input", () => {
    const wanted = find("search").value.toLowerCase();
    for (const box of find("signals").querySelectorAll("input[data-signal]")) {
      box.parentElement.hidden = !box.dataset.signal.toLowerCase().includes(wanted);
    }
  });
  for (const button of document.querySelectorAll("button[data-from]")) {
    button.addEventListener("click", () => zoom(Number(button.dataset.from), Number(button.dataset.to)));
  }
  find("all").addEventListener("click", () => zoom(recording.first, recording.last));
  window.addEventListener("hashchange", recall);
  window.addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

async function begin() {
  await recording.start();
  cursor = recording.first;
  view = whole();
  if (page.scene) scene = await startScene(page.scene);
  connect();
  find("signals").open = innerWidth > 760;
  await recall();
  draw();
  state.ready = "yes";
}

begin();
