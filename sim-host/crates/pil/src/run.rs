//! A manoeuvre driven to its end, and two such runs compared.

use super::drive::Drive;
use super::ecu::Ecu;
use super::record::Record;
use qemu::RunError;
use shared_model::exchange::Packet;
use shared_model::frame::decode_actuation;
use shared_model::signal::Actuation;

/// What passed in one PWM period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exchange {
    /// Duty and actuator frame.
    pub from_ecu: Packet,
    /// Captured duty and sensor frame.
    pub to_ecu: Packet,
}

/// A manoeuvre as it was driven.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// One a PWM period, the lead-in included.
    pub exchanges: Vec<Exchange>,
    /// The vehicle, one a control tick of the manoeuvre itself.
    pub records: Vec<Record>,
    /// What the ECU had last told at each of those; `None` before its first frame.
    pub actuations: Vec<Option<Actuation<f32>>>,
}

/// Drives to the manoeuvre's end; `on_period` is called behind each PWM period.
///
/// # Errors
/// If the ECU cannot be reached, or the user asks to stop.
pub fn run(
    ecu: &mut dyn Ecu,
    mut drive: Drive,
    mut on_period: impl FnMut(),
) -> Result<Run, RunError> {
    let mut run = Run::default();
    for _ in 0..drive.total_periods() {
        ecu.period(&mut |from_ecu| {
            let to_ecu = drive.answer(from_ecu);
            run.exchanges.push(Exchange {
                from_ecu: *from_ecu,
                to_ecu,
            });
            to_ecu
        })?;
        let is_tick = run
            .exchanges
            .last()
            .is_some_and(|last| last.to_ecu.frame.is_some());
        if is_tick && drive.has_begun() {
            run.records.push(drive.record());
            run.actuations.push(drive.actuation().copied());
        }
        on_period();
        if interrupt::requested() {
            return Err(RunError::Interrupted);
        }
    }
    Ok(run)
}

/// How far two runs agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Comparison {
    /// Duty codes that were compared.
    pub duties: usize,
    /// Duty codes that differ.
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

impl Comparison {
    /// Nothing differs, and nothing is missing.
    pub fn is_equal(&self) -> bool {
        self.first.is_none() && self.unmatched == 0
    }
}

/// Which bytes of a frame are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// All.
    Bytes,
    /// Mode, faults, voltages and speed limit: for an ECU that checks no frames and so has no warnings.
    Commands,
}

/// Compares what the ECU put out in two runs, period by period.
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
        let duty_differs = a.duty_code != b.duty_code;
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
        ))
    };
    match depth {
        Depth::Bytes => a.frame == b.frame,
        Depth::Commands => commands(a) == commands(b),
    }
}
