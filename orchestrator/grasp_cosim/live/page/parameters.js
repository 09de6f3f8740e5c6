// The panel of what can be set: boxes and sliders, what they ask for, and what the run answers.
"use strict";

const DIGITS = 3; // of a value that a slider chooses

// A slider goes evenly over a narrow range. Over a wide one it is finest around the first value.
class Scale {
  constructor({ low, high, value }) {
    [this.low, this.high] = [low, high];
    const size = Math.abs(Number(value)) || 1e-3 * (high - low);
    this.unit = high - low > 20 * size ? size / 3 : 0;
    [this.begin, this.end] = [this.bent(low), this.bent(high)];
  }

  bent(value) {
    return this.unit ? Math.asinh(value / this.unit) : value;
  }

  place(value) { // from 0 to 1000
    return 1000 * (this.bent(value) - this.begin) / (this.end - this.begin);
  }

  value(place) {
    if (place <= 0) return this.low;
    if (place >= 1000) return this.high;
    const bent = this.begin + (this.end - this.begin) * place / 1000;
    const value = this.unit ? this.unit * Math.sinh(bent) : bent;
    return clamp(Number(value.toPrecision(DIGITS)), this.low, this.high);
  }
}

class Parameter {
  constructor(row, entry) {
    [this.row, this.entry, this.value] = [row, entry, entry.value];
    this.box = row.querySelector("input:not([type=range]), select");
    this.slider = row.querySelector("input[type=range]");
    this.refusal = row.querySelector(".refusal");
    this.box.addEventListener("change", () => this.ask(this.chosen()));
    if (!this.slider) return;
    this.scale = new Scale(entry);
    this.slider.addEventListener("input", () => this.write(this.ofSlider()));
    this.slider.addEventListener("change", () => this.ask(this.ofSlider()));
    this.show(entry.value);
  }

  ofSlider() {
    const value = this.scale.value(Number(this.slider.value));
    return this.entry.kind === "Integer" ? Math.round(value) : value;
  }

  chosen() {
    if (this.box.type === "checkbox") return this.box.checked;
    return this.entry.kind === "String" ? this.box.value : Number(this.box.value);
  }

  write(value) { // into the box, and what a slider tells those who do not see it
    if (this.box.type === "checkbox") this.box.checked = Boolean(value);
    else this.box.value = value;
    this.slider?.setAttribute("aria-valuetext", `${value} ${this.entry.unit}`);
  }

  show(value) {
    this.value = value;
    this.write(value);
    if (this.slider) this.slider.value = this.scale.place(Number(value));
  }

  async ask(value) {
    const order = this.order = (this.order || 0) + 1;
    this.row.classList.add("waits");
    let reply = {};
    try {
      const body = JSON.stringify({ name: this.entry.name, value });
      const response = await fetch("set",
        { method: "POST", headers: { "Content-Type": "application/json" }, body });
      reply = await response.json();
    } catch {
      reply = { error: `set: ${this.entry.name}: the run does not answer: it may have ended` };
    }
    if (order !== this.order) return; // another one was asked for meanwhile
    this.row.classList.remove("waits");
    this.refusal.textContent = reply.error || "";
    this.show("value" in reply ? reply.value : this.value);
  }

  take(value) { // what another page has set
    const busy = this.row.classList.contains("waits") || this.row.contains(document.activeElement);
    if (value === this.value) return;
    if (busy) this.value = value;
    else this.show(value);
  }
}

const parameters = new Map();

function startParameters(entries) {
  for (const row of document.querySelectorAll(".parameter")) {
    const entry = entries[row.dataset.number];
    parameters.set(entry.name, new Parameter(row, entry));
  }
  find("find-parameter")?.addEventListener("input", (event) => {
    const words = event.target.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const { row, entry } of parameters.values()) {
      const said = `${entry.name} ${entry.text}`.toLowerCase();
      row.hidden = !words.every((word) => said.includes(word));
    }
    for (const group of document.querySelectorAll("#parameters details")) {
      const some = group.querySelector(".parameter:not([hidden])");
      group.hidden = !some;
      if (words.length) group.open = Boolean(some);
    }
  });
}
