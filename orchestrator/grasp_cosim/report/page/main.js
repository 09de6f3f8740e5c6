// The page at work: which signals, what time, what zoom; all of it in the address after the #.
"use strict";

const recording = new Source(page);
const MOST = 6; // lines of a panel
let chosen = [...page.shown], asked = 0;

// Panels -------------------------------------------------------------------------------------
const stem = (name) => name.slice(name.indexOf(".") + 1).replace(/\[[^\]]*\]$/, "");

function styles(series) { // the colours and dashes that signals have, else some in turn
  const kinds = [...new Set(series.map((one) => stem(one.name)))];
  return series.map((one, i) => {
    const own = page.colors[one.name], kind = kinds.indexOf(stem(one.name));
    const dash = own ? 2 * kind + (page.dashes[one.name] || 0) : i;
    return { ...one,
      style: { color: own || PALETTE[i % PALETTE.length], dash: dash % DASHES.length } };
  });
}

function signed(one) { // with the sign that it has in pictures, which its label says
  if (!page.negated.includes(one.name)) return one;
  const values = one.values.map((value) => 0 - value);
  return { ...one, label: `−${one.name}`, values, levels: pyramid(values) };
}

function grouped(series, most = MOST) { // those of one panel, by its title; several of more
  const groups = new Map();
  for (const one of series) {
    const unit = one.unit ? ` in ${one.unit}` : "";
    const name = stem(one.name).replaceAll("_", " ");
    const title = find("by").value === "unit" ? one.unit || "no unit" : name + unit;
    groups.set(title, [...(groups.get(title) || []), one]);
  }
  return [...groups].flatMap(([title, group]) => {
    const parts = Math.ceil(group.length / most), plain = title.replace(/ in \S*$/, "");
    return Array.from({ length: parts }, (_, k) => [plain, group.slice(k * most, (k + 1) * most),
      parts > 1 ? ` (${k + 1} of ${parts})` : ""]);
  });
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

// Keys, buttons and the start -------------------------------------------------------------------
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
  find("signals").open = innerWidth > beside;
  await recall();
  draw();
  state.ready = "yes";
}

begin();
