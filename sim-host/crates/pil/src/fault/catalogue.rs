//! Faults of the loop, as data.

use dynamics::words::counted;
use shared_model::gate::Limits;
use shared_model::listed;
use shared_model::signal::Measurement;
use std::fmt;

listed! {
    /// A signal of the sensor frame.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Signal {
        /// Wheel speed, rpm.
        WheelSpeed => "wheel speed",
        /// Yaw rate, rad/s.
        YawRate => "yaw rate",
        /// Steering angle, rad.
        SteeringAngle => "steering angle",
        /// Steering rate, rad/s.
        SteeringRate => "steering rate",
        /// Driver's current request, A.
        CurrentRequest => "current request",
    }
}

impl Signal {
    /// Its field in a measurement.
    pub fn of(self, measurement: &mut Measurement<f32>) -> &mut f32 {
        match self {
            Self::WheelSpeed => &mut measurement.wheel_speed_rpm,
            Self::YawRate => &mut measurement.yaw_rate_rad_per_s,
            Self::SteeringAngle => &mut measurement.steering_angle_rad,
            Self::SteeringRate => &mut measurement.steering_rate_rad_per_s,
            Self::CurrentRequest => &mut measurement.current_request_a,
        }
    }

    /// Greatest magnitude that the gate accepts, in the signal's unit.
    pub fn range(self, limits: &Limits<f64>) -> f64 {
        match self {
            Self::WheelSpeed => limits.wheel_speed_sensor_rpm,
            Self::YawRate => limits.yaw_rate_rad_per_s,
            Self::SteeringAngle => limits.steering_angle_rad,
            Self::SteeringRate => limits.steering_rate_rad_per_s,
            Self::CurrentRequest => limits.current_request_a,
        }
    }
}

/// Failure of a sensor. Shares are relative to the signal's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorFailure {
    /// Not a number.
    NotANumber,
    /// Infinite.
    Infinite,
    /// A subnormal number.
    Subnormal,
    /// One and a half times its range.
    OutOfRange,
    /// Keeps its last value.
    Stuck,
    /// Steps by this share and keeps that value.
    Step(f32),
    /// Has a constant error of this share.
    Offset(f32),
    /// Has an error that increases by this share per second.
    Drift(f32),
    /// Zero.
    DropOut,
}

/// Failure of a link, for each frame while the fault lasts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkFailure {
    /// This bit is flipped.
    Corruption {
        /// Number of the bit.
        bit: u16,
    },
    /// The last frame before the fault is repeated.
    Repetition,
    /// Frames are lost.
    Loss,
    /// Of each three frames two are lost.
    TwoOfThreeLost,
    /// Frames are late by this number of control ticks.
    Delay {
        /// Control ticks.
        ticks: usize,
    },
    /// Frames are ever later: by one more control tick after each interval of this number.
    GrowingDelay {
        /// Control ticks.
        interval_ticks: usize,
    },
    /// The last frames before the fault in an endless loop.
    Replay {
        /// Number of frames.
        frames: usize,
    },
    /// An old frame replaces the new one.
    Insertion {
        /// Its age, control ticks.
        age_ticks: usize,
    },
    /// A frame of another sender: intact, but with another data ID.
    Masquerade,
    /// Intact frames whose counter is ahead by this.
    WrongSequence {
        /// Counts.
        ahead: u8,
    },
}

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

/// Kind of fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A sensor fails.
    Sensor(Signal, SensorFailure),
    /// Two signals are exchanged.
    Swapped(Signal, Signal),
    /// The link to the ECU fails.
    SensorLink(LinkFailure),
    /// The link to the vehicle fails.
    ActuatorLink(LinkFailure),
    /// The servo fails, and its readback shows it.
    Servo(ServoFailure),
    /// The servo fails after the pin that is read back.
    ServoBehindReadback(ServoFailure),
    /// Interrupts or clock fail.
    Timing(TimingFailure),
}

impl Kind {
    /// Its name without location and extent.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sensor(_, failure) => failure.name(),
            Self::Swapped(..) => "sensors swapped",
            Self::SensorLink(failure) => failure.name(),
            Self::ActuatorLink(failure) => match failure {
                LinkFailure::Corruption { .. } => "actuator frame corrupted",
                LinkFailure::Repetition => "actuator frame repeated",
                LinkFailure::Loss | LinkFailure::TwoOfThreeLost => "actuator frame lost",
                LinkFailure::Delay { .. } | LinkFailure::GrowingDelay { .. } => {
                    "actuator frame late"
                }
                LinkFailure::Replay { .. } => "actuator frames replayed",
                LinkFailure::Insertion { .. } => "actuator frame inserted",
                LinkFailure::Masquerade => "actuator frame masqueraded",
                LinkFailure::WrongSequence { .. } => "actuator frame out of sequence",
            },
            Self::Servo(failure) => failure.name(),
            Self::ServoBehindReadback(_) => "servo, correct readback",
            Self::Timing(failure) => failure.name(),
        }
    }
}

impl SensorFailure {
    fn name(self) -> &'static str {
        match self {
            Self::NotANumber => "sensor NaN",
            Self::Infinite => "sensor infinite",
            Self::Subnormal => "sensor subnormal",
            Self::OutOfRange => "sensor out of range",
            Self::Stuck => "sensor stuck",
            Self::Step(_) => "sensor step",
            Self::Offset(_) => "sensor offset",
            Self::Drift(_) => "sensor drift",
            Self::DropOut => "sensor drop-out",
        }
    }
}

impl LinkFailure {
    fn name(self) -> &'static str {
        match self {
            Self::Corruption { .. } => "sensor frame corrupted",
            Self::Repetition => "sensor frame repeated",
            Self::Loss | Self::TwoOfThreeLost => "sensor frame lost",
            Self::Delay { .. } | Self::GrowingDelay { .. } => "sensor frame late",
            Self::Replay { .. } => "sensor frames replayed",
            Self::Insertion { .. } => "sensor frame inserted",
            Self::Masquerade => "sensor frame masqueraded",
            Self::WrongSequence { .. } => "sensor frame out of sequence",
        }
    }
}

impl ServoFailure {
    fn name(self) -> &'static str {
        match self {
            Self::Stuck => "duty stuck",
            Self::Saturated { .. } => "duty saturated",
            Self::DitherPhase { .. } | Self::DitherInverted => "dither phase",
            Self::DitherFrequency { .. } => "dither frequency",
            Self::Offset { .. } => "duty offset",
        }
    }
}

impl TimingFailure {
    fn name(self) -> &'static str {
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

listed! {
    /// Class of faults, by which the totals are reported.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Class {
        /// Sensor values.
        Sensor => "sensor",
        /// Frames between vehicle and ECU.
        Link => "link",
        /// Interrupts and clock.
        Timing => "timing",
        /// Single bits in the ECU's memory.
        Memory => "memory",
        /// The servo.
        Actuator => "actuator",
        /// The processor itself.
        Processor => "processor",
    }
}

/// A fault and its duration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// Kind of fault.
    pub kind: Kind,
    /// Duration in control ticks; `None` if permanent. The kind of a timing fault gives its
    /// duration.
    pub ticks: Option<u32>,
}

impl Fault {
    /// Its class.
    pub fn class(&self) -> Class {
        match self.kind {
            Kind::Sensor(..) | Kind::Swapped(..) => Class::Sensor,
            Kind::SensorLink(_) | Kind::ActuatorLink(_) => Class::Link,
            Kind::Servo(_) | Kind::ServoBehindReadback(_) => Class::Actuator,
            Kind::Timing(TimingFailure::Reset) => Class::Processor,
            Kind::Timing(_) => Class::Timing,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Kind::Sensor(signal, failure) => write!(f, "{}: {failure}", signal.name()),
            Kind::Swapped(a, b) => write!(f, "{} and {} swapped", a.name(), b.name()),
            Kind::SensorLink(failure) => write!(f, "sensor frame: {failure}"),
            Kind::ActuatorLink(failure) => write!(f, "actuator frame: {failure}"),
            Kind::Servo(failure) => write!(f, "servo: {failure}"),
            Kind::ServoBehindReadback(failure) => {
                write!(f, "servo, correct readback: {failure}")
            }
            Kind::Timing(failure) => write!(f, "{failure}"),
        }?;
        match self.ticks {
            Some(ticks) => write!(f, ", {}", counted(ticks, "tick")),
            None => Ok(()),
        }
    }
}

impl fmt::Display for SensorFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f32| 100.0 * share;
        match *self {
            Self::NotANumber => write!(f, "NaN"),
            Self::Infinite => write!(f, "infinite"),
            Self::Subnormal => write!(f, "subnormal"),
            Self::OutOfRange => write!(f, "out of range"),
            Self::Stuck => write!(f, "stuck"),
            Self::Step(share) => write!(f, "step of {:+} %", percent(share)),
            Self::Offset(share) => write!(f, "offset of {:+} %", percent(share)),
            Self::Drift(share) => write!(f, "drift of {:+} %/s", percent(share)),
            Self::DropOut => write!(f, "drop-out"),
        }
    }
}

impl fmt::Display for LinkFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Corruption { bit } => write!(f, "bit {bit} flipped"),
            Self::Repetition => write!(f, "repeated"),
            Self::Loss => write!(f, "lost"),
            Self::TwoOfThreeLost => write!(f, "two of three lost"),
            Self::Delay { ticks } => write!(f, "late by {ticks}"),
            Self::GrowingDelay { interval_ticks } => {
                write!(
                    f,
                    "later by 1 after each {}",
                    counted(interval_ticks, "tick")
                )
            }
            Self::Replay { frames } => write!(f, "last {frames} in a loop"),
            Self::Insertion { age_ticks } => write!(f, "{} old", counted(age_ticks, "tick")),
            Self::Masquerade => write!(f, "of another sender"),
            Self::WrongSequence { ahead } => write!(f, "counter ahead by {ahead}"),
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

/// All faults between vehicle and ECU and in the ECU's timing.
pub fn all() -> Vec<Fault> {
    let mut faults = sensors();
    faults.extend(links());
    faults.extend(servo());
    faults.extend(timing());
    faults
}

fn lasting(kind: Kind) -> Fault {
    Fault { kind, ticks: None }
}

fn sensors() -> Vec<Fault> {
    use SensorFailure::{
        Drift, DropOut, Infinite, NotANumber, Offset, OutOfRange, Step, Stuck, Subnormal,
    };
    let mut failures = vec![NotANumber, Infinite, Subnormal, OutOfRange, Stuck, DropOut];
    for share in [0.005, 0.02, 0.1, 0.5] {
        for share in [share, -share] {
            failures.extend([Step(share), Offset(share)]);
        }
    }
    failures.extend([Drift(0.01), Drift(-0.01)]);
    let mut faults = Vec::new();
    for signal in Signal::ALL {
        for failure in &failures {
            faults.push(lasting(Kind::Sensor(signal, *failure)));
        }
        for failure in [NotANumber, DropOut, Offset(0.1)] {
            let kind = Kind::Sensor(signal, failure);
            let ticks = Some(1);
            faults.push(Fault { kind, ticks });
        }
    }
    for (k, a) in Signal::ALL.into_iter().enumerate() {
        for b in Signal::ALL.into_iter().skip(k + 1) {
            faults.push(lasting(Kind::Swapped(a, b)));
        }
    }
    faults
}

fn links() -> Vec<Fault> {
    use LinkFailure::{
        Corruption, Delay, GrowingDelay, Insertion, Loss, Masquerade, Repetition, Replay,
        TwoOfThreeLost, WrongSequence,
    };
    let brief = [1, 2, 3].map(Some);
    let mut faults = Vec::new();
    let mut add = |failure, ticks: &[Option<u32>]| {
        for link in [Kind::SensorLink, Kind::ActuatorLink] {
            let kind = link(failure);
            faults.extend(ticks.iter().map(|&ticks| Fault { kind, ticks }));
        }
    };
    for bit in [0, 9, 18, 30, 77, 128, 191] {
        add(Corruption { bit }, &[Some(1)]);
    }
    add(Corruption { bit: 77 }, &[None]);
    add(Repetition, &[Some(1), Some(5), None]);
    add(Loss, &brief);
    add(Loss, &[Some(8), Some(12), None]);
    add(TwoOfThreeLost, &[None]);
    for ticks in [1, 3, 20] {
        add(Delay { ticks }, &[None]);
    }
    add(GrowingDelay { interval_ticks: 8 }, &[None]);
    add(Replay { frames: 256 }, &[None]);
    for age_ticks in [2, 50, 256] {
        add(Insertion { age_ticks }, &[Some(1)]);
    }
    add(Masquerade, &[Some(1), None]);
    for ahead in [3, 100, 255] {
        add(WrongSequence { ahead }, &[Some(1), None]);
    }
    faults
}

fn servo() -> Vec<Fault> {
    use ServoFailure::{DitherFrequency, DitherInverted, DitherPhase, Offset, Saturated, Stuck};
    let failures = [
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
    ];
    let mut faults = Vec::new();
    for failure in failures {
        faults.push(lasting(Kind::Servo(failure)));
        faults.push(lasting(Kind::ServoBehindReadback(failure)));
    }
    faults
}

fn timing() -> Vec<Fault> {
    use TimingFailure::{
        Clock, DoubleControl, DoublePwm, MissedControl, MissedPwm, Overrun, Reset,
    };
    let failures = [
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
    ];
    failures
        .map(|failure| lasting(Kind::Timing(failure)))
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn fault_names_are_unique() {
        let names: Vec<String> = all().iter().map(ToString::to_string).collect();
        let distinct: HashSet<&String> = names.iter().collect();
        assert_eq!(distinct.len(), names.len());
    }
}
