// The page at work: which signals, what time, what zoom; all of it in the address after the #.
"use strict";

const recording = new Recording(page);
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
