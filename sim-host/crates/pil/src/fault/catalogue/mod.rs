//! Faults of the loop, as data.

mod controller;
mod link;
mod sensor;
mod servo;
mod timing;

pub use controller::ControllerFailure;
pub use link::LinkFailure;
pub use sensor::{SensorFailure, Signal};
pub use servo::ServoFailure;
pub use timing::TimingFailure;

use dynamics::words::counted;
use shared_model::listed;
use std::fmt;

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
    /// The ECU's controller fails, ahead of the gate.
    Controller(ControllerFailure),
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
            Self::Controller(failure) => failure.name(),
            Self::Timing(failure) => failure.name(),
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
        /// The controller's commands, ahead of the gate.
        Controller => "controller",
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
            Kind::Controller(_) => Class::Controller,
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
            Kind::Controller(failure) => write!(f, "controller: {failure}"),
            Kind::Timing(failure) => write!(f, "{failure}"),
        }?;
        match self.ticks {
            Some(ticks) => write!(f, ", {}", counted(ticks, "tick")),
            None => Ok(()),
        }
    }
}

/// All faults between vehicle and ECU, of the controller, and in the ECU's timing.
pub fn all() -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut add = |kind, ticks| faults.push(Fault { kind, ticks });
    for signal in Signal::ALL {
        for (failure, ticks) in sensor::all() {
            add(Kind::Sensor(signal, failure), ticks);
        }
    }
    for (k, a) in Signal::ALL.into_iter().enumerate() {
        for b in Signal::ALL.into_iter().skip(k + 1) {
            add(Kind::Swapped(a, b), None);
        }
    }
    for (failure, ticks) in link::all() {
        add(Kind::SensorLink(failure), ticks);
        add(Kind::ActuatorLink(failure), ticks);
    }
    for failure in servo::all() {
        add(Kind::Servo(failure), None);
        add(Kind::ServoBehindReadback(failure), None);
    }
    for failure in controller::all() {
        add(Kind::Controller(failure), None);
    }
    for failure in timing::all() {
        add(Kind::Timing(failure), None);
    }
    faults
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
