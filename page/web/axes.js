/** Round numbers in a range, about `count` of them. */
function ticks(from, to, count) {
  const raw = (to - from) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
  const first = Math.ceil(from / step - 1e-9);
  const last = Math.floor(to / step + 1e-9);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return Array.from({ length: last - first + 1 }, (_, k) => {
    const value = (first + k) * step;
    return { value, label: value.toFixed(digits).replace("-", "\u2212") };
  });
}

/** A range with room around values; a range of at least `least`. */
function rangeAround(values, least) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!(low <= high)) return [-1, 1];
  const room = Math.max(0.06 * (high - low), 0.5 * (least - (high - low)));
  return [low - room, high + room];
}

/** Colours of the style sheet by name. */
function colours() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

/** A rectangle of a canvas with two axes. */
class Axes {
  /** `box` is left, top, right, bottom in CSS pixels; `x` and `y` are the ranges. */
  constructor(context, box, x, y) {
    Object.assign(this, { context, box, x, y });
  }

  horizontal(value) {
    const [left, , right] = this.box;
    return left + ((value - this.x[0]) / (this.x[1] - this.x[0])) * (right - left);
  }

  vertical(value) {
    const [, top, , bottom] = this.box;
    return bottom - ((value - this.y[0]) / (this.y[1] - this.y[0])) * (bottom - top);
  }

  /** Grid, frame, ticks and names. */
  draw({ x, y, font, showX = true }) {
    const { context, box: [left, top, right, bottom] } = this;
    const colour = colours();
    context.font = `${font}px ${colour("sans")}`;
    context.lineWidth = 1;
    context.strokeStyle = colour("grid");
    context.fillStyle = colour("ink");
    const across = ticks(...this.x, Math.max(2, (right - left) / 75));
    const up = ticks(...this.y, Math.max(2, (bottom - top) / 26));
    context.beginPath();
    for (const { value } of across) {
      const at = Math.round(this.horizontal(value)) + 0.5;
      context.moveTo(at, top);
      context.lineTo(at, bottom);
    }
    for (const { value } of up) {
      const at = Math.round(this.vertical(value)) + 0.5;
      context.moveTo(left, at);
      context.lineTo(right, at);
    }
    context.stroke();
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const { value, label } of up) context.fillText(label, left - 7, this.vertical(value));
    context.textAlign = "center";
    context.textBaseline = "top";
    if (showX) for (const { value, label } of across) context.fillText(label, this.horizontal(value), bottom + 7);
    context.fillStyle = colour("faint");
    if (showX) context.fillText(x, (left + right) / 2, bottom + 7 + 1.5 * font);
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.fillText(y, left, top - 6);
    context.strokeStyle = colour("axis");
    context.strokeRect(left + 0.5, top + 0.5, right - left - 1, bottom - top - 1);
  }

  /** Draws within the frame. */
  clipped(work) {
    const { context, box: [left, top, right, bottom] } = this;
    context.save();
    context.beginPath();
    context.rect(left, top, right - left, bottom - top);
    context.clip();
    work(context);
    context.restore();
  }

  /** A line through points; `at(k)` returns the pair with index k. */
  line(count, at, { colour, width, dashes = [] }) {
    this.clipped((context) => {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.lineJoin = "round";
      context.setLineDash(dashes);
      context.beginPath();
      for (let k = 0; k < count; k += 1) {
        const [x, y] = at(k);
        if (!Number.isFinite(y)) break;
        context.lineTo(this.horizontal(x), this.vertical(y));
      }
      context.stroke();
    });
  }

  /** A vertical line at an instant with a label. */
  instant(value, label, font) {
    if (value < this.x[0] || value > this.x[1]) return;
    const { context, box: [left, top, right, bottom] } = this;
    const colour = colours();
    const at = this.horizontal(value);
    context.save();
    context.strokeStyle = colour("instant");
    context.setLineDash([7, 3, 2, 3]);
    context.lineWidth = 1.25;
    context.beginPath();
    context.moveTo(at, top);
    context.lineTo(at, bottom);
    context.stroke();
    if (label) {
      const isLeft = at > right - 90 && at > left + 90;
      context.font = `${font}px ${colour("sans")}`;
      context.textBaseline = "bottom";
      context.textAlign = isLeft ? "right" : "left";
      context.fillStyle = colour("instant");
      context.fillText(label, at + (isLeft ? -5 : 5), bottom - 5);
    }
    context.restore();
  }

  dot(x, y, colour, radius) {
    if (!Number.isFinite(x) || !Number.isFinite(y)) return;
    const { context } = this;
    context.beginPath();
    context.arc(this.horizontal(x), this.vertical(y), radius, 0, 2 * Math.PI);
    context.fillStyle = colour;
    context.fill();
  }
}
