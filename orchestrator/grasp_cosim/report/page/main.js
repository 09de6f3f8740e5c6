// The page at work: which signals, what time, what zoom; all of it in the address after the #.
"use strict";

const page = JSON.parse(document.getElementById("page").textContent);
const state = document.documentElement.dataset;
const find = (id) => document.getElementById(id);

const recording = new Recording(page);
let view = null, cursor = 0, hover = null, panels = [], scene = null, chosen = [...page.shown];
let due = false, asked = 0;

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

function redraw() {
  if (!due) requestAnimationFrame(draw);
  due = true;
}

function draw() {
  due = false;
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

// Panels -------------------------------------------------------------------------------------
const stem = (name) => name.slice(name.indexOf(".") + 1).replace(/\[[^\]]*\]$/, "");

function styles(series) { // the colours that signals have, else colours in turn
  const kinds = [...new Set(series.map((one) => stem(one.name)))];
  return series.map((one, i) => {
    const own = page.colors[one.name];
    const dash = own && find("by").value === "unit" ? kinds.indexOf(stem(one.name)) : 0;
    return { ...one,
      style: { color: own || PALETTE[i % PALETTE.length], dash: dash % DASHES.length } };
  });
}

async function show() {
  const order = ++asked;
  const series = await Promise.all(chosen.map((name) => recording.series(name)));
  if (order !== asked) return; // the choice has changed meanwhile
  const groups = new Map();
  for (const one of series) {
    const unit = one.unit ? ` in ${one.unit}` : "";
    const name = stem(one.name).replaceAll("_", " ");
    const title = find("by").value === "unit" ? one.unit || "no unit" : name + unit;
    groups.set(title, [...(groups.get(title) || []), one]);
  }
  find("plots").replaceChildren();
  panels = [...groups].map(([title, group]) => new Panel(
    recording, title.replace(/ in \S*$/, ""), styles(group), find("plots")));
  find("none").hidden = panels.length > 0;
  redraw();
}

function choose(names) {
  chosen = names;
  for (const box of document.querySelectorAll("#signals input[data-signal]")) {
    box.checked = names.includes(box.dataset.signal);
  }
  return show();
}

// The address --------------------------------------------------------------------------------
function remember() {
  clearTimeout(remember.later);
  remember.later = setTimeout(() => {
    const parts = [`t=${view.from},${view.to}`, `at=${cursor}`];
    if (chosen.join() !== page.shown.join()) {
      parts.push(`show=${chosen.map(encodeURIComponent).join(",")}`);
    }
    history.replaceState(null, "", `#${parts.join("&")}`);
  }, 300);
}

function recall() { // what the address asks for; what it does not say stays
  const asks = new URLSearchParams(location.hash.slice(1).replaceAll("+", "%2B"));
  const [from, to] = (asks.get("t") || "").split(",").map(Number);
  view = view || whole();
  if (to > from) zoom(from, to);
  if (asks.get("at")) cursor = clamp(Number(asks.get("at")) || 0, recording.first, recording.last);
  const names = asks.has("show") ? asks.get("show").split(",") : chosen;
  return choose(names.filter((name) => recording.byName.has(name)));
}
