// What is in view of the recording: which span of time, and the cursor in it.
"use strict";

const page = JSON.parse(document.getElementById("page").textContent);
const state = document.documentElement.dataset;
const find = (id) => document.getElementById(id);

let beside = 760; // px of a window from which the signals stand next to the traces
let view = null, cursor = 0, hover = null, panels = [], scene = null, due = 0;

const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
const whole = () => ({ from: recording.first, to: Math.max(recording.last, recording.first + 1e-9) });

function zoom(from, to) {
  const all = whole(), shortest = 1e-9 * Math.max(1, Math.abs(all.to));
  const span = clamp(to - from, Math.min(shortest, all.to - all.from), all.to - all.from);
  const begin = clamp((from + to - span) / 2, all.from, all.to - span);
  view = { from: begin, to: begin + span };
  redraw();
}

function seek(t) {
  cursor = clamp(t, recording.first, recording.last);
  redraw();
}

function redraw() { // once, in the next frame
  due ||= requestAnimationFrame(draw);
}

function draw() {
  cancelAnimationFrame(due);
  due = 0;
  for (const panel of panels) panel.draw(view, page.marks, cursor, hover);
  overview();
  find("span").textContent = `${clock(view.from)} to ${clock(view.to)}`;
  if (scene) scene.draw();
  remember();
}

const clock = (t) => `${t.toFixed(Math.max(3, Math.min(9, 2 - Math.floor(Math.log10(view.to - view.from)))))} s`;

// The whole run as a strip, with the part in view.
function overview() {
  const { pen, width, height } = fitted(find("overview")), all = whole();
  const x = (t) => GUTTER + (t - all.from) / (all.to - all.from) * (width - GUTTER - RIGHT);
  pen.fillStyle = color("--lens");
  pen.fillRect(GUTTER, 4, width - GUTTER - RIGHT, height - 8);
  for (const mark of page.marks) {
    pen.fillStyle = color(mark.color);
    pen.fillRect(x(mark.t) - 0.75, 4, 1.5, height - 8);
  }
  pen.fillStyle = color("--window");
  pen.strokeStyle = color("--muted");
  const wide = Math.max(x(view.to) - x(view.from), 3);
  pen.fillRect(x(view.from), 2, wide, height - 4);
  pen.strokeRect(x(view.from) + 0.5, 2.5, wide - 1, height - 5);
  pen.fillStyle = color("--ink");
  pen.fillRect(x(cursor) - 0.5, 0, 1, height);
}
