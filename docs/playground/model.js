// The simulation: the components in WebAssembly, set up, connected and run again for each change.
"use strict";

const REAL = 0, BOOLEAN = 1;

class Simulation {
  constructor(system, exports) {
    this.system = system;
    this.wasm = exports;
    this.known = new Map(); // parameters, by components
    exports._initialize();
  }

  static async load(system, base64) {
    const { instance } = await WebAssembly.instantiate(await inflate(base64));
    return new Simulation(system, instance.exports);
  }

  // The FMUs of the components with these choices, by component.
  components({ plant, controller }) {
    const { system } = this;
    return { ...system.components, plant: system.plants[plant], controller: system.laws[controller] };
  }

  // Where a variable like plant.gap[1] is: {component, type, vr, unit, start, causality}; or undefined.
  find(components, name) {
    const dot = name.indexOf("."), component = name.slice(0, dot);
    const variables = this.system.models[components[component]] || [];
    const vr = variables.findIndex(([own]) => own === name.slice(dot + 1));
    if (vr < 0) return undefined;
    const [, type, causality, unit, start, text] = variables[vr];
    return { component, type, vr, causality, unit, start, text };
  }

  // Every parameter that can be set, by name; of the same components the same map.
  parameters(components) {
    const key = Object.values(components).join();
    if (this.known.has(key)) return this.known.get(key);
    const found = new Map();
    this.known.set(key, found);
    for (const [component, model] of Object.entries(components)) {
      for (const [name, type, causality, unit, start, text] of this.system.models[model]) {
        if (causality === "parameter" && type !== null) {
          found.set(`${component}.${name}`, { type, unit, start, text });
        }
      }
    }
    return found;
  }

  get text() {
    const from = this.wasm.play_text(), bytes = new Uint8Array(this.wasm.memory.buffer, from, 2048);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  set text(value) {
    const bytes = new TextEncoder().encode(`${value}\0`);
    new Uint8Array(this.wasm.memory.buffer, this.wasm.play_text(), bytes.length).set(bytes);
  }

  // The run with these settings: {time, error, has(name), signal(name), of(name, finger)}. Its arrays
  // hold until the next one. It has no rows where the settings are refused; error says why.
  run({ plant, controller, values, stepNs, steps, jacobi }) {
    const { wasm } = this, components = this.components({ plant, controller });
    const names = Object.keys(components), columns = new Map();
    const kinds = Object.keys(this.system.models);
    const refused = () => ({ time: new Float64Array(0), error: this.text });
    wasm.play_begin();
    for (const name of names) {
      this.text = name;
      if (wasm.play_component(kinds.indexOf(components[name])) < 0) return refused();
    }
    for (const [name, value] of values) {
      const { component, type, vr } = this.find(components, name);
      if (!wasm.play_set(names.indexOf(component), type, vr, Number(value))) return refused();
    }
    names.forEach((name, i) => {
      this.system.models[components[name]].forEach(([output, type, causality], vr) => {
        if (causality === "output") columns.set(`${name}.${output}`, wasm.play_record(i, type, vr));
      });
    });
    for (const ends of this.system.connections) {
      const [from, to] = ends.map((name) => this.find(components, name));
      wasm.play_connect(names.indexOf(from.component), from.vr, names.indexOf(to.component), to.vr);
    }
    const rows = wasm.play_run(stepNs, steps, jacobi ? 1 : 0);
    if (!rows) return refused();
    const start = wasm.play_columns(), { buffer } = wasm.memory;
    const signal = (name) => new Float64Array(
      buffer, start + 8 * columns.get(name) * (steps + 1), rows);
    const time = new Float64Array(rows);
    for (let k = 0; k < rows; k++) time[k] = k * stepNs / 1e9;
    return {
      time, signal, error: rows <= steps ? this.text : "", has: (name) => columns.has(name),
      of: (name, finger) => signal(`${name}[${finger}]`),
    };
  }
}
