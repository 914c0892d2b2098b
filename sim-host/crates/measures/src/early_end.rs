//! Trajectories that end before their time, and why.

use nalgebra::Vector4;
use shared_model::Real;

/// Angles (rad) and rates (rad/s) beyond this are no motion of a vehicle.
pub const BOUND: f64 = 1e3;

/// Whether a state vector is one of a vehicle at all: finite, and within any bounds that one could
/// keep.
pub fn is_bounded<T: Real>(x: &Vector4<T>) -> bool {
    x.iter().all(|value| value.to_f64().abs() < BOUND)
}

/// A trajectory that ended before its time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct EarlyEnd {
    /// When, s.
    pub time_s: f64,
    /// Why.
    pub reason: Reason,
}

impl std::fmt::Display for EarlyEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { time_s, reason } = self;
        match reason {
            Reason::Diverges => write!(f, "the motion diverges at {time_s:.3} s"),
            Reason::StepTooLong => write!(
                f,
                "the step is too long: at {time_s:.3} s the fixed step leaves all bounds, within which the motion itself stays"
            ),
            Reason::Chattering | Reason::TooManySteps => {
                write!(f, "the integrator stops at {time_s:.3} s: {reason}")
            }
        }
    }
}

impl std::error::Error for EarlyEnd {}

impl EarlyEnd {
    /// The same, counted from an instant `earlier_s` before.
    pub fn later_by(self, earlier_s: f64) -> Self {
        Self {
            time_s: earlier_s + self.time_s,
            ..self
        }
    }
}

/// Why a trajectory ended before its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The solution itself leaves all physical bounds: angles in rad and rates in rad/s below a
    /// thousand.
    #[error("diverges")]
    Diverges,
    /// The numerical solution left the bounds, while the solution to a tolerance stays within them:
    /// the fixed step is unstable.
    #[error("step too long")]
    StepTooLong,
    /// Mode transitions of the friction follow each other without end: a sliding mode, which an
    /// integrator between events cannot pass.
    #[error("chattering friction")]
    Chattering,
    /// The tolerance asks for more steps per second of motion than a run may take.
    #[error("too many steps")]
    TooManySteps,
}
