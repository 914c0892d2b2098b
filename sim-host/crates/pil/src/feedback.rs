//! Measures of a run under delayed feedback: its torque, and how far the motion is from an orbit.

use crate::record::Record;
use shared_model::Scenario;

/// Torque of the feedback about the steering axis at each record, N m: that of the motor current beside the driver's
/// request. Zero but for the PWM's resolution where there is no feedback and the request is constant.
pub fn torques_nm(records: &[Record], scenario: &Scenario<f64>) -> Vec<f64> {
    let nm_per_a = scenario.servo.winding_resistance_ohm / scenario.motor_v_per_nm();
    let of = |record: &Record| (record.motor_current_a - record.current_request_a) * nm_per_a;
    records.iter().map(of).collect()
}

/// Root mean square of the yaw rate's change over a period of that many records, rad/s: zero on an orbit of that
/// period. NaN if there are no more records than the period has.
pub fn change_over_period(records: &[Record], period: usize) -> f64 {
    let after = records.iter().skip(period);
    let pairs = records.iter().zip(after);
    root_mean_square(pairs.map(|(a, b)| b.yaw_rate_rad_per_s - a.yaw_rate_rad_per_s))
}

/// Root mean square; NaN of no values.
pub fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let add = |(sum, count), value: f64| (sum + value * value, count + 1.0);
    let (sum, count) = values.into_iter().fold((0.0, 0.0), add);
    f64::sqrt(sum / count)
}
