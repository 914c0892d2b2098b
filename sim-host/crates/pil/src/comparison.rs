//! Comparison of two runs: duties and actuator frames, period by period.

use super::closed_loop::Exchange;
use shared_model::exchange::Packet;
use shared_model::frame::decode_actuation;
use std::fmt;

/// Differences between two runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Comparison {
    /// Duty codes that were compared.
    pub duties: usize,
    /// Duty codes that differ, or states of the bridge.
    pub different_duties: usize,
    /// Actuator frames that were compared.
    pub frames: usize,
    /// Actuator frames that differ.
    pub different_frames: usize,
    /// The first PWM period in which something differs.
    pub first: Option<usize>,
    /// PWM periods that only one of the runs has.
    pub unmatched: usize,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let different = self.different_duties + self.different_frames;
        f.pad(&match self.first {
            _ if self.is_equal() => "equal".into(),
            Some(period) => format!("{different} from {period}"),
            None => format!("{} missing", self.unmatched),
        })
    }
}

impl Comparison {
    /// No difference, and no missing period.
    pub fn is_equal(&self) -> bool {
        self.first.is_none() && self.unmatched == 0
    }
}

/// The bytes of a frame that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// All.
    Bytes,
    /// Mode, faults, voltages, speed limit and bridge: for an ECU without the end-to-end check, which
    /// has other warnings.
    Commands,
}

/// Compares the ECU's packets of two runs, period by period.
pub fn compare(a: &[Exchange], b: &[Exchange], depth: Depth) -> Comparison {
    let mut result = Comparison {
        duties: 0,
        different_duties: 0,
        frames: 0,
        different_frames: 0,
        first: None,
        unmatched: a.len().abs_diff(b.len()),
    };
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        let (a, b) = (&a.from_ecu, &b.from_ecu);
        let duty_differs = (a.duty_code, a.bridge_on) != (b.duty_code, b.bridge_on);
        let frame_differs = !same_frame(a, b, depth);
        result.duties += 1;
        result.different_duties += usize::from(duty_differs);
        result.frames += usize::from(a.frame.is_some() || b.frame.is_some());
        result.different_frames += usize::from(frame_differs);
        if (duty_differs || frame_differs) && result.first.is_none() {
            result.first = Some(k);
        }
    }
    result
}

fn same_frame(a: &Packet, b: &Packet, depth: Depth) -> bool {
    let commands = |packet: &Packet| {
        let actuation = decode_actuation(packet.frame.as_ref()?).ok()?;
        Some((
            actuation.mode,
            actuation.faults,
            actuation.motor_voltage_v.to_bits(),
            actuation.dither_amplitude_v.to_bits(),
            actuation.wheel_speed_limit_rpm.to_bits(),
            actuation.bridge_on,
        ))
    };
    match depth {
        Depth::Bytes => a.frame == b.frame,
        Depth::Commands => commands(a) == commands(b),
    }
}
