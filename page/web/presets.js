"use strict";

/** The motions of the paper's figures, and the ECU's other suppression; each is a link's settings. */
const PRESETS = [
  {
    name: "Chaos",
    where: "Fig 7, region II",
    text: "1750 rpm without dither.",
    settings: "",
  },
  {
    name: "Square dither",
    where: "Figs 9 to 12",
    text: "A square wave of 0.1 V from 3 s on.",
    settings: "dither.waveform=square&dither.amplitude_v=0.1",
  },
  {
    name: "Sine dither",
    where: "Figs 14 to 17",
    text: "A sine of 1 V from 3 s on.",
    settings: "dither.waveform=sine&dither.amplitude_v=1",
  },
  {
    name: "To rest",
    where: "Fig 8, upper end",
    text: "A square wave of 0.14 V: no motion is left.",
    settings: "dither.waveform=square&dither.amplitude_v=0.14",
  },
  {
    name: "Period two",
    where: "Fig 7, region I",
    text: "1600 rpm without dither.",
    settings: "run.wheel_speed_rpm=1600",
  },
  {
    name: "Period three",
    where: "Fig 7, region III",
    text: "1850 rpm without dither.",
    settings: "run.wheel_speed_rpm=1850",
  },
  {
    name: "Feedback",
    where: "not in the paper",
    text: "Delayed feedback of the yaw rate by the motor, from 3 s on.",
    settings: "controller.suppression=delayed_feedback&run.duration_s=40",
  },
  {
    name: "As printed",
    where: "eqs (13), (14)",
    text: "Friction by the sign of the steering angle.",
    settings: "preset=printed",
  },
];
