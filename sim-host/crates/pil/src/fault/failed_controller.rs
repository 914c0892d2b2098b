//! A controller that fails: its commands are changed ahead of the gate.

use super::catalogue::ControllerFailure;
use shared_model::controller::Command;

/// Changes the commands of both channels alike, so that only the gate can detect the failure.
#[derive(Debug, Clone)]
pub struct FailedController {
    failure: ControllerFailure,
    control_period_s: f32,
    /// Control ticks since the failure began.
    ticks: u32,
    /// The first command of the failure.
    first: Option<Command<f32>>,
}

impl FailedController {
    /// Fails from the next control tick on.
    pub fn new(failure: ControllerFailure, control_period_s: f32) -> Self {
        Self {
            failure,
            control_period_s,
            ticks: 0,
            first: None,
        }
    }

    /// Begins a control tick.
    pub fn begin_tick(&mut self) {
        self.ticks += 1;
    }

    /// Changes the command of a channel in the present control tick.
    pub fn change(&mut self, command: &mut Command<f32>) {
        let first = *self.first.get_or_insert(*command);
        match self.failure {
            ControllerFailure::MotorNotANumber => command.motor_v = f32::NAN,
            ControllerFailure::MotorOffset(volts) => command.motor_v += volts,
            ControllerFailure::MotorDrift(volts_per_s) => {
                command.motor_v += volts_per_s * self.ticks as f32 * self.control_period_s;
            }
            ControllerFailure::MotorInverted => command.motor_v = -command.motor_v,
            ControllerFailure::MotorStuck => command.motor_v = first.motor_v,
            ControllerFailure::FeedbackOffset(volts) => command.feedback_v += volts,
            ControllerFailure::FeedbackInverted => command.feedback_v = -command.feedback_v,
            ControllerFailure::DitherNotANumber => command.dither_amplitude_v = f32::NAN,
            ControllerFailure::DitherScaled(factor) => command.dither_amplitude_v *= factor,
            ControllerFailure::DitherStuck => command.dither_amplitude_v = first.dither_amplitude_v,
        }
    }
}
