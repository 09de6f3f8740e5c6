// The recorded signals: unpacked when first shown, with extremes of blocks so that any zoom is fast.
"use strict";

const FOLD = 8; // rows (or blocks) per block of the next level

// Bytes in eight planes, least significant first, hold the second differences of the bit patterns
// of doubles, modulo 2^64 (report/embed.py). The sums are taken in halves of 32 bits.
function unpack(planes, rows) {
  const values = new Float64Array(rows), words = new Uint32Array(values.buffer);
  const word = (i, plane) => (planes[plane * rows + i] | planes[(plane + 1) * rows + i] << 8
    | planes[(plane + 2) * rows + i] << 16 | planes[(plane + 3) * rows + i] << 24) >>> 0;
  let low = 0, high = 0, lowStep = 0, highStep = 0;
  for (let i = 0; i < rows; i++) {
    const step = lowStep + word(i, 0);
    highStep = (highStep + word(i, 4) + (step > 0xffffffff ? 1 : 0)) >>> 0;
    lowStep = step >>> 0;
    const sum = low + lowStep;
    high = (high + highStep + (sum > 0xffffffff ? 1 : 0)) >>> 0;
    low = sum >>> 0;
    words[2 * i] = low;
    words[2 * i + 1] = high;
  }
  return values;
}

async function inflate(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// What is further from zero is not drawn: inf and the largest double, a distance to nothing.
const FAR = 1e300;

function drawable(values) {
  const near = (value) => Math.abs(value) < FAR;
  return values.every(near) ? values : values.map((value) => (near(value) ? value : NaN));
}

// Levels of minima and maxima over blocks of FOLD, FOLD^2, ... rows. A NaN is passed over.
function pyramid(values) {
  const rows = drawable(values), levels = [{ low: rows, high: rows }];
  while (levels[levels.length - 1].low.length > 2 * FOLD) {
    const below = levels[levels.length - 1], blocks = Math.ceil(below.low.length / FOLD);
    const low = new Float64Array(blocks).fill(Infinity);
    const high = new Float64Array(blocks).fill(-Infinity);
    for (let i = 0; i < below.low.length; i++) {
      const block = Math.floor(i / FOLD);
      if (below.low[i] < low[block]) low[block] = below.low[i];
      if (below.high[i] > high[block]) high[block] = below.high[i];
    }
    levels.push({ low, high });
  }
  return levels;
}

// Lowest and highest value of the rows between neighbouring edges, from blocks of at most a quarter
// of a column: what is one such block next to a column may count to it.
function envelope(levels, edges) {
  const columns = edges.length - 1, perColumn = (edges[columns] - edges[0]) / columns;
  let level = 0;
  while (level + 1 < levels.length && FOLD ** (level + 1) <= perColumn / 4) level++;
  const size = FOLD ** level, { low, high } = levels[level];
  const lows = new Float64Array(columns).fill(NaN), highs = new Float64Array(columns).fill(NaN);
  for (let c = 0; c < columns; c++) {
    if (edges[c] === edges[c + 1]) continue;
    let least = Infinity, most = -Infinity;
    for (let b = Math.floor(edges[c] / size); b < Math.ceil(edges[c + 1] / size); b++) {
      if (low[b] < least) least = low[b];
      if (high[b] > most) most = high[b];
    }
    if (least <= most) [lows[c], highs[c]] = [least, most];
  }
  return { lows, highs };
}

// The first row at or after t, from row start on.
function rowAt(time, t, start = 0) {
  let low = start, high = time.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < t) low = middle + 1; else high = middle;
  }
  return low;
}

// The value at t: between rows linear, or held from the row before.
function valueAt(time, series, t) {
  const after = Math.min(rowAt(time, t), time.length - 1), values = series.values;
  if (after === 0 || time[after] <= t) return values[after];
  if (series.steps) return values[after - 1];
  const part = (t - time[after - 1]) / (time[after] - time[after - 1]);
  return values[after - 1] + part * (values[after] - values[after - 1]);
}

class Recording {
  constructor(page) {
    this.rows = page.rows;
    this.signals = page.signals; // each: name, unit, steps, text, id, texts
    this.byName = new Map(page.signals.map((signal) => [signal.name, signal]));
    this.loaded = new Map();
  }

  async load(id) {
    const element = document.getElementById(id);
    return unpack(await inflate(element.textContent), this.rows);
  }

  async start() {
    this.time = await this.load("time");
    this.first = this.time[0];
    this.last = this.time[this.rows - 1];
  }

  series(name) { // a promise; unpacked once
    if (!this.loaded.has(name)) {
      const signal = this.byName.get(name);
      this.loaded.set(name, this.load(signal.id).then(
        (values) => ({ ...signal, values, levels: pyramid(values) })));
    }
    return this.loaded.get(name);
  }
}

let Source = Recording; // what the signals come from; those of a run that goes on, from elsewhere
