//! Suppression of chaos: the motion before and after dither, and the averaged system against the
//! true signal.

use super::case::{Outcome, Role};
use super::checks::chaotic;
use crate::report::Pair;
use dynamics::lyapunov::Exponent;
use dynamics::period::Period;
use plot::verdict::Check;
use shared_model::dither::Waveform;
use shared_model::vehicle::YAW_RATE;
use std::f64::consts::TAU;

const WAVEFORMS: [Waveform; 2] = [Waveform::Square, Waveform::Sine];

/// Averaging errs by some multiple of the motion's frequency over the dither's; more than this
/// multiple is no averaging.
const AVERAGING_ORDER: f64 = 10.0;

/// The checks over several cases.
pub(super) fn checks(outcomes: &[Outcome]) -> Vec<Check> {
    let Some((_, before)) = find(outcomes, Role::Chaos) else {
        return Vec::new();
    };
    let mut checks = vec![chaotic(before)];
    checks.extend(host_chaotic(before));
    for waveform in WAVEFORMS {
        let after = find(outcomes, Role::Dithered(waveform));
        let signal = find(outcomes, Role::Signal(waveform));
        if let Some((_, after)) = after {
            checks.push(same_before_dither(before, after));
            checks.extend(suppressed(after));
            if let Some((_, signal)) = signal {
                checks.extend(averaging(after, signal));
            }
        }
    }
    checks
}

/// The run without dither beside each with.
pub(super) fn pairs(outcomes: &[Outcome]) -> Vec<Pair> {
    let Some((before, _)) = find(outcomes, Role::Chaos) else {
        return Vec::new();
    };
    let pair = |waveform| {
        let (after, outcome) = find(outcomes, Role::Dithered(waveform))?;
        Some(Pair {
            before,
            after,
            title: outcome.case.title.clone(),
        })
    };
    WAVEFORMS.into_iter().filter_map(pair).collect()
}

fn host_chaotic(before: &Outcome) -> Option<Check> {
    let exponent = before.analysis.as_ref()?.long_exponent?;
    Some(
        Check::at_least(
            format!("chaos-host/{}", before.case.id),
            "Chaos: largest Lyapunov exponent on the host, f64",
            exponent.per_s,
            exponent.threshold_per_s(),
        )
        .unit("1/s")
        .detail(exponent.to_string()),
    )
}

/// Up to the dither's start, the dithered run is the undithered one.
fn same_before_dither(before: &Outcome, after: &Outcome) -> Check {
    let steps = after.case.scenario.dither_start_step() as usize;
    let pairs = before.firmware.states.iter().zip(&after.firmware.states);
    let differing = pairs.take(steps).filter(|(a, b)| a != b).count();
    Check::equals(
        format!("before-dither/{}", after.case.id),
        "Before: states that differ from the run without dither",
        differing as f64,
        0.0,
    )
    .detail(format!("{steps} states up to the dither's start"))
}

/// After the dither's start the motion is of period one and not chaotic: on the firmware and on the
/// host.
fn suppressed(after: &Outcome) -> Vec<Check> {
    let Some(analysis) = &after.analysis else {
        return Vec::new();
    };
    let firmware = ("firmware", "", &after.period, after.exponent);
    let host = (
        "host, f64",
        "-host",
        &analysis.long_period,
        analysis.long_exponent,
    );
    [firmware, host]
        .into_iter()
        .flat_map(|(place, suffix, period, exponent)| {
            [
                period_one(after, place, suffix, period),
                not_chaotic(after, place, suffix, exponent),
            ]
        })
        .collect()
}

fn period_one(after: &Outcome, place: &str, suffix: &str, period: &Period) -> Check {
    Check::equals(
        format!("suppressed-period{suffix}/{}", after.case.id),
        format!("After: period on the {place} (0: none)"),
        period.maxima().unwrap_or(0) as f64,
        1.0,
    )
    .detail(period.to_string())
}

fn not_chaotic(after: &Outcome, place: &str, suffix: &str, exponent: Option<Exponent>) -> Check {
    let id = format!("suppressed-exponent{suffix}/{}", after.case.id);
    let title = format!("After: largest Lyapunov exponent on the {place}");
    let Some(exponent) = exponent else {
        return Check::untested(
            id,
            title,
            "the run is too short for a standard error; make it longer",
        );
    };
    Check::at_most(id, title, exponent.per_s, exponent.threshold_per_s())
        .unit("1/s")
        .detail(format!(
            "{exponent}; zero is a periodic motion's; limit: what the run's length tells from zero"
        ))
}

/// The motion under the true signal against that of the averaged system.
fn averaging(averaged: &Outcome, signal: &Outcome) -> Vec<Check> {
    let id = |what: &str| format!("{what}/{}", signal.case.id);
    let period = Check::equals(
        id("signal-period"),
        "True signal: period on the firmware (0: none)",
        signal.period.maxima().unwrap_or(0) as f64,
        1.0,
    )
    .detail(signal.period.to_string());
    let (Some(averaged_s), Some(signal_s)) = (cycle_s(averaged), cycle_s(signal)) else {
        let reason = "one of the motions has no cycle";
        return vec![
            period,
            Check::untested(
                id("averaging"),
                "Averaging: difference of the cycles",
                reason,
            ),
        ];
    };
    let frequency = signal.case.scenario.dither.frequency_rad_per_s();
    let limit = 100.0 * AVERAGING_ORDER * TAU / signal_s / frequency;
    let cycle = Check::at_most(
        id("averaging-cycle"),
        "Averaging: cycle time, true signal from averaged",
        100.0 * (signal_s / averaged_s - 1.0).abs(),
        limit,
    )
    .unit("%")
    .detail(format!("{signal_s:.5} s from {averaged_s:.5} s; limit: {AVERAGING_ORDER} times the ratio of the frequencies"));
    let swing = |outcome: &Outcome| {
        let (low, high) = outcome.firmware.range(YAW_RATE, outcome.settled);
        high - low
    };
    let swing = Check::at_most(
        id("averaging-swing"),
        "Averaging: yaw rate's swing, true signal from averaged",
        100.0 * (swing(signal) / swing(averaged) - 1.0).abs(),
        limit,
    )
    .unit("%")
    .detail(format!(
        "{:.5} rad/s from {:.5} rad/s",
        swing(signal),
        swing(averaged)
    ));
    vec![period, cycle, swing]
}

fn cycle_s(outcome: &Outcome) -> Option<f64> {
    match outcome.period {
        Period::Periodic { maxima, time_s, .. } => Some(time_s / maxima as f64),
        _ => None,
    }
}

/// The outcome with the given role.
fn find(outcomes: &[Outcome], role: Role) -> Option<(usize, &Outcome)> {
    outcomes
        .iter()
        .enumerate()
        .find(|(_, outcome)| outcome.case.role == role)
}
