//! Failures of the controller, as after a wrong program or wrong data in both channels.

use std::fmt;

/// Failure of the controller: the gate judges another command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ControllerFailure {
    /// The motor's share is not a number.
    MotorNotANumber,
    /// The motor's share is higher by this, V.
    MotorOffset(f32),
    /// The motor's share increases by this, V/s.
    MotorDrift(f32),
    /// The motor's share has the other sign.
    MotorInverted,
    /// The motor's share keeps its value.
    MotorStuck,
    /// The feedback's share is higher by this, V.
    FeedbackOffset(f32),
    /// The feedback's share has the other sign.
    FeedbackInverted,
    /// The dither's amplitude is not a number.
    DitherNotANumber,
    /// The dither's amplitude is multiplied by this.
    DitherScaled(f32),
    /// The dither's amplitude keeps its value.
    DitherStuck,
}

impl ControllerFailure {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::MotorNotANumber | Self::DitherNotANumber => "command NaN",
            Self::MotorOffset(_) | Self::MotorDrift(_) | Self::MotorInverted | Self::MotorStuck => {
                "motor command wrong"
            }
            Self::FeedbackOffset(_) | Self::FeedbackInverted => "feedback command wrong",
            Self::DitherScaled(_) | Self::DitherStuck => "dither command wrong",
        }
    }
}

impl fmt::Display for ControllerFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::MotorNotANumber => write!(f, "motor's share NaN"),
            Self::MotorOffset(volts) => write!(f, "motor's share {volts:+} V"),
            Self::MotorDrift(volts_per_s) => write!(f, "motor's share {volts_per_s:+} V/s"),
            Self::MotorInverted => write!(f, "motor's share inverted"),
            Self::MotorStuck => write!(f, "motor's share stuck"),
            Self::FeedbackOffset(volts) => write!(f, "feedback's share {volts:+} V"),
            Self::FeedbackInverted => write!(f, "feedback's share inverted"),
            Self::DitherNotANumber => write!(f, "amplitude NaN"),
            Self::DitherScaled(factor) => write!(f, "amplitude times {factor}"),
            Self::DitherStuck => write!(f, "amplitude stuck"),
        }
    }
}

/// The failures of the controller.
pub(super) fn all() -> [ControllerFailure; 15] {
    use ControllerFailure::{
        DitherNotANumber, DitherScaled, DitherStuck, FeedbackInverted, FeedbackOffset, MotorDrift,
        MotorInverted, MotorNotANumber, MotorOffset, MotorStuck,
    };
    [
        MotorNotANumber,
        MotorOffset(1.0),
        MotorOffset(0.002),
        MotorDrift(1.0),
        MotorInverted,
        MotorStuck,
        FeedbackOffset(1.0),
        FeedbackInverted,
        DitherNotANumber,
        DitherScaled(0.0),
        DitherScaled(0.5),
        DitherScaled(0.9),
        DitherScaled(1.1),
        DitherScaled(2.0),
        DitherStuck,
    ]
}
