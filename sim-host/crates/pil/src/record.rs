//! The recorded vehicle, for tables and figures.

use serde::Serialize;
use shared_model::friction::FrictionMode;

/// The plant at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Record {
    /// Time from the manoeuvre's start, s.
    pub time_s: f64,
    /// Wheel speed, rpm.
    pub wheel_speed_rpm: f64,
    /// Sideslip angle beta, rad.
    pub sideslip_rad: f64,
    /// Yaw rate gamma, rad/s.
    pub yaw_rate_rad_per_s: f64,
    /// Front steering angle delta_f, rad.
    pub steering_angle_rad: f64,
    /// Steering rate, rad/s.
    pub steering_rate_rad_per_s: f64,
    /// Mode of the dry friction.
    #[serde(serialize_with = "lower_case")]
    pub friction_mode: FrictionMode,
    /// Motor current that the driver requests, A.
    pub current_request_a: f64,
    /// Motor current of the last PWM period, A.
    pub motor_current_a: f64,
    /// Dither ahead of the nonlinearities in that period, rad.
    pub dither_rad: f64,
    /// Duty code of that period.
    pub duty_code: u16,
}

fn lower_case<S: serde::Serializer>(mode: &FrictionMode, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&format!("{mode:?}").to_lowercase())
}
