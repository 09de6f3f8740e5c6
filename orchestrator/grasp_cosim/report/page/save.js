// What can be taken from the page: each picture as it is drawn, with its title, and the signals as CSV.
"use strict";

const LINE = 17, EDGE = 12; // px of a line of text, and around all

const fileName = (...parts) => parts.join(" ").replace(/[^\w.−-]+/g, "_").replace(/^_+|_+$/g, "");

function offer(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Writes texts from left to right in lines of a width; each may have a swatch before it. Returns the
// height that they take; without a pen that draws, nothing is written.
function written(pen, items, y, width, draws) {
  let x = EDGE, bottom = y;
  for (const { text, style } of items) {
    const room = (style ? 46 : 4) + pen.measureText(text).width;
    if (x > EDGE && x + room > width) [x, bottom] = [EDGE, bottom + LINE];
    if (draws && style) {
      pen.strokeStyle = color(style.color);
      pen.lineWidth = Math.min(style.width || 2, 5);
      pen.setLineDash(DASHES[style.dash]);
      pen.beginPath();
      pen.moveTo(x, bottom - 4);
      pen.lineTo(x + 26, bottom - 4);
      pen.stroke();
      pen.setLineDash([]);
    }
    if (draws) pen.fillText(text, x + (style ? 32 : 0), bottom);
    x += room;
  }
  return bottom + LINE - y;
}

// A canvas as a picture: above it the title of the page, what it says of itself, and the legend.
function picture(canvas, heading, legend) {
  const ratio = canvas.width / canvas.clientWidth, width = canvas.clientWidth + 2 * EDGE;
  const whole = document.createElement("canvas"), pen = whole.getContext("2d");
  const blocks = [
    ["600 14px", "--ink", [{ text: document.title }]],
    ["11px", "--muted", page.about.split(" ").map((text) => ({ text }))],
    ["600 12px", "--ink", heading ? [{ text: heading }] : []],
    ["11px", "--ink", legend],
  ].filter(([, , items]) => items.length);
  const write = (draws) => blocks.reduce((y, [font, ink, items]) => {
    pen.font = `${font} ${color("--sans")}`;
    pen.fillStyle = color(ink);
    return y + written(pen, items, y, width, draws);
  }, EDGE + 10);
  const top = write(false);
  whole.width = width * ratio;
  whole.height = (top + canvas.clientHeight + EDGE) * ratio;
  pen.scale(ratio, ratio);
  pen.fillStyle = color("--paper");
  pen.fillRect(0, 0, width, whole.height);
  write(true);
  pen.drawImage(canvas, EDGE, top, canvas.clientWidth, canvas.clientHeight);
  whole.toBlob((blob) => offer(`${fileName(document.title, heading)}.png`, blob));
}

// An SVG of the page, with the rules that it goes by there.
function drawing(svg, name) {
  const copy = svg.cloneNode(true), style = document.createElementNS(svg.namespaceURI, "style");
  copy.setAttribute("class", svg.parentElement.className);
  copy.setAttribute("xmlns", svg.namespaceURI);
  style.textContent = document.querySelector("style").textContent;
  copy.prepend(style);
  const text = new XMLSerializer().serializeToString(copy);
  offer(`${fileName(document.title, name)}.svg`, new Blob([text], { type: "image/svg+xml" }));
}

async function csv() { // all rows that are in the page, as in signals.csv
  const columns = await Promise.all(page.signals.map((one) => recording.series(one.name)));
  const cells = columns.map(({ values, cells: texts }) => (i) => (texts ? texts[values[i]] : values[i]));
  const parts = [`${page.header}\n`];
  for (let i = 0; i < recording.rows; i++) {
    parts.push(`${[recording.time[i], ...cells.map((cell) => cell(i))].join(",")}\n`);
  }
  offer(page.csv, new Blob(parts, { type: "text/csv" }));
}

function saving(panel) { // a button for the picture of a panel
  const button = document.createElement("button");
  button.type = "button";
  button.className = "save";
  button.textContent = "PNG";
  button.title = `Save the picture of ${panel.title}`;
  button.addEventListener("click", () => picture(panel.canvas, panel.heading.textContent,
    panel.series.map(({ label, name, style }) => ({ text: label || name, style }))));
  panel.heading.after(button);
  return panel;
}

function offers() {
  find("csv")?.addEventListener("click", csv);
  for (const button of document.querySelectorAll("button[data-canvas]")) {
    button.addEventListener("click", () => picture(find(button.dataset.canvas), "", []));
  }
  for (const button of document.querySelectorAll("button[data-svg]")) {
    const svg = document.querySelector(button.dataset.svg);
    button.addEventListener("click", () => drawing(svg, button.dataset.name));
  }
}
