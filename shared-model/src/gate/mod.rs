//! The command gate: independent limits on every command, and the safe state. It shares no code
//! with the controller that it guards.
//!
//! At the control rate a [`Supervisor`] judges sensors, time and the controller's command; at the
//! PWM rate a [`Limiter`] judges each sample of the dither and the duty seen on the servo's pin.
//! Any fault latches the safe state until restart: the motor's share slews to zero, and a lower wheel
//! speed is demanded. The class of the fault decides on a dither that is on: after a fault of sensor,
//! link or command it is kept, at an amplitude that suppresses the chaos at any speed; after one of its
//! own path, of the servo or of the processor it is ramped out. Servo and processor are judged in the
//! safe state too: if the servo does not follow, or memory is corrupted, its bridge is switched off.

mod fault;
mod limiter;
mod limits;
mod plausibility;
mod supervisor;

pub use fault::{Fault, FaultClass, Faults};
pub use limiter::Limiter;
pub use limits::Limits;
pub use plausibility::Plausibility;
pub use supervisor::{Observation, Supervisor};

use crate::Real;

/// Setpoint of the servo until the next control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setpoint<T> {
    /// Voltage of the motor, V: its share and the delayed feedback's.
    pub motor_v: T,
    /// Amplitude of the dither, V.
    pub dither_amplitude_v: T,
}

impl<T: Real> Setpoint<T> {
    /// No voltage, no dither.
    pub fn neutral() -> Self {
        Self {
            motor_v: T::zero(),
            dither_amplitude_v: T::zero(),
        }
    }
}
