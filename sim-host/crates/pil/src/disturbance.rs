//! What can come between vehicle and ECU.

use shared_model::exchange::FrameBytes;
use shared_model::signal::Measurement;

/// A duty on its way to the servo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DutyCodes {
    /// What the servo is driven with.
    pub driven: u16,
    /// What the ECU captures at the servo's pin.
    pub captured: u16,
}

/// What comes between vehicle and ECU, PWM period by PWM period; by default nothing. In each period the functions are called
/// once and in this order; frames are `None` where none was sent.
pub trait Disturbance {
    /// The actuator frame on its way to the vehicle.
    fn actuator_frame(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        sent
    }

    /// The duty that the ECU puts out.
    fn duty(&mut self, code: u16) -> DutyCodes {
        DutyCodes {
            driven: code,
            captured: code,
        }
    }

    /// What the sensors tell, before it is put into a frame: at a control tick only.
    fn measurement(&mut self, told: Measurement<f32>) -> Measurement<f32> {
        told
    }

    /// The sensor frame on its way to the ECU.
    fn sensor_frame(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        sent
    }
}

/// Nothing comes between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Undisturbed;

impl Disturbance for Undisturbed {}
