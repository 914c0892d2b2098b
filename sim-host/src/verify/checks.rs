//! The checks of a verification: the four levels of equivalence, and what the firmware needs.

use super::case::{Analysis, DITHER_TRANSIENT_S, Expected, NEVER_PART, Outcome, Role};
use dynamics::period::mean_cycle_s;
use image::Image;
use pil::equivalence;
use pil::instructions::{Instructions, median, most};
use plot::number::four_digits;
use plot::verdict::Check;

/// What a mid-size microcontroller spares for the ECU's program.
const STACK_LIMIT_BYTES: f64 = 16.0 * 1024.0;
const FLASH_LIMIT_BYTES: f64 = 128.0 * 1024.0;
const RAM_LIMIT_BYTES: f64 = 64.0 * 1024.0;
/// A PWM interrupt that is late by as much moves the dither's edges by a hundredth of a PWM period.
const JITTER_LIMIT_PERCENT: f64 = 1.0;

/// The checks of one case.
pub(super) fn of(outcome: &Outcome) -> Vec<Check> {
    let mut checks = vec![bits(outcome), pace(outcome), overruns(outcome)];
    if let Some(analysis) = &outcome.analysis {
        checks.push(one_step(outcome, analysis));
        checks.push(horizon(outcome, analysis));
        checks.extend(invariants(outcome, analysis));
    }
    if outcome.case.role == Role::Region {
        checks.push(region(outcome));
    }
    checks
}

fn id(what: &str, outcome: &Outcome) -> String {
    format!("{what}/{}", outcome.case.id)
}

fn bits(outcome: &Outcome) -> Check {
    let bits = &outcome.bits;
    let title = "Bits: words that differ, host f32 and firmware";
    let seconds = outcome.firmware.states.len() as f64 * outcome.firmware.step_s;
    let first = bits
        .first
        .as_ref()
        .map_or(String::new(), |first| format!("; first: {first}"));
    Check::equals(id("bits", outcome), title, bits.differing as f64, 0.0).detail(format!(
        "{} state words, friction modes and duty codes over {seconds} s on the {}{first}",
        bits.compared,
        outcome.case.machine.core()
    ))
}

fn pace(outcome: &Outcome) -> Check {
    let pace = &outcome.pace;
    let title = "Bits: words that differ, firmware at the timer's and at the host's pace";
    let first = pace
        .first
        .as_ref()
        .map_or(String::new(), |first| format!("; first: {first}"));
    Check::equals(id("pace", outcome), title, pace.differing as f64, 0.0).detail(format!(
        "{} state words, friction modes and duty codes of the run that measures timing{first}",
        pace.compared
    ))
}

fn overruns(outcome: &Outcome) -> Check {
    let runs = [&outcome.recording, &outcome.timing];
    let overruns: f64 = runs.map(|run| f64::from(run.trailer.overruns)).iter().sum();
    Check::equals(
        id("overruns", outcome),
        "Records lost, tasks late",
        overruns,
        0.0,
    )
    .detail(format!(
        "at the timer's pace: {}; at the host's pace: {}",
        outcome.timing_log.last().map_or("", String::as_str),
        outcome.log.last().map_or("", String::as_str)
    ))
}

fn one_step(outcome: &Outcome, analysis: &Analysis) -> Check {
    let title = "One step: defect of f64 from the firmware over the rounding bound, worst step";
    Check::at_most(id("one-step", outcome), title, analysis.one_step.worst(), 1.0).detail(format!(
        "{} steps; bound by running error analysis; root mean square defect {} of the attractor's size",
        analysis.one_step.ratios.len(),
        four_digits(analysis.one_step.relative_rms)
    ))
}

fn horizon(outcome: &Outcome, analysis: &Analysis) -> Check {
    let cycle_s = mean_cycle_s(&outcome.firmware).unwrap_or(outcome.firmware.step_s);
    let parted = equivalence::parted_at_s(&analysis.divergence, cycle_s);
    let Some(predicted @ [least, expected, greatest]) = outcome.horizon_s() else {
        let furthest = analysis
            .divergence
            .iter()
            .map(|&(_, d)| d)
            .fold(0.0, f64::max);
        let title = "Horizon: greatest distance of free f32 and f64 runs over the attractor's size";
        return Check::at_most(id("horizon", outcome), title, furthest, NEVER_PART)
            .detail("a periodic motion: the runs must never part");
    };
    let title = "Horizon: time at which free f32 and f64 runs part";
    let detail = format!(
        "predicted {expected:.1} s from the exponent; interval of three standard deviations of its finite-time scatter"
    );
    let end_s = outcome.firmware.states.len() as f64 * outcome.firmware.step_s;
    match parted {
        Some(time_s) => Check::within(id("horizon", outcome), title, time_s, (least, greatest)),
        None if end_s > greatest => {
            Check::at_most(id("horizon", outcome), title, f64::INFINITY, greatest)
        }
        None => Check::untested(
            id("horizon", outcome),
            title,
            format!("not parted in {end_s} s, predicted {predicted:.1?} s: make the run longer"),
        ),
    }
    .unit("s")
    .detail(detail)
}

fn invariants(outcome: &Outcome, analysis: &Analysis) -> Vec<Check> {
    let (firmware, long) = (&outcome.firmware, &analysis.long);
    let settled_s = outcome.case.scenario.dither.start_time_s + DITHER_TRANSIENT_S;
    let (from, long_from) = (outcome.settled, long.index_after(settled_s));
    let periodic = analysis.long_period.maxima().is_some();

    let bounds = equivalence::bounds_distance(firmware, from, long, long_from);
    let bounds = Check::at_most(
        id("bounds", outcome),
        "Invariants: yaw rate's extremes, distance from the host's over what is allowed",
        bounds,
        1.0,
    )
    .detail("allowed: four standard deviations of equally long pieces of the host's run, and 1e-4 of the range");

    let poincare = if periodic {
        let distance = equivalence::poincare_points_distance(firmware, from, long, long_from);
        let title = "Invariants: furthest yaw-rate maximum from the host's, over the range";
        Check::at_most(id("poincare", outcome), title, distance, NEVER_PART)
    } else {
        let (distance, critical) = equivalence::poincare_distance(firmware, from, long, long_from);
        let title = "Invariants: distance of the yaw-rate maxima's distributions";
        Check::at_most(id("poincare", outcome), title, distance, critical)
            .detail("Kolmogorov-Smirnov; limit at a level of 0.1 %")
    };

    let firmware_period = outcome.period.maxima().unwrap_or(0) as f64;
    let host_period = analysis.long_period.maxima().unwrap_or(0) as f64;
    let title = "Invariants: period, firmware as host (0: none)";
    let period = Check::equals(id("period", outcome), title, firmware_period, host_period).detail(
        format!("firmware {}, host {}", outcome.period, analysis.long_period),
    );
    vec![exponent(outcome, analysis), period, bounds, poincare]
}

fn exponent(outcome: &Outcome, analysis: &Analysis) -> Check {
    let title = "Invariants: difference of the largest Lyapunov exponents over its error";
    let (Some(own), Some(host)) = (outcome.exponent, analysis.long_exponent) else {
        let reason = "the run is too short for a standard error; make it longer";
        return Check::untested(id("exponent", outcome), title, reason);
    };
    let error = own
        .standard_error_per_s
        .hypot(host.standard_error_per_s)
        .max(own.resolution_per_s / 3.0);
    let distance = (own.per_s - host.per_s).abs() / error;
    Check::at_most(id("exponent", outcome), title, distance, 3.0)
        .detail(format!("firmware {own}, host {host}"))
}

/// What the paper says of a speed.
fn region(outcome: &Outcome) -> Check {
    match outcome.case.expected {
        Expected::Period(n) => {
            let maxima = outcome.period.maxima().unwrap_or(0) as f64;
            let title = "Region: period on the firmware (0: none)";
            Check::equals(id("region", outcome), title, maxima, n as f64)
                .detail(outcome.period.to_string())
        }
        Expected::Chaos => chaotic(outcome),
    }
}

/// That the firmware's motion is chaotic.
pub(super) fn chaotic(outcome: &Outcome) -> Check {
    let title = "Chaos: largest Lyapunov exponent on the firmware";
    let Some(exponent) = outcome.exponent else {
        let reason = "the run is too short for a standard error; make it longer";
        return Check::untested(id("chaos", outcome), title, reason);
    };
    Check::at_least(id("chaos", outcome), title, exponent.per_s, exponent.threshold_per_s())
        .unit("1/s")
        .detail(format!(
            "{exponent}; limit: three standard errors, and the growth within one cycle over the run; {}",
            outcome.period
        ))
}

/// What the firmware needs of the machine.
pub(super) fn resources(image: &Image, outcomes: &[Outcome]) -> Vec<Check> {
    let stack = outcomes.iter().map(Outcome::stack_bytes).max();
    let mut checks: Vec<Check> = Vec::new();
    for outcome in outcomes {
        checks.push(load(id("load", outcome), &outcome.instructions()));
        checks.push(jitter(outcome));
    }
    checks.push(
        Check::at_most(
            "stack/ecu",
            "Deepest stack of all runs",
            stack.unwrap_or(0).into(),
            STACK_LIMIT_BYTES,
        )
        .unit("bytes")
        .detail("painted at the start, looked at in the end"),
    );
    for (what, bytes, limit) in [
        ("flash", image.flash_bytes, FLASH_LIMIT_BYTES),
        ("ram", image.ram_bytes, RAM_LIMIT_BYTES),
    ] {
        let title = format!("Size of the image in {what}, without stack");
        checks.push(
            Check::at_most(format!("{what}/ecu"), title, bytes as f64, limit)
                .unit("bytes")
                .detail("from the ELF's sections"),
        );
    }
    checks
}

/// Share of a control tick's instructions that its tasks take at worst.
pub(super) fn load(id: String, instructions: &Instructions) -> Check {
    let Instructions {
        control,
        pwm,
        periods_a_tick,
        tick,
    } = instructions;
    Check::at_most(
        id,
        "Worst case of control and PWM tasks, share of the period",
        100.0 * instructions.worst_share(),
        100.0,
    )
    .unit("%")
    .detail(format!(
        "instructions, not cycles: control task median {}, most {}; PWM task (the slowest of a tick) median {}, most {}; a tick \
         of {periods_a_tick} PWM periods has {tick}",
        median(control),
        most(control),
        median(pwm),
        most(pwm),
    ))
}

/// How far the spacing of PWM interrupts strays, by a timer that is not their clock.
fn jitter(outcome: &Outcome) -> Check {
    let (header, trailer) = (&outcome.timing.header, &outcome.timing.trailer);
    let (least, most) = (trailer.min_interval, trailer.max_interval);
    let spread = f64::from(most) - f64::from(least);
    let period = f64::from(header.cost_clock_hz)
        / (f64::from(header.step_rate_hz) * f64::from(header.samples_per_step));
    Check::at_most(
        id("jitter", outcome),
        "PWM interrupts: spread of their spacing, share of the period",
        100.0 * spread / period,
        JITTER_LIMIT_PERCENT,
    )
    .unit("%")
    .detail(format!(
        "{least} to {most} counts of an independent timer of {} MHz between {} interrupts, nominally {period}; in the emulator's \
         time, which is counted in instructions",
        f64::from(header.cost_clock_hz) / 1e6,
        outcome.timing.duties.len()
    ))
}

/// Facts about the image and the runs.
pub(super) fn notes(image: &Image, outcomes: &[Outcome]) -> Vec<(String, String)> {
    let simulated: f64 = outcomes
        .iter()
        .map(|outcome| outcome.firmware.states.len() as f64 * outcome.firmware.step_s)
        .sum();
    let timed: f64 = outcomes
        .iter()
        .map(|outcome| outcome.timing.records.len() as f64 * outcome.firmware.step_s)
        .sum();
    let stack = outcomes.iter().map(Outcome::stack_bytes).max();
    vec![
        (
            "Simulated on the target".into(),
            format!("{simulated} s in {} runs, and {timed} s in as many runs that measure timing", outcomes.len()),
        ),
        (
            "Firmware image".into(),
            format!(
                "{} bytes of flash, {} bytes of RAM without stack, deepest stack {} bytes",
                image.flash_bytes,
                image.ram_bytes,
                stack.unwrap_or(0)
            ),
        ),
        (
            "Start of the runs".into(),
            "after a 200 s transient from the paper's initial state, without dither, in f64, rounded to f32".into(),
        ),
    ]
}
