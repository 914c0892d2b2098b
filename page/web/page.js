/** Time without a change after which the address follows and the motion is measured, ms. */
const REST_MS = 150;

/** The settings of a link, by their keys; a preset discards those before it. */
function parse(text) {
  const settings = new Map();
  for (const setting of text.split("&").filter(Boolean)) {
    const [key, ...value] = setting.split("=");
    if (key === "preset") settings.clear();
    settings.set(key, value.join("="));
  }
  return settings;
}

function textOf(settings) {
  return Array.from(settings, ([key, value]) => `${key}=${value}`).join("&");
}

class Page {
  #settings = new Map();
  #shown = null;
  #timer = null;
  #worker = null;
  #measuring = null;
  #frame = null;
  #error = document.getElementById("error");
  #regime = document.getElementById("regime");

  constructor(model, module) {
    this.model = model;
    this.module = module;
    const code = ["model-code", "measuring-code"].map((id) => document.getElementById(id).textContent);
    this.#measuring = URL.createObjectURL(new Blob(code, { type: "text/javascript" }));
    this.plots = new Plots();
    this.playback = new Playback((time) => this.plots.mark(time));
    model.configure("");
    this.controls = new Controls(model, (key, value) => this.#change(key, value));
    this.#addPresets();
    addEventListener("hashchange", () => this.#restore());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.plots.draw());
    document.getElementById("skip").addEventListener("click", () => document.getElementById("settings").focus());
    document.getElementById("copy").addEventListener("click", () => this.#copy());
    const refused = this.#restore();
    if (refused) {
      this.#apply(new Map());
      this.#refuse(refused);
    }
  }

  /** Takes the settings of the address; returns why not if they are wrong, and then nothing changes. */
  #restore() {
    let text = location.hash.slice(1);
    if (text === textOf(this.#settings) && this.#shown) return "";
    try {
      text = decodeURIComponent(text);
    } catch {
      return this.#refuse(`The link is damaged: ${text}`);
    }
    const refused = this.#apply(parse(text), text);
    return refused && this.#refuse(`The link has a wrong setting. ${refused}`);
  }

  #change(key, value) {
    const settings = new Map(this.#settings);
    settings.set(key, value);
    // A slider's events come faster than frames.
    cancelAnimationFrame(this.#frame);
    this.#frame = requestAnimationFrame(() => this.#apply(settings));
    this.#settings = settings;
  }

  /** Configures the model, and shows its motion; if it refuses, the last motion stays, and the message is returned. */
  #apply(settings, text = textOf(settings)) {
    let scenario, run, without;
    try {
      scenario = this.model.configure(text);
      run = this.model.run();
      const isSuppressed = hasFeedback(scenario) || scenario.dither.waveform !== "none";
      without = isSuppressed ? this.model.run(false) : null;
    } catch (error) {
      return this.#refuse(error.message);
    }
    this.#refuse("");
    this.#settings = settings;
    const means = hasFeedback(scenario) ? "feedback" : "dither";
    this.#shown = { text, scenario, means, run, without, settled: null };
    this.controls.show(scenario);
    this.plots.show(this.#shown);
    this.playback.setEnd(run.states.length / COMPONENTS * run.step_s);
    document.getElementById("legend").hidden = !without;
    document.getElementById("means").textContent = means;
    for (const button of document.querySelectorAll("#presets button")) {
      button.setAttribute("aria-pressed", String(button.dataset.settings === textOf(settings)));
    }
    this.#regime.setAttribute("aria-busy", "true");
    clearTimeout(this.#timer);
    // A measurement of an earlier motion is abandoned.
    this.#worker?.terminate();
    this.#timer = setTimeout(() => this.#rest(), REST_MS);
    return "";
  }

  /** Shows why settings were refused, and returns it; an empty message is none. */
  #refuse(message) {
    this.#error.textContent = message;
    this.#error.hidden = message === "";
    this.controls.mark(message);
    return message;
  }

  /** Measures the motion, and writes the settings into the address, which browsers allow a few times per second only. */
  #rest() {
    this.#worker = new Worker(this.#measuring);
    this.#worker.addEventListener("message", ({ data: { measured, error } }) => {
      this.#regime.setAttribute("aria-busy", "false");
      if (error) return this.#report("Not measured", error, "unknown");
      this.#shown.settled = measured.leaves_bounds_at_s === null ? measured : null;
      this.plots.show(this.#shown);
      this.#showMeasured(measured);
    });
    this.#worker.postMessage({ module: this.module, settings: this.#shown.text });
    history.replaceState(null, "", `#${textOf(this.#settings)}`);
    document.getElementById("link").value = location.href;
  }

  #showMeasured({ regime, is_chaotic, has_exponent, exponent_per_s, standard_error_per_s, threshold_per_s, observed_s, transient_s, leaves_bounds_at_s }) {
    if (leaves_bounds_at_s !== null) {
      const text = `The state leaves all bounds at ${leaves_bounds_at_s.toFixed(2)} s: the motion diverges, or the step is too long.`;
      return this.#report("Unbounded", text, "chaos");
    }
    // One digit of the error at least, and no more than six decimals.
    const digits = Math.min(6, Math.max(3, -Math.floor(Math.log10(standard_error_per_s ?? 1))));
    const number = (value, decimals = digits) => value.toFixed(decimals).replace("-", "\u2212");
    const span = `Over ${observed_s} s after a transient of ${transient_s} s`;
    const word = regime[0].toUpperCase() + regime.slice(1);
    const kind = is_chaotic ? "chaos" : regime === "undecided" ? "unknown" : "regular";
    if (exponent_per_s === null) {
      const why = has_exponent ? "is not finite" : "is not measured under feedback";
      return this.#report(word, `The largest Lyapunov exponent ${why}.`, kind, `${span}.`);
    }
    const exponent = `Largest Lyapunov exponent ${number(exponent_per_s)} \u00b1 ${number(standard_error_per_s)} 1/s`;
    this.#report(word, exponent, kind, `${span}; positive from ${number(threshold_per_s, 3)} 1/s on.`);
  }

  /** Shows the regime; a screen reader reads it. */
  #report(word, exponent, kind, span = "") {
    this.#regime.dataset.kind = kind;
    this.#regime.querySelector("strong").textContent = word;
    this.#regime.querySelector(".exponent").textContent = exponent;
    this.#regime.querySelector(".span").textContent = span;
  }

  #addPresets() {
    const list = document.getElementById("presets");
    for (const { name, where, text, settings } of PRESETS) {
      const button = element("button", { type: "button", "data-settings": settings, title: text }, element("b", {}, name), element("small", {}, where));
      button.addEventListener("click", () => this.#apply(parse(settings)));
      list.append(element("li", {}, button));
    }
  }

  async #copy() {
    const link = document.getElementById("link");
    link.select();
    const words = document.getElementById("copied");
    try {
      await navigator.clipboard.writeText(link.value);
      words.textContent = "Copied.";
    } catch {
      words.textContent = "Selected: copy it with the keyboard.";
    }
  }
}

/** The model for the browser's console: `dithersteer.configure("run.wheel_speed_rpm=1600"); dithersteer.run()`. */
let dithersteer = null;

async function start() {
  const text = document.getElementById("module").textContent.trim();
  const packed = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  const module = await WebAssembly.compile(await new Response(unpacked).arrayBuffer());
  new Page(await Model.from(module), module);
  dithersteer = await Model.from(module);
}

start().catch((error) => {
  const place = document.getElementById("error");
  place.textContent = `This browser cannot run the page: ${error.message}`;
  place.hidden = false;
});
