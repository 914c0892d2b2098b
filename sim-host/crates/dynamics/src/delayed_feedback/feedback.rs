//! The inputs: a feedback, and what is computed of it.

use crate::component::{Component, UnknownComponent};
use crate::sweep::Values;
use nalgebra::Vector4;
use shared_model::delayed_feedback::Law;
use std::str::FromStr;

/// Values of the delay line: 8 s and more, with the spacing of the ECU's.
pub(super) const LINE_VALUES: usize = 412;
/// Longest delay that is analysed, ticks: 8 s at a control rate of 1 kHz.
pub const LONGEST_TICKS: usize = 8192;

/// Greatest weight of a second signal.
const GREATEST_WEIGHT: f64 = 1e6;

/// A feedback: which signal, how strong, how late.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Feedback {
    /// The signal that is fed back.
    pub component: Component,
    /// What is added to it.
    pub mixed: Option<Mixed>,
    /// Torque per difference of the signal, N m s/rad for rates and N m/rad for angles.
    pub gain: f64,
    /// Delay, s; without torque if it has more ticks than the line.
    pub delay_s: f64,
    /// Weight of a period relative to the one after it, 0 to less than 1.
    pub memory: f64,
    /// Greatest torque either way, about the steering axis, N m.
    pub limit_nm: f64,
    /// Rate at which the delay adapts, ticks per square of the signal's unit ([`Law::adaptation`]); 0 for a delay
    /// that stays.
    pub adaptation: f64,
    /// Ticks from the measurement to the torque, beside the one in which it is computed.
    pub latency_ticks: usize,
}

/// A second signal in a feedback.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Mixed {
    /// The signal.
    pub component: Component,
    /// Its weight, in units of the first signal per its own.
    pub weight: f64,
}

impl FromStr for Mixed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("{text:?}: must be COMPONENT=WEIGHT, as in steering_rate=-0.5");
        let (component, weight) = text.split_once('=').ok_or_else(form)?;
        let component = component
            .parse()
            .map_err(|error: UnknownComponent| error.to_string())?;
        let weight: f64 = weight.parse().map_err(|_| form())?;
        if weight.abs() > GREATEST_WEIGHT || weight.is_nan() {
            return Err(format!(
                "weight {weight}: must be from -{GREATEST_WEIGHT} to {GREATEST_WEIGHT}"
            ));
        }
        Ok(Self { component, weight })
    }
}

impl Feedback {
    /// The signal of a state, or of a difference of states.
    pub(super) fn signal(&self, x: &Vector4<f64>) -> f64 {
        let mixed = self
            .mixed
            .map(|mixed| mixed.weight * x[mixed.component.index]);
        x[self.component.index] + mixed.unwrap_or(0.0)
    }

    pub(super) fn law(&self) -> Law<f64> {
        Law {
            memory: self.memory,
            limit_nm: self.limit_nm,
            adaptation: self.adaptation,
        }
    }
}

/// The conditions of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Conditions {
    /// Time before the feedback is switched on, s.
    pub free_s: f64,
    /// Time with it, s.
    pub time_s: f64,
    /// Standard deviation of the sensor's noise, in the signal's unit.
    pub noise: f64,
}

/// What is to be computed: the gains tried, and the lengths of the simulation without and with feedback.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// The feedback; its gain and its delay are chosen for each speed.
    pub feedback: Feedback,
    /// The gains tried.
    pub gains: Values,
    /// Error of the delay in the simulation, s.
    pub delay_error_s: f64,
    /// The conditions of the simulation.
    pub conditions: Conditions,
}
