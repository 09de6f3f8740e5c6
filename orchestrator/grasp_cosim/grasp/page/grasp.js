// The two fingers and the object at one moment, seen from the side; below, each contact magnified.
"use strict";

const THICK = 24, TALL = 96, MIDDLE = 92, FLOOR = 168; // px of the side view
const LENS = 2e-3; // m across a magnified contact
const LENSES = 300; // px of height from which there is room for the magnified contacts
const FLASH = 0.25; // s of real time that a new contact glows
const SLOW = 0.02, AROUND = [0.015, 0.06]; // simulated s per s, and s before and after a contact
const SIDE = { 1: 1, 2: -1 }; // where the finger is, seen from the object

class Grasp {
  constructor(recording, plan, series) {
    this.recording = recording;
    this.plan = plan; // names of signals, contacts: [{t, finger}], toSi
    this.series = series; // by name
    this.canvas = document.getElementById("fingers");
    const ends = Object.values(plan.position).flatMap((name) => this.span(name));
    [this.low, this.high] = [Math.min(...ends), Math.max(...ends)];
    this.strongest = Math.max(1e-9, ...[...Object.values(plan.actuator),
      ...Object.values(plan.contact_force)].flatMap((name) => this.span(name).map(Math.abs)));
  }

  span(name) { // from its lowest to its highest value
    const top = this.series.get(name).levels.at(-1);
    return [Math.min(...top.low), Math.max(...top.high)].map((value) => this.inSi(name, value));
  }

  inSi(name, value) { // it may be recorded in another unit
    const { factor, offset } = this.plan.toSi[name] ?? { factor: 1, offset: 0 };
    return factor * value + offset;
  }

  at(name, t) {
    return this.inSi(name, valueAt(this.recording.time, this.series.get(name), t));
  }

  // speed: simulated seconds per second at a contact, by which a glow lasts a while for the eye.
  draw(t, speed) {
    const { pen, width, height } = fitted(this.canvas), plan = this.plan;
    this.reach = Math.min(62, width / 8); // px of the longest arrow
    const room = THICK + this.reach + 8, scale = (width - 2 * room) / Math.max(this.high - this.low, 1e-6);
    const x = (metres) => room + (metres - this.low) * scale;
    this.axis(pen, x, width, scale);
    const face = {}, surface = {};
    for (const j of [1, 2]) {
      face[j] = this.at(plan.position[j], t);
      surface[j] = face[j] - SIDE[j] * this.at(plan.gap[j], t);
    }
    pen.fillStyle = color("--object");
    const left = x(surface[2]), right = x(surface[1]);
    pen.beginPath();
    pen.roundRect(left, MIDDLE - TALL / 2 + 10, right - left, TALL - 20, 5);
    pen.fill();
    this.target(pen, x, t);
    for (const j of [1, 2]) {
      const glow = this.glow(j, t, speed);
      if (glow > 0) this.flash(pen, x(surface[j]), glow);
      this.finger(pen, x(face[j]), j);
      if (plan.actuator[j]) {
        this.arrow(pen, x(face[j]) + SIDE[j] * THICK, MIDDLE - 22,
          this.at(plan.actuator[j], t), j, "outer");
      }
      this.arrow(pen, x(face[j]), MIDDLE + 22, this.at(plan.contact_force[j], t), j, "inner");
      if (height >= LENSES) this.lens(pen, width, height, j, face[j] - surface[j], glow);
      this.canvas.dataset[`finger${j}`] = face[j];
      this.canvas.dataset[`surface${j}`] = surface[j];
    }
    this.canvas.dataset.origin = x(0);
    this.canvas.dataset.scale = scale;
    this.canvas.dataset.glow = [1, 2].map((j) => this.glow(j, t, speed).toFixed(3));
    this.readings(t);
  }

  glow(j, t, speed) {
    const since = this.plan.contacts.filter((c) => c.finger === j && c.t <= t).map((c) => t - c.t);
    return since.length ? Math.max(0, 1 - Math.min(...since) / (FLASH * speed)) : 0;
  }

  axis(pen, x, width, scale) {
    pen.strokeStyle = color("--rule");
    pen.fillStyle = color("--muted");
    pen.lineWidth = 1;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.beginPath();
    pen.moveTo(0, FLOOR + 0.5);
    pen.lineTo(width, FLOOR + 0.5);
    for (const mark of ticks(1e3 * (this.low - 70 / scale), 1e3 * (this.high + 70 / scale),
      width / Math.min(90, 40 + width / 12))) {
      const at = Math.round(x(1e-3 * mark.at)) + 0.5;
      pen.moveTo(at, FLOOR);
      pen.lineTo(at, FLOOR + 5);
      pen.fillText(mark.label.replace("-", "−"), at, FLOOR + 15);
    }
    pen.stroke();
    pen.textAlign = "right";
    pen.fillText("x in mm", width - 4, FLOOR - 9);
  }

  target(pen, x, t) {
    if (!this.plan.target) return;
    const at = x(this.at(this.plan.target, t));
    this.targetLine(pen, at, MIDDLE - TALL / 2 - 8);
    pen.textAlign = "center";
    pen.fillText("target", at, MIDDLE - TALL / 2 - 18);
  }

  targetLine(pen, at, top) { // from a height down to the floor
    pen.strokeStyle = pen.fillStyle = color("--ink");
    pen.setLineDash([4, 4]);
    pen.beginPath();
    pen.moveTo(at, top);
    pen.lineTo(at, FLOOR);
    pen.stroke();
    pen.setLineDash([]);
  }

  finger(pen, face, j) {
    const left = j === 1 ? face : face - THICK;
    pen.fillStyle = color(`--finger${j}`);
    pen.beginPath();
    pen.roundRect(left, MIDDLE - TALL / 2, THICK, TALL, j === 1 ? [0, 8, 8, 0] : [8, 0, 0, 8]);
    pen.fill();
    pen.fillStyle = color("--on-finger");
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(`${j}`, left + THICK / 2, MIDDLE);
  }

  flash(pen, at, glow) {
    shine(pen, at, MIDDLE, 60, glow);
    pen.save();
    pen.globalAlpha = glow;
    pen.fillStyle = color("--flash");
    pen.fillRect(at - 2, MIDDLE - TALL / 2, 4, TALL);
    pen.restore();
  }

  // The actuator's force points to the finger's back or from it, the object's from the surface on.
  arrow(pen, at, y, force, j, where) {
    const length = this.reach * Math.sqrt(Math.abs(force) / this.strongest) * Math.sign(force);
    if (Math.abs(length) < 2) return;
    const pushes = where === "outer" && Math.sign(force) === -SIDE[j];
    const from = pushes ? at - length : at;
    const name = where === "outer" ? `--finger${j}` : "--ink";
    pointed(pen, [from, y], [Math.sign(force), 0], Math.abs(length), name);
  }

  lens(pen, width, height, j, apart, glow) {
    const wide = Math.min(220, width / 2 - 24), tall = 92, top = height - tall - 22;
    const left = j === 2 ? width / 2 - wide - 12 : width / 2 + 12, scale = wide / LENS;
    const middle = left + wide / 2;
    pen.save();
    pen.beginPath();
    pen.roundRect(left, top, wide, tall, 8);
    pen.fillStyle = color("--lens");
    pen.fill();
    pen.clip();
    pen.fillStyle = color("--object");
    pen.fillRect(j === 2 ? middle : left, top, wide / 2, tall);
    pen.fillStyle = color(`--finger${j}`);
    const face = middle + apart * scale;
    if (j === 1) pen.fillRect(face, top + 16, wide, tall - 32);
    else pen.fillRect(left, top + 16, face - left, tall - 32);
    if (glow > 0) {
      pen.globalAlpha = glow;
      pen.fillStyle = color("--flash");
      pen.fillRect(middle - 3, top, 6, tall);
    }
    pen.restore();
    pen.fillStyle = color("--muted");
    pen.textAlign = "center";
    pen.fillText(wide < 200 ? `finger ${j}, ${1e3 * LENS} mm wide`
      : `contact of finger ${j}, ${1e3 * LENS} mm wide`, middle, top + tall + 12);
    if (Math.abs(apart) < LENS / 2) return; // else it is not in this window yet: how far away it is
    pen.fillText(`${text(1e3 * Math.abs(apart), 1)} mm${wide < 200 ? "" : " away"}`, j === 1 ? middle + wide / 4
      : middle - wide / 4, top + tall / 2);
  }

  readings(t) {
    for (const cell of document.querySelectorAll("#readings output")) {
      const series = this.series.get(cell.dataset.signal);
      const value = valueAt(this.recording.time, series, t);
      const top = series.levels.at(-1); // of the whole run, so that the unit stays the same
      const sign = (page.negated ?? []).includes(cell.dataset.signal) ? -1 : 1;
      const { factor, unit } = scaled(
        series.unit, Math.max(...top.high.map(Math.abs), ...top.low.map(Math.abs)));
      cell.textContent = series.steps ? (value ? "yes" : "no") : `${text(sign * value * factor || 0)} ${unit}`;
    }
  }
}

// An arrow from a place, so many px long; way is its direction, of length 1.
function pointed(pen, from, way, length, name) {
  const along = (px, beside = 0) =>
    [from[0] + px * way[0] + beside * way[1], from[1] + px * way[1] - beside * way[0]];
  pen.strokeStyle = pen.fillStyle = color(name);
  pen.lineWidth = 2.5;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...along(length - 4));
  pen.stroke();
  pen.beginPath();
  pen.moveTo(...along(length));
  pen.lineTo(...along(length - 8, 4.5));
  pen.lineTo(...along(length - 8, -4.5));
  pen.fill();
  pen.lineWidth = 1;
}

function shine(pen, x, y, radius, glow) { // the light of a new contact
  const light = pen.createRadialGradient(x, y, 0, x, y, radius);
  light.addColorStop(0, color("--flash"));
  light.addColorStop(1, `${color("--flash")}00`);
  pen.save();
  pen.globalAlpha = glow;
  pen.fillStyle = light;
  pen.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
  pen.restore();
}

let Picture = Grasp; // what is drawn; a hand is drawn otherwise

// Playing it ---------------------------------------------------------------------------------
let playing = false, before = 0;
const chosenSpeed = () => Number(find("speed").value); // 0: slow around contacts

function speed() {
  const { contacts } = page.scene;
  const near = contacts.some((c) => cursor >= c.t - AROUND[0] && cursor < c.t + AROUND[1]);
  return chosenSpeed() || (near ? SLOW : 1);
}

function play(on) {
  playing = on;
  find("play").textContent = on ? "Pause" : "Play";
  if (on && cursor >= recording.last) cursor = recording.first;
  before = performance.now();
  if (on) requestAnimationFrame(advance);
}

function advance(now) {
  if (!playing) return;
  // A frame ends at the next change of speed at the latest, so that no contact is jumped over.
  const edges = page.scene.contacts.flatMap((c) => [c.t - AROUND[0], c.t + AROUND[1]]);
  const next = cursor + speed() * Math.min((now - before) / 1000, 0.1);
  seek(Math.min(next, ...edges.filter((t) => t > cursor + 1e-9)));
  before = now;
  if (cursor >= recording.last) play(false);
  else requestAnimationFrame(advance);
}

function connectScene() {
  find("scrub").addEventListener("input", () => {
    play(false);
    seek(Number(find("scrub").value));
  });
  find("play").addEventListener("click", () => play(!playing));
  find("speed").addEventListener("change", redraw);
  for (const button of document.querySelectorAll("button[data-at]")) {
    button.addEventListener("click", () => {
      play(false);
      seek(Number(button.dataset.at));
    });
  }
}

// What draws a grasp at the time of the cursor, and plays it.
function sceneOf(plan, series) {
  let grasp;
  const renew = (plan, series) => {
    grasp = new Picture(recording, plan, new Map(series.map((one) => [one.name, one])));
    find("scrub").min = recording.first;
    find("scrub").max = recording.last;
  };
  renew(plan, series);
  const draw = () => {
    grasp.draw(cursor, chosenSpeed() || SLOW);
    find("scrub").value = cursor;
    find("clock").textContent = clock(cursor);
    find("pace").textContent = chosenSpeed() ? "" : `${speed()} × real time`;
  };
  return { draw, renew, toggle: () => play(!playing) };
}

async function startScene(plan) {
  connectScene();
  const series = await Promise.all(plan.signals.map((name) => recording.series(name)));
  return sceneOf(plan, series);
}
