// The panels of a run: its signals, those of one variable (or unit) together.
"use strict";

async function show() {
  const order = ++asked;
  const series = await Promise.all(chosen.map((name) => recording.series(name)));
  if (order !== asked) return; // the choice has changed meanwhile
  find("plots").replaceChildren();
  panels = grouped(series.map(signed)).map(([title, group, part]) => saving(new Panel(
    recording, title, styles(group), find("plots"), part)));
  find("none").hidden = panels.length > 0;
  redraw();
}
