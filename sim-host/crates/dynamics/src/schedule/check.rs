//! The schedule as the ECU uses it: looked up, and applied as the true signal at the PWM's rate.

use super::cells::{Cell, cells};
use super::choose::Entry;
use crate::attractor::Kind;
use crate::period::{Period, RIPPLE_TOLERANCE, period};
use crate::simulate::{Unsettled, after_transient, early_end, record, settle, started_at};
use crate::sweep::{RunControl, SweepError, Timing, Values, mirrored};
use shared_model::Scenario;
use shared_model::dither::Application;
use shared_model::schedule::amplitude_v;
use shared_model::vehicle::YAW_RATE;

/// Time in which the motion settles under the dither, and in which it is looked at, s.
const DITHER_TRANSIENT_S: f64 = 60.0;
const MOTION_S: f64 = 40.0;
/// Periods of the dither over which the motion is averaged: the ripple is gone, the slow motion is
/// not touched.
const SMOOTHED_PERIODS: f64 = 2.0;
/// Less swing of the smoothed yaw rate is what the ripple leaves of rest, rad/s; cycles have some
/// tenths.
const AT_REST_RAD_PER_S: f64 = 1e-3;

/// The motions under the amplitudes that the ECU looks up at the table's speeds and midway between
/// them, by speed; `None` if it was stopped.
///
/// As the ECU meets them: the undithered motion settles from either start before the dither sets
/// in.
pub(super) fn check(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    entries: &[Entry],
    timing: Timing,
    control: RunControl,
) -> Result<Option<Vec<Cell>>, SweepError> {
    let amplitudes_v: Vec<f64> = entries.iter().map(|entry| entry.amplitude_v).collect();
    let speeds: Vec<f64> = speeds_rpm.iter().collect();
    let first_rpm = speeds[0];
    let step_rpm = speeds.get(1).map_or(1.0, |second| second - first_rpm);
    let midway = speeds.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
    let mut at: Vec<f64> = midway.chain(speeds.iter().copied()).collect();
    at.sort_by(f64::total_cmp);
    let at: Vec<Scenario<f64>> = at
        .into_iter()
        .map(|rpm| {
            let mut scenario = *scenario;
            scenario.run.wheel_speed_rpm = rpm;
            scenario.dither.amplitude_v = amplitude_v(first_rpm, step_rpm, &amplitudes_v, rpm);
            scenario
        })
        .collect();
    let (undithered, dithered): (Vec<_>, Vec<_>) =
        at.into_iter().partition(|s| s.dither.amplitude_v == 0.0);
    let Some(mut checked) = cells(&undithered, timing, control)? else {
        return Ok(None);
    };
    let under_signal = control.points(&dithered, |scenario| {
        let given = under_signal(scenario, timing)?;
        let mirrored = under_signal(&mirrored(scenario), timing)?;
        Ok(Cell::of(scenario, given, mirrored))
    });
    let under_signal: Option<Result<Vec<_>, SweepError>> = under_signal.into_iter().collect();
    let Some(under_signal) = under_signal.transpose()? else {
        return Ok(None);
    };
    checked.extend(under_signal);
    checked.sort_by(|a, b| a.wheel_speed_rpm.total_cmp(&b.wheel_speed_rpm));
    Ok(Some(checked))
}

/// Kind of the motion when the true signal sets in on the settled undithered motion.
fn under_signal(scenario: &Scenario<f64>, timing: Timing) -> Result<Kind, SweepError> {
    let settled = match settle(scenario, timing.transient_s) {
        Err(Unsettled::EndsEarly(end)) => return Ok(end.into()),
        settled => settled?,
    };
    let mut scenario = started_at(scenario, &settled);
    scenario.dither.application = Application::Signal;
    scenario.run.duration_s = MOTION_S;
    let mut ecu = match after_transient(&scenario, DITHER_TRANSIENT_S) {
        Err(Unsettled::EndsEarly(end)) => return Ok(end.into()),
        ecu => ecu?,
    };
    let trace = record(&mut ecu, &scenario);
    scenario.dither.start_time_s = 0.0;
    if let Some(end) = early_end(&scenario, &trace) {
        return Ok(end.into());
    }
    let turn_s = std::f64::consts::TAU / scenario.dither.frequency_rad_per_s();
    let slow = trace.smoothed(SMOOTHED_PERIODS * turn_s);
    let (low, high) = slow.range(YAW_RATE, 0);
    if high - low < AT_REST_RAD_PER_S {
        return Ok(Kind::Equilibrium);
    }
    Ok(match period(&slow, 0, RIPPLE_TOLERANCE) {
        Period::Equilibrium => Kind::Equilibrium,
        Period::Periodic { maxima, .. } => Kind::Periodic(maxima),
        Period::Aperiodic { .. } | Period::TooShort { .. } => Kind::Undecided,
    })
}
