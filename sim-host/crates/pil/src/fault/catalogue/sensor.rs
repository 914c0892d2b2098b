//! Failures of sensors.

use shared_model::gate::Limits;
use shared_model::listed;
use shared_model::signal::Measurement;
use std::fmt;

listed! {
    /// A signal of the sensor frame.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Signal {
        /// Wheel speed, rpm.
        WheelSpeed => "wheel speed",
        /// Yaw rate, rad/s.
        YawRate => "yaw rate",
        /// Steering angle, rad.
        SteeringAngle => "steering angle",
        /// Steering rate, rad/s.
        SteeringRate => "steering rate",
        /// Driver's current request, A.
        CurrentRequest => "current request",
    }
}

impl Signal {
    /// Its field in a measurement.
    pub fn of(self, measurement: &mut Measurement<f32>) -> &mut f32 {
        match self {
            Self::WheelSpeed => &mut measurement.wheel_speed_rpm,
            Self::YawRate => &mut measurement.yaw_rate_rad_per_s,
            Self::SteeringAngle => &mut measurement.steering_angle_rad,
            Self::SteeringRate => &mut measurement.steering_rate_rad_per_s,
            Self::CurrentRequest => &mut measurement.current_request_a,
        }
    }

    /// Greatest magnitude that the gate accepts, in the signal's unit.
    pub fn range(self, limits: &Limits<f64>) -> f64 {
        match self {
            Self::WheelSpeed => limits.wheel_speed_sensor_rpm,
            Self::YawRate => limits.yaw_rate_rad_per_s,
            Self::SteeringAngle => limits.steering_angle_rad,
            Self::SteeringRate => limits.steering_rate_rad_per_s,
            Self::CurrentRequest => limits.current_request_a,
        }
    }
}

/// Failure of a sensor. Shares are relative to the signal's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorFailure {
    /// Not a number.
    NotANumber,
    /// Infinite.
    Infinite,
    /// A subnormal number.
    Subnormal,
    /// One and a half times its range.
    OutOfRange,
    /// Keeps its last value.
    Stuck,
    /// Steps by this share and keeps that value.
    Step(f32),
    /// Has a constant error of this share.
    Offset(f32),
    /// Has an error that increases by this share per second.
    Drift(f32),
    /// Zero.
    DropOut,
}

impl SensorFailure {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::NotANumber => "sensor NaN",
            Self::Infinite => "sensor infinite",
            Self::Subnormal => "sensor subnormal",
            Self::OutOfRange => "sensor out of range",
            Self::Stuck => "sensor stuck",
            Self::Step(_) => "sensor step",
            Self::Offset(_) => "sensor offset",
            Self::Drift(_) => "sensor drift",
            Self::DropOut => "sensor drop-out",
        }
    }
}

impl fmt::Display for SensorFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f32| 100.0 * share;
        match *self {
            Self::NotANumber => write!(f, "NaN"),
            Self::Infinite => write!(f, "infinite"),
            Self::Subnormal => write!(f, "subnormal"),
            Self::OutOfRange => write!(f, "out of range"),
            Self::Stuck => write!(f, "stuck"),
            Self::Step(share) => write!(f, "step of {:+} %", percent(share)),
            Self::Offset(share) => write!(f, "offset of {:+} %", percent(share)),
            Self::Drift(share) => write!(f, "drift of {:+} %/s", percent(share)),
            Self::DropOut => write!(f, "drop-out"),
        }
    }
}

/// The failures of a sensor, with their duration in control ticks; `None` if permanent.
pub(super) fn all() -> Vec<(SensorFailure, Option<u32>)> {
    use SensorFailure::{
        Drift, DropOut, Infinite, NotANumber, Offset, OutOfRange, Step, Stuck, Subnormal,
    };
    let mut failures = vec![NotANumber, Infinite, Subnormal, OutOfRange, Stuck, DropOut];
    for share in [0.005, 0.02, 0.1, 0.5] {
        for share in [share, -share] {
            failures.extend([Step(share), Offset(share)]);
        }
    }
    failures.extend([Drift(0.01), Drift(-0.01)]);
    let permanent = failures.into_iter().map(|failure| (failure, None));
    let brief = [NotANumber, DropOut, Offset(0.1)].map(|failure| (failure, Some(1)));
    permanent.chain(brief).collect()
}
