//! Disturbances between vehicle and ECU.

use shared_model::exchange::FrameBytes;
use shared_model::signal::Measurement;

/// The duty that the servo receives, and its readback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DutyCodes {
    /// Duty code of the servo.
    pub driven: u16,
    /// Duty code that the ECU captures at the servo's pin.
    pub captured: u16,
}

/// A disturbance between vehicle and ECU; by default none. In each PWM period the functions are
/// called once and in this order. A frame is `None` if none was sent.
pub trait Disturbance {
    /// The actuator frame that the vehicle receives.
    fn actuator_frame(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        sent
    }

    /// The duty that the ECU sends.
    fn duty(&mut self, code: u16) -> DutyCodes {
        DutyCodes {
            driven: code,
            captured: code,
        }
    }

    /// The measurement before it is encoded as a frame, at control ticks only.
    fn measurement(&mut self, measured: Measurement<f32>) -> Measurement<f32> {
        measured
    }

    /// The sensor frame that the ECU receives.
    fn sensor_frame(&mut self, sent: Option<FrameBytes>) -> Option<FrameBytes> {
        sent
    }
}

/// No disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Undisturbed;

impl Disturbance for Undisturbed {}
