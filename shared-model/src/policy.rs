//! The controller's parameters.

use crate::Real;
use crate::parameter::parameters;

parameters! {
    section "policy";
    /// Policy of the controller: when the dither is on, and how fast commands may change.
    pub struct Policy {
        /// Wheel speed below which there is no dither, rpm.
        dither_off_below_rpm: 0.0..=1e5,
        /// Margin above that speed at which the dither is switched on again, rpm.
        hysteresis_rpm: 0.0..=1e4,
        /// Time in which the schedule's greatest amplitude comes in and goes out, s.
        dither_ramp_s: 1e-3..=100.0,
        /// Greatest motor current in answer to a request, A.
        motor_current_a: 0.0..=1000.0,
        /// Greatest change of the motor current, A/s.
        motor_slew_a_per_s: 1e-3..=1e6,
    }
}

impl<T: Real> Policy<T> {
    /// The policy for the preset `reconstruction`.
    pub fn reconstruction() -> Self {
        Self {
            dither_off_below_rpm: T::from_f64(1530.0),
            hysteresis_rpm: T::from_f64(20.0),
            dither_ramp_s: T::from_f64(0.5),
            motor_current_a: T::from_f64(14.0),
            motor_slew_a_per_s: T::from_f64(10.0),
        }
    }
}
