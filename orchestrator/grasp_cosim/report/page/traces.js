// Traces over time: a panel per variable (or unit), all on one time axis. Canvas, no library.
"use strict";

const GUTTER = 66, RIGHT = 12, TOP = 8, AXIS = 20; // px around the plotted area
const PREFIXED = /^(m|N|V|J|W|A|Pa|Hz|s|rad|m\/s|m\/s2|rad\/s|N\.s|N\.m)$/;
const PALETTE = ["--c0", "--c1", "--c2", "--c3", "--c4", "--c5", "--c6", "--c7"];
const DASHES = [[], [6, 3], [2, 2], [8, 3, 2, 3], [12, 4], [1, 4]];
const HOME = { m: [1e3, "mm"], "m/s": [1e3, "mm/s"], N: [1, "N"], s: [1e3, "ms"] };

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A factor and a unit that make the largest value readable: lengths in mm, forces in N and so on
// where they are neither tiny nor huge there; all else by prefixes.
function scaled(unit, largest) {
  const [own, home] = HOME[unit] || [1, ""];
  if (home && largest * own >= 1e-3 && largest * own < 1e6) return { factor: own, unit: home };
  if (!PREFIXED.test(unit || "") || !(largest > 0) || largest === Infinity) {
    return { factor: 1, unit: unit || "" };
  }
  const power = Math.max(-4, Math.min(3, Math.floor(Math.log10(largest * 1.0000001) / 3)));
  const prefix = { "-4": "p", "-3": "n", "-2": "µ", "-1": "m", 0: "", 1: "k", 2: "M", 3: "G" }[power];
  return { factor: 10 ** (-3 * power), unit: prefix + unit };
}

function ticks(low, high, wanted) {
  const rough = (high - low) / Math.max(wanted, 1), base = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((s) => s * base >= rough * 0.999) * base;
  const decimals = Math.max(0, Math.min(12, -Math.floor(Math.log10(step) + 1e-9)));
  const marks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    marks.push({ at: k * step, label: (k * step || 0).toFixed(decimals) });
  }
  return marks;
}

function text(value, decimals) { // as many as it needs where none are asked for
  if (!Number.isFinite(value)) return String(value);
  if (decimals >= 0) return (Number(value.toFixed(decimals)) || 0).toFixed(decimals).replace("-", "−");
  const size = Math.abs(value), short = size !== 0 && (size < 1e-3 || size >= 1e6);
  const digits = short ? value.toExponential(3) : value.toFixed(size < 10 ? 4 : size < 1000 ? 3 : 1);
  return digits.replace(/^-/, "−");
}

function fitted(canvas) { // the context of a canvas, cleared, in CSS pixels
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = `11px ${color("--sans")}`;
  return { pen, width, height };
}

const rows = (begin, end) => Int32Array.from({ length: end - begin + 1 }, (_, i) => begin + i);

class Panel {
  // Of several panels of one title, part says which this is.
  constructor(recording, title, series, parent, part = "") {
    this.recording = recording;
    this.part = part;
    this.series = series; // each: values, levels, style: {color, dash}; maybe a fixed scale, a label
    this.root = document.createElement("section");
    this.root.className = "panel";
    this.root.innerHTML = "<header><h3></h3><ul></ul></header><canvas></canvas>";
    this.title = title;
    this.heading = this.root.querySelector("h3");
    this.canvas = this.root.querySelector("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${title} over time`);
    this.readings = series.map((one) => {
      const item = document.createElement("li"), value = document.createElement("output");
      item.style.setProperty("--line", `var(${one.style.color})`);
      item.dataset.dash = one.style.dash;
      item.classList.toggle("wide", Boolean(one.style.width));
      item.title = one.text;
      const wide = Math.min(one.style.width || 2, 5), dashes = DASHES[one.style.dash].join(" ");
      item.innerHTML = `<svg width="28" height="8"><line x2="28" y1="4" y2="4" stroke-width="${wide}"
        stroke-dasharray="${dashes}"/></svg>`;
      item.append(one.label || one.name, value);
      this.root.querySelector("ul").append(item);
      return value;
    });
    parent.append(this.root);
  }

  // Draws what is in view {from, to}; marks are {t, color} lines, cursor and hover are times.
  draw(view, marks, cursor, hover) {
    const { pen, width, height } = fitted(this.canvas), time = this.recording.time;
    const plot = { left: GUTTER, right: width - RIGHT, top: TOP, bottom: height - AXIS };
    const columns = Math.max(Math.round(plot.right - plot.left), 1);
    const begin = Math.max(rowAt(time, view.from) - 1, 0);
    const end = Math.min(rowAt(time, view.to) + 1, time.length);
    const dense = end - begin > 3 * columns;
    const edges = new Int32Array(columns + 1);
    for (let c = 0; dense && c <= columns; c++) {
      const t = view.from + (view.to - view.from) * c / columns;
      edges[c] = rowAt(time, t, c ? edges[c - 1] : 0);
    }
    const drawn = this.series.map((one) => (dense
      ? envelope(one.levels, edges) : envelope(one.levels.slice(0, 1), [begin, end])));
    let low = Infinity, high = -Infinity;
    for (const { lows, highs } of drawn) {
      for (const v of lows) if (v < low) low = v;
      for (const v of highs) if (v > high) high = v;
    }
    if (!(low <= high)) [low, high] = [0, 1];
    const { factor, unit } = this.series[0].scale
      || scaled(this.series[0].unit, Math.max(Math.abs(low), Math.abs(high)));
    const least = 1e-12 * Math.max(Math.abs(low), Math.abs(high)) || 1e-12;
    const margin = high - low > least ? 0.07 * (high - low) : 0.5 * Math.abs(high) || 1;
    const x = (t) => plot.left + (t - view.from) / (view.to - view.from) * (plot.right - plot.left);
    const y = (v) => plot.bottom - (v - low + margin) / (high - low + 2 * margin)
      * (plot.bottom - plot.top);
    this.axes(pen, plot, view, x, y, [(low - margin) * factor, (high + margin) * factor], factor);
    this.heading.textContent = (unit && this.title !== this.series[0].unit
      ? `${this.title} in ${unit}` : unit || this.title) + this.part;
    this.canvas.dataset.low = low;
    this.canvas.dataset.high = high;
    pen.save();
    pen.beginPath();
    pen.rect(plot.left, plot.top - 2, plot.right - plot.left, plot.bottom - plot.top + 4);
    pen.clip();
    for (const mark of marks) this.upright(pen, plot, x(mark.t), color(mark.color), 0.45, [2, 3]);
    for (const one of this.series) {
      if (one.tube) this.tube(pen, x, y, one, begin, end, dense && edges);
    }
    this.series.forEach((one, i) => {
      pen.strokeStyle = pen.fillStyle = color(one.style.color);
      pen.globalAlpha = one.style.width ? 0.45 : 1;
      pen.setLineDash(DASHES[one.style.dash]);
      pen.lineWidth = one.style.width || 1.5;
      pen.lineJoin = "round";
      if (dense) this.bars(pen, plot.left, y, drawn[i]);
      else this.points(pen, x, y, one, begin, end, columns);
    });
    pen.globalAlpha = 1;
    this.upright(pen, plot, x(cursor), color("--ink"), 0.7, []);
    if (hover !== null) this.upright(pen, plot, x(hover), color("--ink"), 0.35, []);
    pen.restore();
    const t = hover === null ? cursor : hover;
    this.series.forEach((one, i) => {
      const value = valueAt(time, one, t);
      this.readings[i].textContent = one.texts ? one.texts[value]
        : one.steps ? `${value}` : `${text(value * factor, one.scale?.decimals)} ${unit}`;
    });
  }

  axes(pen, plot, view, x, y, [low, high], factor) {
    pen.lineWidth = 1;
    pen.textBaseline = "middle";
    const line = (x0, y0, x1, y1) => {
      pen.beginPath();
      pen.moveTo(x0, y0);
      pen.lineTo(x1, y1);
      pen.stroke();
    };
    pen.strokeStyle = color("--rule");
    pen.fillStyle = color("--muted");
    pen.textAlign = "right";
    for (const mark of ticks(low, high, (plot.bottom - plot.top) / 34)) {
      const at = Math.round(y(mark.at / factor)) + 0.5;
      line(plot.left, at, plot.right, at);
      pen.fillText(mark.label.replace("-", "−"), plot.left - 8, at);
    }
    pen.textAlign = "center";
    const marks = ticks(view.from, view.to, (plot.right - plot.left) / 90);
    marks.forEach((mark, i) => {
      const at = Math.round(x(mark.at)) + 0.5, last = i === marks.length - 1;
      line(at, plot.top, at, plot.bottom);
      const label = mark.label + (last ? " s" : "");
      const furthest = plot.right + RIGHT - pen.measureText(label).width / 2;
      pen.fillText(label, Math.min(at, furthest), plot.bottom + 12);
    });
  }

  upright(pen, plot, at, stroke, alpha, dash) {
    pen.save();
    pen.globalAlpha = alpha;
    pen.strokeStyle = stroke;
    pen.lineWidth = 1;
    pen.setLineDash(dash);
    pen.beginPath();
    pen.moveTo(Math.round(at) + 0.5, plot.top);
    pen.lineTo(Math.round(at) + 0.5, plot.bottom);
    pen.stroke();
    pen.restore();
  }

  tube(pen, x, y, { tube, style }, begin, end, edges) { // filled from its lowest to its highest
    const { lows } = envelope(tube.low, edges || rows(begin, end));
    const { highs } = envelope(tube.high, edges || rows(begin, end));
    const at = (i) => x(this.recording.time[edges ? edges[i] : begin + i]);
    pen.beginPath();
    for (let i = 0; i < highs.length; i++) {
      if (!Number.isNaN(highs[i])) pen.lineTo(at(i), y(highs[i]));
    }
    for (let i = lows.length - 1; i >= 0; i--) {
      if (!Number.isNaN(lows[i])) pen.lineTo(at(i), y(lows[i]));
    }
    pen.fillStyle = color(style.color);
    pen.globalAlpha = 0.16;
    pen.fill();
    pen.globalAlpha = 1;
  }

  bars(pen, left, y, { lows, highs }) { // more rows than pixels: from lowest to highest, joined
    pen.beginPath();
    for (let c = 0; c < lows.length; c++) {
      if (Number.isNaN(lows[c])) continue;
      pen.lineTo(left + c + 0.5, y(highs[c]));
      pen.lineTo(left + c + 0.5, y(lows[c]));
    }
    pen.stroke();
  }

  points(pen, x, y, one, begin, end, columns) { // few rows: each of them, dots where there is room
    const time = this.recording.time;
    pen.beginPath();
    for (let i = begin; i < end; i++) {
      if (one.steps && i > begin) pen.lineTo(x(time[i]), y(one.values[i - 1]));
      pen.lineTo(x(time[i]), y(one.values[i]));
    }
    pen.stroke();
    if (end - begin > columns / 8) return;
    for (let i = begin; i < end; i++) {
      pen.beginPath();
      pen.arc(x(time[i]), y(one.values[i]), 2.2, 0, 2 * Math.PI);
      pen.fill();
    }
  }
}
