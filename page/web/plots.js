/** Components of a state. */
const SIDESLIP = 0, YAW_RATE = 1, COMPONENTS = 4;
/** The PWM's time that is shown, ms from the start of the dither. */
const DUTY_FROM_MS = -3, DUTY_TO_MS = 12;
/** Time for which the marker leaves a trail, s. */
const TRAIL_S = 0.5;

const BETA = "sideslip angle \u03b2 (rad)", GAMMA = "yaw rate \u03b3 (rad/s)";

/** A canvas for a plot with one over it for the marker; redrawn when its size changes. */
class Sheet {
  constructor(id, draw) {
    this.base = document.getElementById(id);
    this.marker = element("canvas", { "aria-hidden": "true" });
    this.base.after(this.marker);
    new ResizeObserver(() => draw()).observe(this.base.parentElement);
  }

  /** An empty canvas of the element's size; null while it has none. */
  context(canvas) {
    const { clientWidth: width, clientHeight: height } = this.base.parentElement;
    if (width === 0 || height === 0) return null;
    const scale = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    const context = canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    return { context, width, height };
  }

  describe(text) {
    this.base.setAttribute("aria-label", text);
  }
}

/** Number of states of a run. */
const count = (run) => run.states.length / COMPONENTS;

/** Time response, phase portrait and duty of a motion. */
class Plots {
  #response = new Sheet("response", () => this.#drawResponse());
  #portrait = new Sheet("portrait", () => this.#drawPortrait());
  #duty = new Sheet("duty", () => this.#drawDuty());
  #rows = [];
  #plane = null;
  #time = 0;

  /** `shown` has the scenario, its run, the same without dither if it has one, and the settled motion once it is known. */
  show(shown) {
    this.shown = shown;
    this.draw();
  }

  draw() {
    this.#drawResponse();
    this.#drawPortrait();
    this.#drawDuty();
  }

  /** Moves the marker to a time, s. */
  mark(time) {
    this.#time = time;
    this.#markResponse();
    this.#markPortrait();
  }

  /** Line of the motion itself: the one with dither is drawn in another colour than the one without. */
  #main(width) {
    const colour = colours();
    return this.shown.without ? { colour: colour("main"), width } : { colour: colour("alone"), width };
  }

  #other(width) {
    return { colour: colours()("other"), width, dashes: [1.5, 2.5] };
  }

  #drawResponse() {
    const sheet = this.#response.context(this.#response.base);
    if (!sheet || !this.shown) return;
    const { context, width, height } = sheet;
    const { run, without, scenario, means } = this.shown;
    const font = width < 480 ? 12 : 13;
    const [left, right, gap, foot] = [54, width - 12, 30, 3.6 * font];
    const panel = (height - 24 - gap - foot) / 2;
    const end = count(run) * run.step_s;
    const every = Math.max(1, Math.floor(count(run) / (3 * width)));
    this.#rows = [SIDESLIP, YAW_RATE].map((component, row) => {
      const values = [run, without].filter(Boolean).map((one) => range(one.states, component, every));
      const top = 24 + row * (panel + gap);
      const axes = new Axes(context, [left, top, right, top + panel], [0, end], rangeAround(values.flat(), 1e-3));
      axes.draw({ x: "time (s)", y: row ? GAMMA : BETA, font, showX: row === 1 });
      const line = (one, style) =>
        axes.line(Math.floor(count(one) / every), (k) => [(k * every + 1) * one.step_s, one.states[k * every * COMPONENTS + component]], style);
      if (without) line(without, this.#other(1.5));
      line(run, this.#main(without ? 1.8 : 1.4));
      if (without) axes.instant(scenario.dither.start_time_s, row ? "" : `${means} on`, font);
      return { axes, component, values };
    });
    const extent = ([low, high]) => `${low.toFixed(2)} to ${high.toFixed(2)}`;
    const [beta, gamma] = this.#rows.map(({ values }) => extent(values[0]));
    this.#response.describe(`Time response over ${end.toFixed(0)} s: sideslip angle from ${beta} rad, yaw rate from ${gamma} rad/s`);
    this.#markResponse();
  }

  #markResponse() {
    const sheet = this.#response.context(this.#response.marker);
    if (!sheet || !this.shown) return;
    const { run } = this.shown;
    const k = this.#index(run);
    const colour = colours();
    for (const { axes, component } of this.#rows) {
      const { context } = sheet;
      const on = new Axes(context, axes.box, axes.x, axes.y);
      const at = on.horizontal((k + 1) * run.step_s);
      context.strokeStyle = colour("faint");
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(at, axes.box[1]);
      context.lineTo(at, axes.box[3]);
      context.stroke();
      on.dot((k + 1) * run.step_s, run.states[k * COMPONENTS + component], colour("mark"), 4);
    }
  }

  #drawPortrait() {
    const sheet = this.#portrait.context(this.#portrait.base);
    if (!sheet || !this.shown) return;
    const { context, width, height } = sheet;
    const { run, without, settled } = this.shown;
    const font = width < 480 ? 12 : 13;
    const half = { states: run.states.subarray(Math.floor(count(run) / 2) * COMPONENTS), step_s: run.step_s };
    const main = settled ?? half;
    const all = [run, without, main].filter(Boolean);
    const spans = [SIDESLIP, YAW_RATE].map((component) => rangeAround(all.flatMap((one) => range(one.states, component, 1)), 1e-3));
    const axes = new Axes(context, [54, 24, width - 12, height - 3.6 * font], ...spans);
    axes.draw({ x: BETA, y: GAMMA, font });
    const line = (one, style) => {
      const every = Math.max(1, Math.round(0.004 / one.step_s));
      axes.line(Math.floor(count(one) / every), (k) => [one.states[k * every * COMPONENTS + SIDESLIP], one.states[k * every * COMPONENTS + YAW_RATE]], style);
    };
    line(without ?? run, { ...this.#other(1), dashes: [] });
    // A chaotic attractor of many turns would become a blot.
    line(main, this.#main(settled?.is_chaotic ? 0.8 : 2));
    const last = main.states.subarray(main.states.length - COMPONENTS);
    const [beta, gamma] = [SIDESLIP, YAW_RATE].map((component) => range(main.states, component, 1));
    const isPoint = [beta, gamma].every(([low, high], k) => high - low < 0.01 * (spans[k][1] - spans[k][0]));
    if (isPoint) axes.dot(last[SIDESLIP], last[YAW_RATE], this.#main(1).colour, 5);
    this.#portrait.describe(
      `Phase portrait of the settled motion: sideslip angle from ${beta[0].toFixed(2)} to ${beta[1].toFixed(2)} rad, ` +
        `yaw rate from ${gamma[0].toFixed(2)} to ${gamma[1].toFixed(2)} rad/s`,
    );
    this.#plane = axes;
    this.#markPortrait();
  }

  #markPortrait() {
    const sheet = this.#portrait.context(this.#portrait.marker);
    if (!sheet || !this.shown || !this.#plane) return;
    const { run } = this.shown;
    const k = this.#index(run);
    const colour = colours()("mark");
    const on = new Axes(sheet.context, this.#plane.box, this.#plane.x, this.#plane.y);
    const at = (n) => [run.states[n * COMPONENTS + SIDESLIP], run.states[n * COMPONENTS + YAW_RATE]];
    const pieces = 12;
    const steps = Math.floor(TRAIL_S / run.step_s / pieces);
    for (let piece = 0; piece < pieces; piece += 1) {
      const [first, last] = [k - (pieces - piece) * steps, k - (pieces - piece - 1) * steps];
      if (first < 0) continue;
      const every = Math.max(1, Math.floor((last - first) / 12));
      sheet.context.globalAlpha = 0.7 * ((piece + 1) / pieces) ** 1.5;
      on.line(Math.floor((last - first) / every) + 1, (n) => at(first + n * every), { colour, width: 2.5 });
    }
    sheet.context.globalAlpha = 1;
    on.dot(...at(k), colour, 5);
  }

  /** Index of the state at the marker's time. */
  #index(run) {
    return Math.min(count(run) - 1, Math.max(0, Math.round(this.#time / run.step_s) - 1));
  }

  #drawDuty() {
    const sheet = this.#duty.context(this.#duty.base);
    if (!sheet || !this.shown) return;
    const { context, width, height } = sheet;
    const { run, without, scenario, means } = this.shown;
    const font = width < 480 ? 12 : 13;
    const period_ms = (1e3 * run.step_s) / run.samples_per_step;
    const start_ms = 1e3 * scenario.dither.start_time_s;
    const first = Math.max(0, Math.floor((start_ms + DUTY_FROM_MS) / period_ms));
    const codes = run.duties.subarray(first, Math.max(first, Math.ceil((start_ms + DUTY_TO_MS) / period_ms)));
    const percent = (code) => (100 * code) / run.pwm_period;
    const values = Array.from(codes, percent);
    const axes = new Axes(context, [54, 24, width - 12, height - 3.6 * font], [DUTY_FROM_MS, DUTY_TO_MS], rangeAround(values, 2));
    axes.draw({ x: without ? `time from the start of the ${means} (ms)` : `time from ${scenario.dither.start_time_s} s on (ms)`, y: "duty (%)", font });
    const at = (k) => [(first + Math.ceil(k / 2)) * period_ms - start_ms, values[Math.floor(k / 2)]];
    axes.line(2 * values.length, at, this.#main(1.6));
    if (without) axes.instant(0, "", font);
    const [low, high] = rangeAround(values, 0);
    this.#duty.describe(
      values.length ? `Duty of the PWM around the start of the ${means}, from ${Math.max(low, 0).toFixed(1)} to ${high.toFixed(1)} %` : "The run ends before that time",
    );
    document.getElementById("resolution").textContent = `${(1 / period_ms).toFixed(0)} kHz, 1 count = ${(1e3 * run.volts_per_count).toFixed(1)} mV`;
  }
}

/** Least and greatest value of a component up to where the motion leaves all bounds; one state in `every`. */
function range(states, component, every) {
  let low = Infinity, high = -Infinity;
  for (let k = component; k < states.length; k += COMPONENTS * every) {
    const value = states[k];
    if (!Number.isFinite(value) || Math.abs(value) > 1e3) break;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : [0, 0];
}
