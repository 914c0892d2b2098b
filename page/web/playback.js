/** Moves a marker along the run in real time. Where the system asks for reduced motion there is only the slider. */
class Playback {
  #slider = document.getElementById("time");
  #button = document.getElementById("play");
  #readout = document.getElementById("now");
  #still = matchMedia("(prefers-reduced-motion: reduce)");
  #playing = false;
  #last = null;
  #time = 0;

  constructor(mark) {
    this.mark = mark;
    this.#slider.addEventListener("input", () => {
      this.#play(false);
      this.#move(Number(this.#slider.value));
    });
    this.#button.addEventListener("click", () => this.#play(!this.#playing));
    this.#still.addEventListener("change", () => this.#follow());
    this.#follow();
  }

  /** The run's length, s. */
  setEnd(end) {
    this.#slider.max = end;
    this.#move(Math.min(this.#time, end));
  }

  #follow() {
    this.#button.hidden = this.#still.matches;
    this.#play(!this.#still.matches);
  }

  #play(on) {
    this.#playing = on;
    this.#button.textContent = on ? "Pause" : "Play";
    this.#last = null;
    if (on) requestAnimationFrame((now) => this.#frame(now));
  }

  #frame(now) {
    if (!this.#playing) return;
    if (this.#last !== null) {
      const end = Number(this.#slider.max);
      this.#move((this.#time + (now - this.#last) / 1e3) % end);
    }
    this.#last = now;
    requestAnimationFrame((next) => this.#frame(next));
  }

  #move(time) {
    this.#time = time;
    this.#slider.value = time;
    this.#readout.textContent = `${time.toFixed(1)} s`;
    this.#slider.setAttribute("aria-valuetext", `${time.toFixed(1)} s`);
    this.mark(time);
  }
}
