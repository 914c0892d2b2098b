"use strict";

/** Numbers of the module's outputs. */
const MESSAGE = 0, STATES = 1, DUTIES = 2;

/** The module of the package `page`, with its calls as methods that throw their error messages. */
class Model {
  static async from(module) {
    return new Model((await WebAssembly.instantiate(module, {})).exports);
  }

  constructor(exports) {
    this.exports = exports;
  }

  /** Makes the scenario of settings joined by `&`; returns all its parameters. */
  configure(settings) {
    return this.#call("configure", settings);
  }

  /** Least and greatest allowed value of a number. */
  range(key) {
    return this.#call("range", key);
  }

  /** Runs the scenario, with its dither or feedback or without. */
  run(suppressed = true) {
    const facts = this.#call("run", "", suppressed);
    return { ...facts, states: this.#words(STATES, Float32Array), duties: this.#words(DUTIES, Uint16Array) };
  }

  /** Measures of the settled motion, and the states of its end. */
  measure() {
    return { ...this.#call("measure", ""), states: this.#words(STATES, Float32Array) };
  }

  #call(name, input, ...more) {
    const bytes = new TextEncoder().encode(input);
    const place = this.exports.input(bytes.length);
    if (place === 0) throw new Error(`the settings have ${bytes.length} bytes: too many`);
    new Uint8Array(this.exports.memory.buffer, place, bytes.length).set(bytes);
    const done = this.exports[name](...more);
    const text = new TextDecoder().decode(this.#words(MESSAGE, Uint8Array));
    if (!done) throw new Error(text);
    return JSON.parse(text);
  }

  /** A copy of an output: the next call may move the memory. */
  #words(output, Words) {
    const place = this.exports.output(output);
    return new Words(this.exports.memory.buffer.slice(place, place + this.exports.output_length(output)));
  }
}
