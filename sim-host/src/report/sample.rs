//! Made-up runs of realistic shape, for tests.

use super::input::{Pair, ReportInput, RunReport};
use dynamics::trace::Trace;
use nalgebra::Vector4;
use pil::instructions::Instructions;
use plot::verdict::{Check, Verdict};
use shared_model::friction::FrictionMode;
use shared_model::vehicle::State;
use std::f64::consts::TAU;

const STEP_S: f64 = 1e-3;
const STEPS: usize = 60_000;
const SAMPLES_PER_STEP: usize = 10;
const PERIOD: u16 = 2500;
const START_S: f64 = 3.0;

/// Five checks that passed, one that failed, one that was not made.
pub fn verdict() -> Verdict {
    Verdict::over(vec![
        Check::equals("bits/1750-none", "State words that differ", 0.0, 0.0)
            .detail("240000 words and 600000 duty codes compared"),
        Check::at_most(
            "one-step/1750-none",
            "Greatest one-step defect over its bound",
            0.37,
            1.0,
        )
        .detail("at 12.3 s, yaw rate; drift < bound"),
        Check::within("horizon/1750-none", "f32 and f64 part", 38.2, (30.0, 46.0)).unit("s"),
        Check::equals("bits/1750-square", "State words that differ", 0.0, 0.0),
        Check::at_most(
            "horizon/1750-square",
            "Distance of free f32 and f64 runs",
            3.2e-6,
            1e-3,
        ),
        Check::at_most(
            "one-step/1750-square",
            "Greatest one-step defect over its bound, with a title that takes more than one line",
            1.7,
            1.0,
        ),
        Check::untested(
            "cycles",
            "Instructions of a PWM task",
            "the emulator does not count instructions: start it with -icount, and read its log \
             about instruction counting before the next start",
        ),
    ])
}

/// Runs without dither, with square dither, with sine dither.
pub fn runs() -> Vec<RunReport> {
    vec![
        run("1750-none", "1750 rpm, no dither", |_| 0.0, false),
        run(
            "1750-square",
            "1750 rpm, square dither 0.1 V",
            |t| 10.0 * (TAU * 318.3 * t).sin().signum(),
            true,
        ),
        run(
            "1750-sine",
            "1750 rpm, sine dither 1.0 V",
            |t| 104.0 * (TAU * 636.6 * t).sin(),
            true,
        ),
    ]
}

/// Both dithers against none.
pub fn pairs() -> Vec<Pair> {
    [("square dither 0.1 V", 1), ("sine dither 1.0 V", 2)]
        .map(|(dither, after)| Pair {
            title: format!("1750 rpm: no dither against {dither}"),
            before: 0,
            after,
        })
        .into()
}

/// The input of a report.
pub fn input<'a>(
    verdict: &'a Verdict,
    runs: &'a [RunReport],
    pairs: &'a [Pair],
) -> ReportInput<'a> {
    static NOTES: std::sync::LazyLock<Vec<(String, String)>> = std::sync::LazyLock::new(|| {
        [("Flash", "48.3 KiB of 256 KiB"), ("Revision", "0123abc")]
            .map(|(name, value)| (name.into(), value.into()))
            .into()
    });
    ReportInput {
        title: "Verification of the steering ECU",
        verdict,
        runs,
        pairs,
        drives: &[],
        proofs: &[],
        notes: &NOTES,
    }
}

/// A run of no duration.
pub fn empty_run() -> RunReport {
    let mut run = runs().remove(1);
    run.trace.states.clear();
    run.trace.duties.clear();
    run.one_step_defect.clear();
    run.divergence.clear();
    run.instructions = Instructions::default();
    run
}

fn run(id: &str, title: &str, dither_counts: impl Fn(f64) -> f64, dithered: bool) -> RunReport {
    let time_s = |k: usize| (k + 1) as f64 * STEP_S;
    let states = (0..STEPS).map(|k| motion(time_s(k), dithered)).collect();
    let duties = (0..STEPS * SAMPLES_PER_STEP)
        .map(|n| {
            let t = n as f64 * STEP_S / SAMPLES_PER_STEP as f64 - START_S;
            let counts = if dithered && t >= 0.0 {
                dither_counts(t)
            } else {
                0.0
            };
            (1562.0 + counts).round() as u16
        })
        .collect();
    let noise = |k: usize| (k as f64 * 12.9898).sin().abs();
    let distance = |t: f64| {
        if dithered {
            2e-7 + 1e-6 * (TAU * t).sin().powi(2)
        } else {
            let grown = 1e-7 * (t * 1e7_f64.ln() / 40.0).exp();
            grown.min(1.0) * (0.4 + 0.6 * (TAU * 1.07 * t).sin().abs())
        }
    };
    RunReport {
        id: id.into(),
        title: title.into(),
        trace: Trace {
            step_s: STEP_S,
            initial: motion(0.0, dithered),
            states,
            duties,
            samples_per_step: SAMPLES_PER_STEP,
            pwm_period: PERIOD,
        },
        dither_start_s: dithered.then_some(START_S),
        volts_per_count: 24.0 / f64::from(PERIOD),
        one_step_defect: (0..STEPS)
            .map(|k| {
                (
                    time_s(k),
                    (0.02 + 0.4 * (time_s(k) / 9.0).sin().powi(2)) * noise(k).powi(3),
                )
            })
            .collect(),
        divergence: (0..STEPS)
            .map(|k| (time_s(k), distance(time_s(k))))
            .collect(),
        horizon_s: (!dithered).then_some([30.0, 38.0, 46.0]),
        divergence_limit: if dithered { 1e-3 } else { 0.1 },
        instructions: Instructions {
            control: (0..40)
                .map(|n| (4120 + 3 * n, 1 + 20_000 / (1 + u64::from(n).pow(3))))
                .collect(),
            pwm: vec![(212, 3), (214, 59_000), (231, 990), (260, 7)],
            periods_a_tick: 10,
            tick: 31_250.0,
        },
    }
}

/// A chaotic-looking oscillation; a periodic one once the dither acts.
fn motion(t: f64, dithered: bool) -> State<f64> {
    let settled = if dithered {
        1.0 - (-(t - START_S).max(0.0)).exp()
    } else {
        0.0
    };
    let wander = (1.0 - settled) * (0.9 * (2.61 * t).sin() + 0.5 * (4.13 * t + 1.0).cos());
    let phase = TAU * t + wander;
    let size = 1.0 + 0.35 * (1.0 - settled) * (1.77 * t + 0.5 * (0.83 * t).sin()).sin();
    State {
        x: Vector4::new(
            0.2 * size * (phase.sin() + 0.2 * (3.0 * phase).sin()),
            size * (phase + 0.9).cos() + 0.15 * (2.0 * phase).sin(),
            0.1 * phase.cos(),
            0.6 * phase.sin(),
        ),
        friction: FrictionMode::Positive,
    }
}
