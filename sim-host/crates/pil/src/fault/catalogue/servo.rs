//! Failures of the servo.

use dynamics::words::counted;
use std::fmt;

/// Failure of the servo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ServoFailure {
    /// The duty is constant.
    Stuck,
    /// The duty is at an end of its range.
    Saturated {
        /// The upper end.
        high: bool,
    },
    /// The dither is late by this number of PWM periods.
    DitherPhase {
        /// PWM periods.
        periods: usize,
    },
    /// The dither is inverted.
    DitherInverted,
    /// The dither is held over this number of PWM periods: another frequency.
    DitherFrequency {
        /// PWM periods.
        held: u32,
    },
    /// The duty has a constant error.
    Offset {
        /// Counts.
        counts: i16,
    },
}

impl ServoFailure {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Stuck => "duty stuck",
            Self::Saturated { .. } => "duty saturated",
            Self::DitherPhase { .. } | Self::DitherInverted => "dither phase",
            Self::DitherFrequency { .. } => "dither frequency",
            Self::Offset { .. } => "duty offset",
        }
    }
}

impl fmt::Display for ServoFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Stuck => write!(f, "duty stuck"),
            Self::Saturated { high: true } => write!(f, "duty at 100 %"),
            Self::Saturated { high: false } => write!(f, "duty at 0 %"),
            Self::DitherPhase { periods } => {
                write!(f, "dither late by {}", counted(periods, "period"))
            }
            Self::DitherInverted => write!(f, "dither inverted"),
            Self::DitherFrequency { held } => {
                write!(f, "dither held over {}", counted(held, "period"))
            }
            Self::Offset { counts } => write!(f, "duty error of {}", counted(counts, "count")),
        }
    }
}

/// The failures of the servo.
pub(super) fn all() -> [ServoFailure; 10] {
    use ServoFailure::{DitherFrequency, DitherInverted, DitherPhase, Offset, Saturated, Stuck};
    [
        Stuck,
        Saturated { high: true },
        Saturated { high: false },
        DitherPhase { periods: 1 },
        DitherPhase { periods: 8 },
        DitherInverted,
        DitherFrequency { held: 2 },
        DitherFrequency { held: 5 },
        Offset { counts: 1 },
        Offset { counts: -40 },
    ]
}
