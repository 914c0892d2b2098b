//! The inputs: a feedback, and what is computed of it.

use crate::component::Component;
use crate::sweep::Values;
use shared_model::delayed_feedback::Law;

/// Values of the delay line: 8 s and more, with the spacing of the ECU's.
pub(super) const LINE_VALUES: usize = 412;
/// Longest delay that is analysed, ticks: 8 s at a control rate of 1 kHz.
pub const LONGEST_TICKS: usize = 8192;

/// A feedback: which signal, how strong, how late.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Feedback {
    /// The signal that is fed back.
    pub component: Component,
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

impl Feedback {
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
