//! Suppression by delayed feedback, with the ECU in the loop: chaos before, the orbit after, and the torque for it.

use dynamics::component::Component;
use dynamics::delayed_feedback::{Feedback, Linearised};
use pil::closed_loop::{self, Run};
use pil::ecu::Software;
use pil::feedback::{change_over_period, root_mean_square, torques_nm};
use pil::manoeuvre::Manoeuvre;
use pil::mil_sil_pil::LoopError;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use plot::number::four_digits;
use plot::verdict::Check;
use shared_model::Scenario;
use shared_model::delayed_feedback::table::UNDITHERED;
use shared_model::policy::Suppression;

/// Time at the end from which the motion is judged, s.
const JUDGED_S: f64 = 10.0;
/// Greatest torque of an orbit that is held, N m, root mean square: four counts of the paper's PWM.
const HELD_NM: f64 = 0.2;
/// Greatest change of the yaw rate over a period, over its swing, of an orbit that is held, %.
const HELD_PERCENT: f64 = 1.0;

/// The checks of a run under feedback.
///
/// # Errors
/// If the same run without feedback cannot be made.
pub(super) fn checks(
    id: &str,
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    run: &Run,
) -> Result<Vec<Check>, LoopError> {
    let before = same_before(id, scenario, manoeuvre, run)?;
    let rpm = scenario.run.wheel_speed_rpm;
    let Some(tuning) = UNDITHERED.at(rpm as f32) else {
        let reason = format!("the ECU has no period for {rpm} rpm");
        let title = "After: the orbit is held";
        let untested = Check::untested(format!("suppressed-orbit/{id}"), title, reason);
        return Ok(vec![before, untested]);
    };
    let rate_hz = scenario.run.control_rate_hz;
    let period_ticks = (f64::from(tuning.period_s) * rate_hz).round() as usize;
    let last = run
        .records
        .len()
        .saturating_sub((JUDGED_S * rate_hz) as usize);
    let judged = &run.records[last..];
    let change = change_over_period(judged, period_ticks);
    let yaw_rates = || judged.iter().map(|record| record.yaw_rate_rad_per_s);
    let low = yaw_rates().fold(f64::INFINITY, f64::min);
    let high = yaw_rates().fold(f64::NEG_INFINITY, f64::max);
    let torque_nm = root_mean_square(torques_nm(judged, scenario));
    let count_nm = 2.0 * scenario.servo.bus_voltage_v
        / f64::from(scenario.servo.period_counts(scenario.run.pwm_rate_hz))
        / scenario.motor_v_per_nm();
    Ok(vec![
        before,
        Check::at_most(
            format!("suppressed-orbit/{id}"),
            "After: change of the yaw rate over the orbit's period, over its swing",
            100.0 * change / (high - low),
            HELD_PERCENT,
        )
        .unit("%")
        .detail(format!(
            "root mean square in the last {JUDGED_S} s; period {} s, the paper's vehicle's; yaw rate from {low:.2} to {high:.2} rad/s",
            tuning.period_s
        )),
        Check::at_most(
            format!("suppressed-torque/{id}"),
            "After: torque of the feedback",
            torque_nm,
            HELD_NM,
        )
        .unit("N m")
        .detail(format!(
            "root mean square in the last {JUDGED_S} s, about the steering axis; a count of the PWM is {} N m",
            four_digits(count_nm)
        )),
        exponent(id, scenario, f64::from(tuning.gain)),
    ])
}

/// Up to the feedback's start the run is that without it.
fn same_before(
    id: &str,
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    run: &Run,
) -> Result<Check, LoopError> {
    let mut without = *scenario;
    without.controller.suppression = Suppression::None;
    let start_s = scenario.dither.start_time_s.min(scenario.run.duration_s);
    without.run.duration_s = start_s.max(1.0 / scenario.run.control_rate_hz);
    let mut ecu = Software::new(&ecu_scenario(&without, manoeuvre))?;
    let free = closed_loop::run(&mut ecu, VehicleNode::new(&without, manoeuvre)?, &mut || {})?;
    let pairs = run.records.iter().zip(&free.records);
    let differing = pairs.filter(|(a, b)| a != b).count();
    let check = Check::equals(
        format!("before-feedback/{id}"),
        "Before: states that differ from the run without feedback",
        differing as f64,
        0.0,
    );
    Ok(check.detail(format!(
        "{} states up to the feedback's start",
        free.records.len()
    )))
}

/// The orbit's greatest exponent under the feedback, by the multipliers of the linearised loop.
fn exponent(id: &str, scenario: &Scenario<f64>, gain: f64) -> Check {
    let id = format!("suppressed-exponent/{id}");
    let title = "After: greatest exponent of the orbit under the feedback";
    let Some(orbit) = Linearised::of(scenario) else {
        return Check::untested(id, title, "no orbit of one cycle is found at this speed");
    };
    let multiplier = orbit.greatest_multiplier(&Feedback {
        component: Component::YAW_RATE,
        mixed: None,
        gain,
        delay_s: orbit.period_s,
        memory: 0.0,
        limit_nm: scenario.controller.feedback_torque_nm,
        adaptation: 0.0,
        latency_ticks: 2,
    });
    let per_s = |multiplier: f64| multiplier.abs().ln() / orbit.period_s;
    Check::at_most(id, title, per_s(multiplier), 0.0)
        .unit("1/s")
        .detail(format!(
            "multiplier {} instead of {}, exponent {} 1/s without feedback",
            four_digits(multiplier),
            four_digits(orbit.free_multiplier),
            four_digits(per_s(orbit.free_multiplier))
        ))
}
