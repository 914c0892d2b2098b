// Drives the page in Chromium for tests/page.rs: node page.mjs DRIVER CHROMIUM PAGE FOLDER SETTINGS
//
// Asserts what a user sees, and writes the states and duty codes of the page's model under SETTINGS, and its measures
// without settings, into FOLDER, beside the documentation's picture page.png.

import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [driver, executablePath, file, folder, settings] = process.argv.slice(2);
const { chromium } = createRequire(driver)("playwright-core");
const address = pathToFileURL(file).href;
const MEASURED = "#regime[aria-busy=false]";

const browser = await chromium.launch({ executablePath });
const faults = [];

/** A new window on the page, whose errors and requests are noted. Without motion, which takes time. */
async function open(fragment = "", options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, offline: true, reducedMotion: "reduce", ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(30000);
  page.on("console", (message) => message.type() === "error" && faults.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => faults.push(`error: ${error.message}`));
  page.on("request", (request) => /^(file|blob|data):/.test(request.url()) || faults.push(`request: ${request.url()}`));
  await page.goto(address + fragment);
  await page.waitForSelector(MEASURED);
  return page;
}

const regime = (page) => page.textContent("#regime strong");
const exponent = async (page) => Number((await page.textContent("#regime .exponent")).replace("\u2212", "-").match(/exponent (-?[\d.]+)/)[1]);
const value = (page, key) => page.inputValue(`[id="${key}"]`);
const slider = (key) => `[id="slider-${key}"]`;

/** The regime after a change, which the address shows when the measurement begins. */
async function changed(page, change) {
  const before = page.url();
  await change();
  await page.waitForFunction((before) => location.href !== before, before);
  await page.waitForSelector(MEASURED);
  return regime(page);
}

const steps = {
  async "chaos without dither, period one with the paper's"() {
    const page = await open();
    assert.equal(await regime(page), "Chaos");
    assert.ok((await exponent(page)) > 0.2);
    assert.equal(await page.isVisible("#error"), false);
    const sine = () => page.check('[id="dither.waveform-sine"]', { force: true });
    assert.equal(await changed(page, sine), "Chaos");
    assert.equal(await changed(page, () => page.fill(slider("dither.amplitude_v"), "1")), "Period-1");
    assert.ok(Math.abs(await exponent(page)) < 0.02);
    assert.equal(await value(page, "dither.amplitude_v"), "1");
    assert.match(page.url(), /#dither\.waveform=sine&dither\.amplitude_v=1$/);
    const square = await changed(page, () => page.click("text=To rest"));
    assert.equal(square, "Equilibrium");
  },

  async "a slider redraws the plots"() {
    const page = await open();
    const picture = () => page.evaluate(() => document.getElementById("response").toDataURL());
    const before = await picture();
    await changed(page, () => page.fill(slider("run.wheel_speed_rpm"), "1600"));
    assert.notEqual(await picture(), before);
    assert.equal(await value(page, "run.wheel_speed_rpm"), "1600");
  },

  async "the settled motion is drawn in its colour"() {
    const page = await open("#dither.waveform=sine&dither.amplitude_v=1");
    const pixels = await page.evaluate(() => {
      const canvas = document.getElementById("portrait");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      // The style's colour --main.
      const isMain = (k) => data[k] === 0x12 && data[k + 1] === 0x3f && data[k + 2] === 0x8c;
      return Array.from({ length: data.length / 4 }, (_, k) => isMain(4 * k)).filter(Boolean).length;
    });
    assert.ok(pixels > 200, `${pixels} pixels`);
  },

  async "delayed feedback holds an orbit"() {
    const page = await open();
    assert.equal(await changed(page, () => page.click("text=Feedback")), "Period-2");
    assert.match(await page.textContent("#regime .exponent"), /not measured under feedback/);
    assert.ok(await page.isDisabled('[id="dither.waveform-sine"]'));
    const off = () => page.check('[id="controller.suppression-dither"]', { force: true });
    assert.equal(await changed(page, off), "Chaos");
  },

  async "the keyboard suffices"() {
    const page = await open();
    await page.keyboard.press("Tab");
    assert.equal(await page.evaluate(() => document.activeElement.id), "skip");
    await page.keyboard.press("Enter");
    for (let k = 0; k < 9; k += 1) await page.keyboard.press("Tab");
    assert.equal(await page.evaluate(() => document.activeElement.id), "slider-run.wheel_speed_rpm");
    await page.keyboard.press("ArrowLeft");
    await page.waitForFunction(() => location.hash === "#run.wheel_speed_rpm=1749");
    assert.equal(await value(page, "run.wheel_speed_rpm"), "1749");
    await page.focus('#presets button:has-text("Period two")');
    assert.equal(await changed(page, () => page.keyboard.press("Enter")), "Period-2");
    // Every control has a name.
    const nameless = await page.evaluate(() => {
      const named = (control) => control.ariaLabel || control.textContent.trim() || control.labels?.length;
      return Array.from(document.querySelectorAll("button, input, canvas[role]")).filter((control) => !named(control)).length;
    });
    assert.equal(nameless, 0);
  },

  async "a link restores all settings, also those without a control"() {
    const link = "#preset=printed&run.wheel_speed_rpm=1625.5&friction.coefficient=0.3&vehicle.mass_kg=1600&run.yaw_rate_rad_per_s=-0.25";
    const page = await open(link);
    assert.equal(await value(page, "run.wheel_speed_rpm"), "1625.5");
    assert.equal(await value(page, "friction.coefficient"), "0.3");
    assert.equal(await value(page, "run.yaw_rate_rad_per_s"), "-0.25");
    assert.ok(await page.isChecked('[id="friction.law-printed_angle"]'));
    assert.ok((await page.inputValue("#link")).endsWith(link));
    await page.fill(slider("friction.coefficient"), "0.2");
    await page.waitForFunction(() => location.hash.includes("friction.coefficient=0.2&vehicle.mass_kg=1600"));
  },

  async "a wrong link is reported and breaks nothing"() {
    const wrong = [
      ["run.wheel_speed_rpm=0", "run.wheel_speed_rpm = 0: must be a finite number from 1 to 100000"],
      ["run.wheel_speed_rpm=NaN", "run.wheel_speed_rpm = NaN: must be a finite number from 1 to 100000"],
      ["run.duration_s=1e6", "run.duration_s = 1000000"],
      ["dither.waveform=saw", "dither.waveform=saw: the value is none of the parameter's names"],
      ["speed", "speed: must be key=value"],
      ["%E0%A4%A", "The link is damaged"],
      ["a".repeat(10000), "10000 bytes"],
      ["<img src=x onerror=alert(1)>", "no parameter of that name"],
    ];
    const page = await open(`#${wrong[0][0]}`);
    assert.ok((await page.textContent("#error")).includes(wrong[0][1]));
    assert.equal(await regime(page), "Chaos");
    for (const [link, message] of wrong.slice(1)) {
      await page.evaluate((link) => (location.hash = link), link);
      await page.waitForFunction((message) => document.getElementById("error").textContent.includes(message), message);
      assert.equal(await value(page, "run.wheel_speed_rpm"), "1750");
    }
    await page.fill('[id="dither.start_time_s"]', "-1");
    await page.waitForSelector('[id="dither.start_time_s"][aria-invalid=true]');
    assert.match(await page.textContent("#error"), /^dither\.start_time_s = -1: must be a finite number from 0 to 100000$/);
    await page.fill('[id="dither.start_time_s"]', "4");
    await page.waitForSelector("#error", { state: "hidden" });
    await page.evaluate(() => (location.hash = "#run.wheel_speed_rpm=1600"));
    await page.waitForFunction(() => document.getElementById("run.wheel_speed_rpm").value === "1600");
  },

  async "odd motions break nothing"() {
    const page = await open("#tires.front.peak_n=-2574.7&tires.rear.peak_n=-1749.7");
    assert.equal(await regime(page), "Unbounded");
    for (const [link, expected] of [
      // Measured for some seconds: abandoned.
      ["tires.model=magic_formula&dither.waveform=sine&dither.amplitude_v=1", null],
      ["run.duration_s=0.001&dither.waveform=square&dither.amplitude_v=0.1", "Period-1"],
      ["dither.start_time_s=100&dither.waveform=sine&dither.amplitude_v=1", "Period-1"],
      ["dither.start_time_s=5000", "Not measured"],
    ]) {
      await page.evaluate((link) => (location.hash = link), link);
      await page.waitForSelector("#regime[aria-busy=true]");
      if (expected) {
        await page.waitForSelector(MEASURED);
        assert.equal(await regime(page), expected);
      } else {
        await page.waitForTimeout(400);
      }
      assert.equal(await page.isVisible("#error"), false);
    }
  },

  async "the marker runs, but not with reduced motion"() {
    const time = (page) => page.inputValue("#time");
    const moves = async (page) => {
      await page.waitForFunction((before) => document.getElementById("time").value !== before, await time(page));
    };
    const rests = async (page) => {
      const before = await time(page);
      await page.waitForTimeout(400);
      return (await time(page)) === before;
    };
    const page = await open("", { reducedMotion: "no-preference" });
    await moves(page);
    await page.click("#play");
    assert.ok(await rests(page));
    const still = await open();
    assert.ok(await rests(still));
    assert.equal(await still.isVisible("#play"), false);
    await still.fill("#time", "7");
    assert.equal(await still.textContent("#now"), "7.0 s");
  },

  async "every width and both colour schemes"() {
    const papers = new Set();
    for (const colorScheme of ["light", "dark"]) {
      const page = await open("", { colorScheme, hasTouch: true });
      for (const width of [320, 400, 800, 1400]) {
        await page.setViewportSize({ width, height: 900 });
        assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${width}: wider than the window`);
      }
      papers.add(await page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor));
    }
    assert.equal(papers.size, 2);
  },

  async "the picture of the documentation"() {
    const page = await open("#dither.waveform=sine&dither.amplitude_v=1");
    await page.fill("#time", "14");
    await page.evaluate(() => document.activeElement.blur());
    await page.screenshot({ path: join(folder, "page.png") });
  },

  async "the model's bits"() {
    const page = await open();
    const words = await page.evaluate((settings) => {
      dithersteer.configure(settings);
      const { states, duties } = dithersteer.run();
      return { states: Array.from(new Uint32Array(states.buffer)), duties: Array.from(duties) };
    }, settings);
    writeFileSync(join(folder, "states.bin"), Uint32Array.from(words.states));
    writeFileSync(join(folder, "duties.bin"), Uint16Array.from(words.duties));
    const measured = await page.evaluate(() => {
      dithersteer.configure("");
      const { states, ...measures } = dithersteer.measure();
      return measures;
    });
    writeFileSync(join(folder, "exponent.txt"), String(measured.exponent_per_s));
  },
};

try {
  for (const [name, step] of Object.entries(steps)) {
    const started = Date.now();
    await step();
    for (const context of browser.contexts()) await context.close();
    console.log(`${name}: ${Date.now() - started} ms`);
  }
  assert.deepEqual(faults, []);
} finally {
  await browser.close();
}
