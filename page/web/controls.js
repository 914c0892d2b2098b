/** Numbers with a slider. Its range is that of interest; the number field takes all that the model allows. */
const NUMBERS = [
  { key: "run.wheel_speed_rpm", place: "speed", label: "Wheel speed", symbol: "N", unit: "rpm", from: 1200, to: 2100, step: 1 },
  { key: "dither.amplitude_v", place: "dither", label: "Amplitude", symbol: "W", unit: "V", from: 0, to: 1.4, step: 0.005 },
  { key: "dither.start_time_s", place: "dither", label: "Start", symbol: "", unit: "s", from: 0, to: 15, step: 0.5 },
  { key: "friction.coefficient", place: "friction", label: "Coefficient", symbol: "\u03bc", unit: "", from: 0, to: 0.5, step: 0.005 },
  { key: "run.sideslip_rad", place: "start", label: "Sideslip angle", symbol: "\u03b2", unit: "rad", from: -0.4, to: 0.4, step: 0.005 },
  { key: "run.yaw_rate_rad_per_s", place: "start", label: "Yaw rate", symbol: "\u03b3", unit: "rad/s", from: -2, to: 2, step: 0.05 },
  { key: "run.steering_angle_rad", place: "start", label: "Steering angle", symbol: "\u03b4", unit: "rad", from: -0.6, to: 0.6, step: 0.005 },
  { key: "run.steering_rate_rad_per_s", place: "start", label: "Steering rate", symbol: "\u03b4\u2032", unit: "rad/s", from: -2, to: 2, step: 0.05 },
  { key: "steering.motor_current_a", place: "model", label: "Motor current", symbol: "i", unit: "A", from: -20, to: 20, step: 0.5 },
  { key: "run.duration_s", place: "model", label: "Length of the run", symbol: "", unit: "s", from: 5, to: 60, step: 1 },
];

/** Parameters that are one of a few names. */
const CHOICES = [
  { key: "dither.waveform", place: "dither", label: "Waveform", names: { none: "none", square: "square", sine: "sine" } },
  { key: "dither.application", place: "dither", label: "Applied as", names: { averaged: "mean", signal: "true signal" } },
  { key: "controller.suppression", place: "dither", label: "Delayed feedback", names: { dither: "off", delayed_feedback: "on" } },
  { key: "friction.law", place: "friction", label: "Law", names: { coulomb_rate: "on the rate", printed_angle: "as printed", none: "none" } },
  { key: "friction.dithered", place: "friction", label: "Dithered", names: { false: "no", true: "yes" } },
  { key: "tires.model", place: "model", label: "Tyre", names: { cubic: "cubic", magic_formula: "Magic Formula" } },
  { key: "vehicle.slip_form", place: "model", label: "Slip angles", names: { small_angle: "small", exact: "exact" } },
];

/** Amplitudes of interest, V: the paper's volts are an angle, of another scale for each waveform. */
const AMPLITUDES = { none: { to: 1.4, step: 0.005 }, square: { to: 0.2, step: 0.001 }, sine: { to: 1.4, step: 0.005 } };

/** Whether the motor's torque suppresses the chaos, and no dither. */
const hasFeedback = (scenario) => scenario.controller.suppression === "delayed_feedback";

/** An element with attributes and children. */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [attribute, value] of Object.entries(attributes)) made.setAttribute(attribute, value);
  made.append(...children);
  return made;
}

/** The value of a parameter in a scenario. */
function valueOf(scenario, key) {
  return key.split(".").reduce((section, name) => section[name], scenario);
}

/** Sliders, fields and choices in the fieldsets of the page. `change(key, value)` is called for every change by the user. */
class Controls {
  #fields = new Map();

  constructor(model, change) {
    for (const choice of CHOICES) this.#addChoice(choice, change);
    for (const number of NUMBERS) this.#addNumber(number, model.range(number.key), change);
  }

  /** Shows a scenario, but for the field that the user is editing. */
  show(scenario) {
    for (const [key, { set }] of this.#fields) set(String(valueOf(scenario, key)), scenario);
  }

  /** Marks the number that an error message names, and no other. */
  mark(message) {
    for (const [key, { field }] of this.#fields) {
      const isNamed = message.startsWith(`${key} `) || message.startsWith(`${key}=`);
      if (isNamed) field.setAttribute("aria-invalid", "true");
      else field.removeAttribute("aria-invalid");
    }
  }

  #addNumber({ key, place, label, symbol, unit, from, to, step }, [least, greatest], change) {
    const title = `${label}${symbol ? ` ${symbol}` : ""}`;
    const slider = element("input", { type: "range", id: `slider ${key}`.replace(" ", "-"), min: from, max: to, step, "aria-label": `${label}${unit ? `, ${unit}` : ""}` });
    const field = element("input", { type: "number", id: key, min: least, max: greatest, step: "any", inputmode: "decimal", "aria-label": `${label}${unit ? `, ${unit}` : ""}, as a number` });
    slider.addEventListener("input", () => change(key, slider.value));
    field.addEventListener("input", () => change(key, field.value));
    const name = element("span", { class: "name" }, label);
    if (symbol) name.append(" ", element("i", {}, symbol));
    document.getElementById(place).append(
      element("div", { class: "number", title }, name, slider, element("span", { class: "value" }, field, element("span", { class: "unit" }, unit))),
    );
    const set = (value, scenario) => {
      if (key === "dither.amplitude_v") {
        const waveform = scenario.dither.waveform;
        slider.max = AMPLITUDES[waveform].to;
        slider.step = AMPLITUDES[waveform].step;
        slider.disabled = field.disabled = waveform === "none" || hasFeedback(scenario);
      }
      slider.value = value;
      slider.setAttribute("aria-valuetext", `${value} ${unit}`);
      if (document.activeElement !== field || Number(field.value) !== Number(value)) field.value = value;
    };
    this.#fields.set(key, { field, set });
  }

  #addChoice({ key, place, label, names }, change) {
    const group = element("div", { class: "choice", role: "radiogroup", "aria-label": label }, element("span", { class: "name" }, label));
    const options = element("span", { class: "options" });
    const inputs = Object.entries(names).map(([name, words]) => {
      const input = element("input", { type: "radio", name: key, value: name, id: `${key}-${name}` });
      input.addEventListener("change", () => change(key, name));
      options.append(element("label", {}, input, element("span", {}, words)));
      return input;
    });
    group.append(options);
    document.getElementById(place).append(group);
    const set = (value, scenario) => {
      for (const input of inputs) {
        input.checked = input.value === value;
        input.disabled = key.startsWith("dither.") && hasFeedback(scenario);
      }
    };
    this.#fields.set(key, { field: group, set });
  }
}
