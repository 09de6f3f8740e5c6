// The run as it goes on: its rows from the server, a view that follows them, its state and log.
"use strict";

const SPARE = 16384; // rows for which there is room until the history is loaded again
const MAX_KEPT = 64; // frames that are kept while it is loaded
const LINK_STATES = ["not connected", "connected", "missing", "lost", "back"];

function doubles(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new Float64Array(bytes.buffer);
}

class LiveRecording extends Recording {
  constructor(page) {
    super(page);
    this.width = 1 + page.signals.length;
    this.columns = [];
    this.frames = []; // that came while the history was loaded
    this.loading = true;
    page.signals.forEach((signal, i) => { signal.column = i + 1; });
  }

  async start() {
    this.source = new EventSource("events");
    this.source.addEventListener("message", (event) => this.take(JSON.parse(event.data)));
    this.source.addEventListener("error", () => this.gone());
    await this.fill();
  }

  async fill() { // with the history: the number of the next pair, the columns, then the rows
    this.loading = true;
    const numbers = new Float64Array(await (await fetch("history")).arrayBuffer());
    const rows = (numbers.length - 2) / this.width;
    this.next = numbers[0];
    this.columns = Array.from({ length: this.width }, (_, k) => {
      const column = new Float64Array(rows + SPARE);
      for (let i = 0; i < rows; i++) column[i] = numbers[2 + i * this.width + k];
      return column;
    });
    this.rows = rows;
    this.loading = false;
    const frames = this.frames;
    this.frames = [];
    for (const frame of frames) this.append(frame);
    this.measure();
  }

  measure() {
    this.time = this.columns[0].subarray(0, this.rows);
    this.first = this.rows ? this.time[0] : 0;
    this.last = this.rows ? this.time[this.rows - 1] : 0;
  }

  take(frame) {
    if (this.loading) {
      if (this.frames.length < MAX_KEPT) this.frames.push(frame);
    } else {
      this.append(frame);
      this.measure();
    }
    news(frame);
    if (!frame.last) return;
    this.source.close();
    for (const { row } of parameters.values()) {
      for (const box of row.querySelectorAll("input, select")) box.disabled = true;
    }
  }

  append({ first, rows }) {
    const numbers = doubles(rows), size = 2 * this.width, pairs = numbers.length / size;
    const known = Math.max(this.next - first, 0);
    if (known >= pairs || this.loading) return;
    const more = 2 * (pairs - known);
    if (first > this.next || this.rows + more > this.columns[0].length) {
      // some were skipped, or there is no more room; after the end there is nobody to ask
      this.fill().catch(() => { this.loading = false; });
      return;
    }
    for (let i = 0; i < more; i++) {
      for (let k = 0; k < this.width; k++) {
        this.columns[k][this.rows + i] = numbers[known * size + i * this.width + k];
      }
    }
    this.rows += more;
    this.next = first + pairs;
  }

  now(name) {
    const signal = this.byName.get(name);
    const values = this.columns[signal.column].subarray(0, this.rows);
    return { ...signal, values, levels: pyramid(values) };
  }

  series(name) {
    return Promise.resolve(this.now(name));
  }

  gone() { // the server ends with the run; without a last word of it, it was ended
    if (["running", "starting"].includes(find("run-state").dataset.state)) {
      stateIs("lost", "No answer any more: the run was ended, its computer is busy, or too many "
        + "pages follow it.");
    }
  }
}

Source = LiveRecording;
beside = 1400;

// What the server says -----------------------------------------------------------------------
let following = true, pending = 0, figures = {}, knownLines = 0, toldLinks = "";

function stateIs(state, reason) {
  const element = find("run-state");
  if (element.dataset.state !== state) element.textContent = state;
  element.dataset.state = state;
  find("run-reason").textContent = reason;
  find("run-reason").hidden = !reason;
  find("run-advice").hidden = ["starting", "running", "lost"].includes(state);
}

function news(frame) {
  stateIs(frame.state, frame.reason);
  figures = frame;
  for (const [name, value] of Object.entries(frame.values)) parameters.get(name)?.take(value);
  frame.lines.forEach((line, i) => {
    if (frame.line + i < knownLines) return; // they come again on a new connection
    const item = document.createElement("li");
    item.textContent = line;
    find("lines").append(item);
  });
  knownLines = Math.max(knownLines, frame.line + frame.lines.length);
  if (frame.scene) page.scene = frame.scene.state;
  if (frame.scene || frame.lines.length) marks(frame.scene?.marks);
  pending ||= requestAnimationFrame(renew);
}

let sceneMarks = [];

function marks(ofScene) { // the moments of the scene, and those of changes
  sceneMarks = ofScene ?? sceneMarks;
  const changes = [...find("lines").children].map((item) => /^t = (\S+) s: /.exec(item.textContent));
  page.marks = [
    ...sceneMarks.map(([t, color]) => ({ t, color })),
    ...changes.filter(Boolean).map((match) => ({ t: Number(match[1]), color: "--fault" })),
  ];
}

// What is seen of it -------------------------------------------------------------------------
function renew() {
  pending = 0;
  tell();
  if (!state.ready || !recording.rows) return;
  for (const panel of panels) {
    panel.series = panel.series.map((one) => ({ ...one, ...signed(recording.now(one.name)) }));
  }
  if (following) follow();
  if (scene) scene.renew(page.scene, page.scene.signals.map((name) => recording.now(name)));
  draw();
}

function follow() {
  const span = find("window").value, { first, last } = recording;
  const from = span === "whole" ? first : Math.max(first, last - Number(span));
  view = { from, to: span === "whole" ? Math.max(last, first + 1e-9) : from + Number(span) };
  cursor = last;
}

function tell() {
  const { time, overruns, latest } = figures;
  find("run-time").textContent = `t = ${time.toFixed(3)} s`;
  find("run-late").textContent = overruns === undefined ? ""
    : `${overruns} ${overruns === 1 ? "step" : "steps"} late, begin at worst ${
      text(1e3 * latest, 3)} ms late`;
  const links = Object.entries(figures.links), told = JSON.stringify(links);
  if (told === toldLinks) return;
  toldLinks = told;
  find("links").hidden = !links.length;
  find("links").querySelector("tbody").replaceChildren(...links.map(linkRow));
}

function linkRow([name, link]) {
  const row = document.createElement("tr"), ms = (s) => `${text(1e3 * s, 3)} ms`;
  const counts = ["out_of_order", "duplicated", "rejected", "limited", "implausible", "trips"];
  const cells = [name, LINK_STATES[link.state_now] ?? link.state_now, link.missed, link.late,
    ms(link.round_trip_time_now), ms(link.round_trip_worst), ...counts.map((key) => link[key])];
  cells.forEach((content, i) => {
    const cell = document.createElement("td");
    cell.className = i > 1 ? "n" : "";
    cell.textContent = content;
    row.append(cell);
  });
  return row;
}

function followAgain(on) {
  following = on;
  find("follow").setAttribute("aria-pressed", String(on));
  if (on && state.ready) {
    follow();
    redraw();
  }
}

function startLive() {
  startParameters(page.settings);
  find("follow").addEventListener("click", () => followAgain(!following));
  find("window").addEventListener("change", () => followAgain(true));
  const stop = () => followAgain(false);
  for (const id of ["plots", "overview", "scrub", "play", "all"]) { // who looks closer, stays there
    find(id)?.addEventListener("pointerdown", stop, { capture: true });
    find(id)?.addEventListener("wheel", stop, { capture: true, passive: true });
  }
  find("scrub")?.addEventListener("input", stop);
  find("play")?.addEventListener("click", stop, { capture: true });
  find("all").addEventListener("click", stop, { capture: true });
  for (const jump of document.querySelectorAll("button[data-at]")) {
    jump.addEventListener("click", stop, { capture: true });
  }
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, button, summary")) return;
    if (["ArrowLeft", "ArrowRight", "+", "-", "0", " "].includes(event.key)) stop();
  }, { capture: true });
}

startLive();
