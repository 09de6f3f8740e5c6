// The panels of two runs: A solid, B dashed over it, the band as a tube around A; below each panel how
// far the two are apart, next to the widths of the bands.
"use strict";

const parts = new Map();

function part(id) { // the values of a column and their extremes; unpacked once
  if (!parts.has(id)) {
    parts.set(id, recording.load(id).then((values) => ({ values, levels: pyramid(values) })));
  }
  return parts.get(id);
}

async function pair(name) { // the signal of A, and all that is drawn with it
  const signal = recording.byName.get(name), { b, low, high, apart } = signal.pair;
  const found = [signal.id, b, apart, ...(low ? [low, high] : [])].map(part);
  const [first, second, distance, least, most] = await Promise.all(found);
  const tube = least && { low: least.levels, high: most.levels };
  if (!page.negated.includes(name)) return { ...signal, label: name, first, second, distance, tube };
  const negative = ({ values }) => {
    const turned = values.map((value) => 0 - value);
    return { values: turned, levels: pyramid(turned) };
  };
  return { ...signal, label: `−${name}`, first: negative(first), second: negative(second), distance,
    tube: least && { low: negative(most).levels, high: negative(least).levels } };
}

function overlaid(one, i) { // several signals of a panel differ in the width of A and the dashes of B
  const { first, second, tube, style } = one, which = i % 3;
  return [
    { ...one, ...first, tube, label: `${page.names[0]} ${one.label}`,
      style: { ...style, dash: 0, width: [5, 2.5, 8][which] } },
    { ...one, ...second, tube: null, label: `${page.names[1]} ${one.label}`,
      style: { ...style, dash: 1 + which } },
  ];
}

function distances(one) {
  const { distance, width, style } = one;
  const plain = { ...one, label: one.name, tube: null, texts: null };
  const found = [{ ...plain, ...distance, style }];
  if (width !== null) {
    const values = new Float64Array(recording.rows).fill(width);
    found.push({ ...plain, values, levels: pyramid(values), label: "its band",
      style: { ...style, dash: 2 } });
  }
  return found;
}

document.addEventListener("click", (event) => { // to the worst moment of a signal, from the table
  const button = event.target.closest("button[data-show]");
  if (!button) return;
  if (!chosen.includes(button.dataset.show)) choose([button.dataset.show, ...chosen]);
  find("traces").scrollIntoView();
});

async function show() {
  const order = ++asked;
  const series = await Promise.all(chosen.map(pair));
  if (order !== asked) return; // the choice has changed meanwhile
  find("plots").replaceChildren();
  panels = grouped(series, MOST / 2).flatMap(([title, group, part]) => {
    const styled = styles(group);
    const panel = new Panel(recording, title, styled.flatMap(overlaid), find("plots"), part);
    const below = new Panel(
      recording, `${title}: deviation`, styled.flatMap(distances), find("plots"), part);
    below.root.classList.add("apart");
    return [panel, below].map(saving);
  });
  find("none").hidden = panels.length > 0;
  redraw();
}
