//! The controller's parameters.

use crate::Real;
use crate::listed;
use crate::parameter::parameters;

listed! {
    /// What the ECU suppresses the chaos with.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
    pub enum Suppression {
        /// Nothing.
        None => "none",
        /// The dither of the waveform in `dither.waveform`, the paper's way.
        Dither => "dither",
        /// Delayed feedback of the yaw rate through the motor.
        DelayedFeedback => "delayed_feedback",
        /// Dither and feedback.
        Both => "both",
    }
}

impl Suppression {
    /// The dither is used.
    pub fn has_dither(self) -> bool {
        matches!(self, Self::Dither | Self::Both)
    }

    /// The delayed feedback is used.
    pub fn has_feedback(self) -> bool {
        matches!(self, Self::DelayedFeedback | Self::Both)
    }
}

parameters! {
    section "controller";
    /// Policy of the controller: what suppresses the chaos, when it is on, and how fast commands may change.
    pub struct Policy {
        choices {
            /// What suppresses the chaos.
            suppression: Suppression,
        }
        /// Wheel speed below which there is no dither, rpm.
        dither_off_below_rpm: 0.0..=1e5,
        /// Margin above that speed at which the dither is switched on again, and within the speeds of the delayed
        /// feedback, rpm.
        hysteresis_rpm: 0.0..=1e4,
        /// Time in which the schedule's greatest amplitude comes in and goes out, s.
        dither_ramp_s: 1e-3..=100.0,
        /// Greatest motor current in answer to a request and the delayed feedback, A.
        motor_current_a: 0.0..=1000.0,
        /// Greatest change of the motor current in answer to a request, A/s.
        motor_slew_a_per_s: 1e-3..=1e6,
        /// Greatest torque of the delayed feedback either way, about the steering axis, N m.
        feedback_torque_nm: 0.0..=1e4,
        /// Greatest change of that torque, N m/s.
        feedback_slew_nm_per_s: 1e-3..=1e7,
        /// Rate at which its delay adapts to the orbit's period, s^3/rad^2: the product of the yaw rate's difference and
        /// derivative times this is the delay's derivative.
        feedback_adaptation_s3_per_rad2: 0.0..=1.0,
    }
}

impl<T: Real> Policy<T> {
    /// The policy for the preset `reconstruction`.
    pub fn reconstruction() -> Self {
        Self {
            suppression: Suppression::Dither,
            dither_off_below_rpm: T::from_f64(1530.0),
            hysteresis_rpm: T::from_f64(20.0),
            dither_ramp_s: T::from_f64(0.5),
            motor_current_a: T::from_f64(14.0),
            motor_slew_a_per_s: T::from_f64(10.0),
            feedback_torque_nm: T::from_f64(6.0),
            feedback_slew_nm_per_s: T::from_f64(100.0),
            feedback_adaptation_s3_per_rad2: T::from_f64(1e-3),
        }
    }
}
