// The playground at work: settings, all of them in the address after the #, and a run for each.
"use strict";

const { system } = page;
const PRINTED = { "N.s/m": "N·s/m", "N.s": "N·s", "V.m^n": "V·mⁿ", "1": "" };
const LINE = { 1: { color: "--finger1", dash: 0 }, 2: { color: "--finger2", dash: 1 } };
const STEPS = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 8e-3, 1e-2, 2e-2, 3e-2, 4e-2]; // s
const MOST = 200000; // steps of a run
const VIEW = ["at", "t"]; // of the address, what is no setting

const recording = { time: new Float64Array(1), first: 0, last: 0 };
let simulation = null, settings = null, latest = "", named = null, asked = false;

const digits = (value) => Number(value.toPrecision(12)); // so that 30 mm is 0.03 m to the bit
const plural = (n) => n.toLocaleString("en");

// Settings ------------------------------------------------------------------------------------
const start = () => ({ plant: "fixed", controller: "published", case: 2, bench: false,
  step: system.step, stop: system.stop, scheme: "sequential", values: new Map() });

// What holds where the settings do not say otherwise.
function defaults({ case: number, bench }) {
  return new Map(Object.entries({
    ...system.values, ...system.cases[number], ...(bench ? system.bench : {}) }));
}

const components = () => simulation.components(settings);
const parameters = () => simulation.parameters(components());

function valueOf(name) {
  const own = settings.values.get(name) ?? defaults(settings).get(name);
  return own ?? parameters().get(name)?.start;
}

function setValue(name, value) {
  const usual = defaults(settings).get(name) ?? parameters().get(name)?.start;
  if (value === usual) settings.values.delete(name);
  else settings.values.set(name, value);
}

// What is set beyond the defaults, of variables that these components have.
function differing() {
  const there = parameters();
  return [...settings.values].filter(([name]) => there.has(name));
}

const stepNs = () => Math.round(settings.step * 1e9);
const steps = () => clamp(Math.round(settings.stop * 1e9 / stepNs()), 1, MOST);
const stop = () => steps() * stepNs() / 1e9;

// The address ---------------------------------------------------------------------------------
function written() { // what the settings are as an address, without what is in view
  const { plant, controller, case: number, bench, step, scheme } = settings;
  const usual = start(), parts = [];
  if (plant !== usual.plant) parts.push(["plant", plant]);
  if (controller !== usual.controller) parts.push(["controller", controller]);
  if (number !== usual.case) parts.push(["case", number]);
  if (bench) parts.push(["bench", 1]);
  if (step !== usual.step) parts.push(["step", step]);
  if (stop() !== usual.stop) parts.push(["stop", stop()]);
  if (scheme !== usual.scheme) parts.push(["scheme", scheme]);
  return new URLSearchParams([...parts, ...differing()].map((part) => part.map(String))).toString();
}

function read(address) { // settings from an address; a line for each part that is none
  const found = start(), wrong = [];
  const asks = new URLSearchParams(address.replaceAll("+", "%2B"));
  const pick = (key, valid, value = asks.get(key)) => {
    if (valid.includes(value)) found[key] = value;
    else if (asks.has(key)) wrong.push(`${key}=${asks.get(key)}: must be one of ${valid.join(", ")}`);
  };
  pick("plant", Object.keys(system.plants));
  pick("controller", Object.keys(system.laws));
  pick("case", [0, 1, 2], asks.has("case") ? Number(asks.get("case")) : 2);
  pick("scheme", ["sequential", "jacobi"]);
  found.bench = asks.get("bench") === "1";
  for (const [key, low, high] of [["step", 1e-6, 1], ["stop", 1e-3, 1000]]) {
    const value = Number(asks.get(key));
    if (asks.has(key) && value >= low && value <= high) found[key] = value;
    else if (asks.has(key)) wrong.push(`${key}=${asks.get(key)}: must be from ${low} to ${high} s`);
  }
  const there = simulation.parameters(simulation.components(found));
  for (const [key, text] of asks) {
    if (VIEW.includes(key) || (key in found && key !== "values")) continue;
    const value = there.has(key) ? parsed(text, there.get(key).type) : undefined;
    if (value === undefined) wrong.push(`${key}=${text}: no such parameter, or no value for it`);
    else found.values.set(key, value);
  }
  return { found, wrong };
}

function parsed(text, type) { // the value of a parameter, undefined where the text is none
  if (type === BOOLEAN) return { true: true, false: false, 1: true, 0: false }[text.trim()];
  const value = Number(text);
  return text.trim() && Number.isFinite(value) && (type === REAL || value === (value | 0))
    ? value : undefined;
}

function address() {
  const all = whole(), parts = [written()];
  if (view.from > all.from || view.to < all.to) parts.push(`t=${view.from},${view.to}`);
  if (!playing && cursor > 0) parts.push(`at=${digits(cursor)}`);
  return parts.filter(Boolean).join("&");
}

function remember() {
  clearTimeout(remember.later);
  remember.later = setTimeout(() => history.replaceState(null, "", `#${address()}`), 300);
}

function recall() {
  const { found, wrong } = read(location.hash.slice(1));
  settings = found;
  view = null;
  simulate();
  if (wrong.length) find("message").textContent = wrong.join("; ");
  const asks = new URLSearchParams(location.hash.slice(1));
  const [from, to] = (asks.get("t") || "").split(",").map(Number);
  if (to > from) zoom(from, to);
  if (asks.get("at")) seek(Number(asks.get("at")) || 0);
}

// The command that does the same.
function command() {
  const { plant, controller, case: number, bench, step, scheme } = settings, usual = start();
  const words = ["grasp-cosim run"];
  if (plant !== usual.plant) words.push(`--swap plant=fmus/build/${system.plants[plant]}.fmu`);
  if (controller !== usual.controller) words.push(`--controller ${controller}`);
  if (number !== usual.case) words.push(`--case ${number}`);
  if (bench) words.push("--preset bench");
  if (step !== usual.step) words.push(`--step ${step}`);
  if (stop() !== usual.stop) words.push(`--stop ${stop()}`);
  if (scheme !== usual.scheme) words.push(`--scheme ${scheme}`);
  for (const [name, value] of differing()) {
    words.push(`--set ${name.includes("[") ? `"${name}=${value}"` : `${name}=${value}`}`);
  }
  return words.join(" ");
}

// A run ---------------------------------------------------------------------------------------
function changed() { // at most one run a frame, however fast the slider moves
  if (!asked) requestAnimationFrame(simulate);
  asked = true;
}

function simulate() {
  asked = false;
  const began = performance.now(), there = parameters();
  const values = [...defaults(settings), ...settings.values].filter(([name]) => there.has(name));
  const run = simulation.run({ ...settings, values, stepNs: stepNs(), steps: steps(),
    jacobi: settings.scheme === "jacobi" });
  const rows = run.time.length, simulated = performance.now() - began;
  find("message").textContent = run.error;
  document.body.classList.toggle("stale", rows < 2);
  if (rows >= 2) take(run);
  else find("summary").textContent = "";
  view ??= whole();
  controls();
  find("took").textContent = rows < 2 ? "" : `· ${plural(rows - 1)} steps of `
    + `${digits(1e3 * settings.step)} ms, simulated in ${simulated.toFixed(0)} ms`;
  draw();
  state.took = performance.now() - began;
}

function take(run) {
  const { from, to } = view || whole(), all = !view || (from <= recording.first && to >= recording.last);
  const metrics = metricsOf(run);
  Object.assign(recording, { time: run.time, first: 0, last: run.time[run.time.length - 1] });
  page.scene.contacts = contactsOf(run, metrics);
  page.marks = page.scene.contacts.map(({ t, finger }) => ({ t, color: `--finger${finger}` }));
  scene = sceneOf(page.scene, page.scene.signals.map((name) => drawn(name, run.signal(name))));
  lines(run);
  view = whole();
  if (!all) zoom(from, to);
  seek(cursor);
  state.metrics = JSON.stringify(metrics);
  tell(metrics);
}

// The moments in which a finger begins to touch: the first is that of the metrics.
function contactsOf(run, metrics) {
  const found = [];
  for (const j of [1, 2]) {
    const touching = run.of("plant.contact", j);
    let first = metrics.time_to_contact[j - 1];
    for (let k = 0; k < touching.length; k++) {
      if (!touching[k] || (k && touching[k - 1])) continue;
      found.push({ t: first ?? run.time[k], finger: j });
      first = null;
    }
  }
  return found.sort((a, b) => a.t - b.t);
}

function drawn(name, values) { // a signal of the hand: of its extremes the hand needs those of all
  let low = Infinity, high = -Infinity;
  for (const v of values) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return { name, values, levels: [{ low: [low], high: [high] }] };
}

// Traces --------------------------------------------------------------------------------------
const SCALE = (factor, unit) => ({ factor, unit, decimals: 3 });
const TRACES = [
  { title: "gap", scale: SCALE(1e3, "mm"), of: (run) => fingers((j) => run.of("plant.gap", j)) },
  { title: "contact force", scale: SCALE(1, "N"),
    of: (run) => fingers((j) => run.of("plant.contact_force", j).map(Math.abs)) },
  { title: "target", scale: SCALE(1e3, "mm"), of: (run) => [
    { name: "target of the controller", values: run.signal("controller.target_position"),
      style: { color: "--ink", dash: 0 } },
    { name: "middle of the object", values: run.signal("plant.object_position"),
      style: { color: "--muted", dash: 2 } }] },
  { title: "closing speed", scale: SCALE(1e3, "mm/s"), of: (run) => fingers(
    (j) => run.of("plant.velocity", j).map((v) => CLOSING[j] * v)) },
  { title: "ratio of the reflectances, learnt", scale: SCALE(1, ""),
    needs: "controller.reflectance_ratio", of: (run) => [
      { name: "right to left", values: run.signal("controller.reflectance_ratio"),
        style: { color: "--ink", dash: 0 } }] },
];

const fingers = (values) => [1, 2].map((j) => (
  { name: `finger ${j}`, values: values(j), style: LINE[j] }));

function lines(run) { // the panels of these traces, made when they are first needed
  panels = TRACES.filter(({ needs }) => !needs || run.has(needs)).map((trace) => {
    const series = trace.of(run).map((one) => ({ ...one, unit: trace.scale.unit, text: "",
      scale: trace.scale, levels: pyramid(one.values) }));
    trace.panel ??= new Panel(recording, trace.title, series, find("plots"));
    trace.panel.series = series;
    return trace.panel;
  });
  for (const { panel } of TRACES) if (panel) panel.root.hidden = !panels.includes(panel);
}

// Numbers -------------------------------------------------------------------------------------
function shown(value, factor) {
  if (value === null) return "none";
  if (typeof value === "boolean") return value ? "yes" : "no";
  return text(value * factor, 3);
}

function touches({ time_to_contact: [a, b], impact_velocity: speeds, steady_contact_force: forces }) {
  if (a === null && b === null) return "Neither finger touches the object.";
  if (a === null || b === null) {
    return `Finger ${a === null ? 2 : 1} alone touches, at ${text(a ?? b, 3)} s.`;
  }
  const [v, w] = speeds.map((speed) => (speed === null ? "?" : text(1e3 * speed, 1)));
  return `Both touch, ${text(Math.abs(b - a), 3)} s apart, at ${v} and ${w} mm/s; in the end they press `
    + `with ${forces.map((force) => text(force, 2)).join(" and ")} N.`;
}

function happens({ object_shift: shift, toppled, damaged }) { // to the object
  if (toppled) return "The object topples.";
  if (damaged) return "The object is damaged.";
  return shift >= 5e-4 ? `The object is shifted by ${text(1e3 * shift, 1)} mm.` : "";
}

function tell(metrics) {
  find("summary").textContent = [touches(metrics), happens(metrics)].filter(Boolean).join(" ");
  find("metrics").replaceChildren(...page.metrics
    .filter(({ name, reason }) => name in metrics
      && !(reason && metrics[name].every((value) => value === null)))
    .map(({ name, title, unit, factor, text }) => {
      const row = document.createElement("tr"), values = [metrics[name]].flat();
      row.title = text;
      row.insertCell().textContent = title;
      for (const value of values) {
        const cell = row.insertCell();
        cell.className = values.length > 1 ? "n" : "both";
        if (values.length === 1) cell.colSpan = 2;
        cell.textContent = shown(value, factor);
      }
      row.insertCell().textContent = PRINTED[unit] ?? unit.replaceAll(".", "·");
      return row;
    }));
}

// Controls ------------------------------------------------------------------------------------
function made(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const subscripts = (label) => label.split(/_(\w+)/).map((part, i) => (
  i % 2 ? made("sub", { textContent: part }) : part));

function picks(id, options, act) {
  find(id).append(...options.map(([value, label]) => {
    const input = made("input", { type: "radio", name: id, value });
    input.addEventListener("change", () => act(input.value));
    return made("label", {}, input, made("span", { textContent: label }));
  }));
}

function slider(control) {
  const { name, label, unit, low, high, step } = control;
  const range = made("input", { type: "range", id: name, min: low, max: high, step });
  const number = made("input", { type: "number", id: `${name}-number`, step: "any" });
  const plain = label.replace("_", " ") + (unit && ` in ${unit}`);
  range.setAttribute("aria-label", plain);
  number.setAttribute("aria-label", plain);
  const act = (input) => {
    if (input.value === "" || !Number.isFinite(input.valueAsNumber)) return;
    control.variables.forEach((variable, i) => {
      const sign = i && control.mirrored ? -1 : 1;
      setValue(variable, sign * digits(input.valueAsNumber / control.per));
    });
    changed();
  };
  range.addEventListener("input", () => act(range));
  number.addEventListener("change", () => act(number));
  const head = made("label", { htmlFor: name }, ...subscripts(label));
  const value = made("span", { className: "value" }, number, " ",
    made("span", { className: "unit", textContent: unit }));
  control.row = made("div", { className: "control" }, head, value, range);
  Object.assign(control, { range, number });
  return control.row;
}

const CONTROLS = system.groups.flatMap(({ controls: of }) => of);

function build() {
  picks("case", [[0, "0"], [1, "1"], [2, "2"]], (value) => {
    for (const name of Object.keys(system.cases[2])) settings.values.delete(name);
    settings.case = Number(value);
    changed();
  });
  picks("controller", [["published", "published"], ["adaptive", "adaptive"]], (value) => {
    settings.controller = value;
    changed();
  });
  picks("plant", [["fixed", "fixed"], ["soft", "soft"], ["movable", "movable"]], (value) => {
    settings.plant = value;
    changed();
  });
  find("groups").append(...system.groups.map((group) => {
    group.root = made("details", { open: Boolean(group.open) },
      made("summary", { textContent: group.name }), ...group.controls.map(slider));
    return group.root;
  }));
  const groups = new Map();
  system.presets.forEach((preset, i) => {
    if (!groups.has(preset.page)) groups.set(preset.page, made("optgroup", { label: preset.page }));
    groups.get(preset.page).append(new Option(preset.name, i));
  });
  find("preset").append(...groups.values(), new Option("your own settings", "", false, false));
  find("step").append(...STEPS.map((s) => new Option(`${digits(1e3 * s)} ms`, s)));
  connectControls();
  connectScene();
  gestures();
}

// The object follows a pointer, in steps of its slider.
function carry(event) {
  const { variables: [name], per, low, high, step } = CONTROLS.find((one) => one.name === "position");
  const canvas = find("fingers"), begin = valueOf(name) * per, from = event.clientX;
  if (event.button !== 0) return;
  const move = (now) => {
    const by = (now.clientX - from) / canvas.dataset.scale * per;
    const value = clamp(step * Math.round((begin + by) / step), low, high);
    setValue(name, digits(value / per));
    changed();
  };
  const up = () => {
    canvas.removeEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) canvas.removeEventListener(end, up);
  };
  canvas.setPointerCapture(event.pointerId);
  canvas.addEventListener("pointermove", move);
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, up);
}

function connectControls() {
  find("fingers").addEventListener("pointerdown", carry);
  find("controls").addEventListener("submit", (event) => event.preventDefault());
  find("preset").addEventListener("change", () => choose(find("preset").value));
  find("previous").addEventListener("click", () => turn(-1));
  find("next").addEventListener("click", () => turn(1));
  for (const id of ["stop", "stop-number"]) {
    find(id).addEventListener(id === "stop" ? "input" : "change", () => {
      const value = find(id).valueAsNumber;
      if (value > 0 && value <= 1000) settings.stop = value;
      changed();
    });
  }
  find("step").addEventListener("change", () => {
    settings.step = Number(find("step").value);
    changed();
  });
  find("jacobi").addEventListener("change", () => {
    settings.scheme = find("jacobi").checked ? "jacobi" : "sequential";
    changed();
  });
  find("bench").addEventListener("change", () => {
    settings.bench = find("bench").checked;
    changed();
  });
  find("name").addEventListener("input", describe);
  find("set").addEventListener("click", setAny);
  find("value").addEventListener("keydown", (event) => event.key === "Enter" && setAny());
  find("reset").addEventListener("click", () => choose(0));
  find("link").addEventListener("click", () => {
    copy(find("link"), `${location.href.split("#")[0]}#${address()}`);
  });
  find("copy").addEventListener("click", () => copy(find("copy"), command()));
  document.addEventListener("keydown", key);
  window.addEventListener("hashchange", recall);
  window.addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

async function copy(button, text) {
  const label = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  } catch {
    button.textContent = "The browser does not allow it";
  }
  setTimeout(() => { button.textContent = label; }, 1500);
}

function describe() {
  const found = parameters().get(find("name").value.trim());
  find("unit").textContent = found ? found.unit : "";
  find("meaning").textContent = found ? found.text : "";
  if (found) find("value").value = valueOf(find("name").value.trim());
}

function setAny() {
  const name = find("name").value.trim(), found = parameters().get(name);
  const value = found && parsed(find("value").value, found.type);
  if (value === undefined) {
    find("message").textContent = found ? `${name}: ${find("value").value}: no value for it`
      : `${name}: no such parameter`;
    return;
  }
  setValue(name, value);
  changed();
}

function choose(index) {
  if (index === "") return;
  settings = read(system.presets[index].at).found;
  latest = system.presets[index].name;
  view = null;
  simulate();
  present();
}

const still = matchMedia("(prefers-reduced-motion: reduce)");

function present() { // from the beginning, moving if that is wanted
  if (still.matches) return seek(recording.last);
  seek(0);
  play(true);
}

function turn(by) {
  const now = Number(find("preset").value || 0), n = system.presets.length;
  choose((now + by + n) % n);
}

// Every control as the settings are.
function controls() {
  const there = parameters(), covered = new Set();
  for (const [id, value] of [["case", settings.case], ["controller", settings.controller],
    ["plant", settings.plant]]) {
    for (const input of find(id).querySelectorAll("input")) input.checked = input.value === `${value}`;
  }
  for (const control of CONTROLS) {
    const { variables, plants, row, range, number, per, mirrored } = control;
    row.hidden = !there.has(variables[0]) || Boolean(plants && !plants.includes(settings.plant));
    if (row.hidden) continue;
    const values = variables.map(valueOf);
    covered.add(variables[0]);
    if (variables.length > 1 && values[1] === (mirrored ? -values[0] : values[0])) covered.add(variables[1]);
    range.value = number.value = digits(values[0] * per);
  }
  chips(differing().filter(([name]) => !covered.has(name)));
  const step = `${settings.step}`;
  if (![...find("step").options].some((option) => option.value === step)) {
    find("step").append(new Option(`${digits(1e3 * settings.step)} ms`, step));
  }
  find("step").value = step;
  find("stop").value = find("stop-number").value = stop();
  find("jacobi").checked = settings.scheme === "jacobi";
  find("bench").checked = settings.bench;
  if (there !== named) {
    find("names").replaceChildren(...[...there.keys()].map((value) => made("option", { value })));
    named = there;
  }
  find("command").textContent = command();
  preset();
}

function chips(others) {
  find("chips").replaceChildren(...others.map(([name, value]) => {
    const unit = parameters().get(name).unit;
    const away = made("button", { type: "button", textContent: "×", title: "As it was" });
    away.setAttribute("aria-label", `${name} as it was`);
    away.addEventListener("click", () => {
      settings.values.delete(name);
      changed();
    });
    return made("li", {}, `${name} = ${value} ${PRINTED[unit] ?? unit}`, away);
  }));
}

function preset() { // which of the documentation's grasps this is
  const now = written();
  const index = system.presets.findIndex((one) => one.address === now);
  find("preset").value = index < 0 ? "" : index;
  if (index >= 0) latest = system.presets[index].name;
  find("about").textContent = index < 0
    ? `Your own${latest ? `, from “${latest}”` : ""}.`
    : `${system.presets[index].text} (${system.presets[index].page})`;
}

// Keys ----------------------------------------------------------------------------------------
function key(event) {
  const field = event.target.closest("input, select, textarea, button, summary");
  const range = field && field.type === "range" && [" ", "[", "]"].includes(event.key);
  if ((field && !range) || event.ctrlKey || event.metaKey || event.altKey) return;
  const span = view.to - view.from, by = event.shiftKey ? settings.step : span / 100;
  const does = {
    " ": () => play(!playing),
    ArrowLeft: () => seek(cursor - by),
    ArrowRight: () => seek(cursor + by),
    "+": () => zoom(cursor - 0.25 * span, cursor + 0.25 * span),
    "-": () => zoom((view.from + view.to) / 2 - span, (view.from + view.to) / 2 + span),
    0: () => zoom(recording.first, recording.last),
    "[": () => turn(-1),
    "]": () => turn(1),
  }[event.key];
  if (!does) return;
  event.preventDefault();
  does();
}

async function begin() {
  simulation = await Simulation.load(system, find("wasm").textContent);
  build();
  for (const one of system.presets) { // in the form in which the page writes it
    settings = read(one.at).found;
    one.address = written();
  }
  settings = start();
  recall();
  if (!/[#&]at=/.test(location.hash)) present();
  state.ready = "yes";
}

begin();
