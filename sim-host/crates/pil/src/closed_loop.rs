//! A manoeuvre in closed loop, from start to end.

use super::ecu::Ecu;
use super::record::Record;
use super::vehicle_node::VehicleNode;
use qemu::RunError;
use shared_model::exchange::Packet;
use shared_model::signal::Actuation;

/// The exchange of one PWM period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exchange {
    /// Duty and actuator frame.
    pub from_ecu: Packet,
    /// Captured duty and sensor frame.
    pub to_ecu: Packet,
}

/// A completed run.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// One per PWM period, including the lead-in.
    pub exchanges: Vec<Exchange>,
    /// The vehicle, one per control tick, without the lead-in.
    pub records: Vec<Record>,
    /// The ECU's last actuator frame at each record; `None` before its first frame.
    pub actuations: Vec<Option<Actuation<f32>>>,
}

/// Runs the loop to the manoeuvre's end. `on_period` is called after each PWM period.
///
/// # Errors
/// If the ECU does not answer, or the user interrupts the run.
pub fn run(
    ecu: &mut dyn Ecu,
    mut vehicle: VehicleNode,
    on_period: &mut dyn FnMut(),
) -> Result<Run, RunError> {
    let mut run = Run::default();
    for _ in 0..vehicle.total_periods() {
        ecu.period(&mut |from_ecu| {
            let to_ecu = vehicle.answer(from_ecu);
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
        if is_tick && vehicle.has_begun() {
            run.records.push(vehicle.record());
            run.actuations.push(vehicle.actuation().copied());
        }
        on_period();
        if interrupt::requested() {
            return Err(RunError::Interrupted);
        }
    }
    Ok(run)
}
