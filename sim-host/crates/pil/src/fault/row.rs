//! A row of the campaign's report: a fault, its verdict and its waiver.

use super::catalogue::Class;
use super::injection::Injection;
use super::judge::{Outcome, Peaks, Verdict};
use super::waivers;
use serde::Serialize;

/// The run into which a fault is injected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting<'a> {
    /// The manoeuvre's name.
    pub manoeuvre: &'a str,
    /// The loop: `SIL` or `PIL`.
    pub in_loop: &'static str,
    /// Time of the injection from the manoeuvre's start, s.
    pub injected_s: f64,
    /// Greatest angles of the fault-free run from the injection on.
    pub fault_free: Peaks,
}

/// A fault and its outcome.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Class of the fault.
    pub class: Class,
    /// Kind of the fault.
    pub kind: &'static str,
    /// The fault.
    pub fault: String,
    /// The manoeuvre.
    pub manoeuvre: String,
    /// The loop: `SIL` or `PIL`.
    #[serde(rename = "loop")]
    pub in_loop: &'static str,
    /// Time of the injection from the manoeuvre's start, s.
    pub injected_s: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// Rationale of the waiver of an undetected fault.
    pub waiver: Option<&'static str>,
    /// The first detector.
    pub detected_by: Option<String>,
    /// Control ticks from the injection to the detection.
    pub latency_ticks: Option<u32>,
    /// Reaction of the ECU.
    pub reaction: &'static str,
    /// Greatest magnitude of the steering angle from the injection on, rad.
    pub steering_angle_rad: f64,
    /// The same in the fault-free run, rad.
    pub fault_free_steering_angle_rad: f64,
    /// Greatest magnitude of the front slip angle from the injection on, rad.
    pub front_slip_angle_rad: f64,
    /// The same in the fault-free run, rad.
    pub fault_free_front_slip_angle_rad: f64,
}

impl Row {
    /// Undetected and without a waiver.
    pub fn is_failure(&self) -> bool {
        self.verdict == Verdict::Undetected && self.waiver.is_none()
    }
}

/// The row of a fault of either catalogue.
pub fn row(injection: &Injection, setting: &Setting<'_>, outcome: &Outcome) -> Row {
    let is_undetected = outcome.verdict == Verdict::Undetected;
    Row {
        class: injection.class(),
        kind: injection.kind(),
        fault: injection.to_string(),
        manoeuvre: setting.manoeuvre.into(),
        in_loop: setting.in_loop,
        injected_s: setting.injected_s,
        verdict: outcome.verdict,
        waiver: waivers::rationale(injection).filter(|_| is_undetected),
        detected_by: outcome.detection.map(|first| first.detector.describe()),
        latency_ticks: outcome.detection.map(|first| first.latency_ticks),
        reaction: outcome.reaction.name(),
        steering_angle_rad: outcome.peaks.steering_angle_rad,
        fault_free_steering_angle_rad: setting.fault_free.steering_angle_rad,
        front_slip_angle_rad: outcome.peaks.front_slip_angle_rad,
        fault_free_front_slip_angle_rad: setting.fault_free.front_slip_angle_rad,
    }
}
