//! Failures of the ECU's interrupts and clock.

use dynamics::words::counted;
use std::fmt;

/// Failure of the ECU's interrupts or its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimingFailure {
    /// This number of consecutive PWM interrupts is missed.
    MissedPwm(u32),
    /// This number of consecutive PWM interrupts is executed twice.
    DoublePwm(u32),
    /// The control interrupt is missed.
    MissedControl,
    /// The control interrupt is executed twice.
    DoubleControl,
    /// The control task finishes late by this number of PWM periods.
    Overrun(u32),
    /// The independent clock runs at this ratio of its rate.
    Clock(f64),
    /// The processor restarts.
    Reset,
}

impl TimingFailure {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::MissedPwm(_) => "PWM interrupt missed",
            Self::DoublePwm(_) => "PWM interrupt doubled",
            Self::MissedControl => "control interrupt missed",
            Self::DoubleControl => "control interrupt doubled",
            Self::Overrun(_) => "control task late",
            Self::Clock(_) => "clock",
            Self::Reset => "reset",
        }
    }
}

impl fmt::Display for TimingFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::MissedPwm(count) => write!(f, "PWM interrupt missed {}", counted(count, "time")),
            Self::DoublePwm(count) => write!(f, "PWM interrupt doubled {}", counted(count, "time")),
            Self::MissedControl => write!(f, "control interrupt missed"),
            Self::DoubleControl => write!(f, "control interrupt doubled"),
            Self::Overrun(periods) => write!(f, "control late by {}", counted(periods, "period")),
            Self::Clock(ratio) => write!(f, "clock at {ratio} of its rate"),
            Self::Reset => write!(f, "reset"),
        }
    }
}

/// The failures of interrupts and clock.
pub(super) fn all() -> [TimingFailure; 18] {
    use TimingFailure::{
        Clock, DoubleControl, DoublePwm, MissedControl, MissedPwm, Overrun, Reset,
    };
    [
        MissedPwm(1),
        MissedPwm(2),
        MissedPwm(3),
        MissedPwm(10),
        DoublePwm(1),
        DoublePwm(2),
        DoublePwm(3),
        DoublePwm(10),
        MissedControl,
        DoubleControl,
        Overrun(5),
        Overrun(15),
        Clock(0.0),
        Clock(0.5),
        Clock(0.9),
        Clock(1.1),
        Clock(1.5),
        Reset,
    ]
}
