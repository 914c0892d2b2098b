//! A loop with the firmware, run repeatedly with one fault each.

use super::addresses::Addresses;
use super::debugger::Debugger;
use crate::fault::catalogue::Fault;
use crate::fault::injection::Injection;
use crate::fault::injector::Injector;
use crate::fault::judge::{Judge, Outcome, Peaks};
use crate::fault::processor_fault::{Action, ProcessorFault};
use crate::fault::row::{Row, Setting, row};
use crate::fault::tasks::Tasks;
use crate::manoeuvre::Manoeuvre;
use crate::mil_sil_pil::{LoopError, Target};
use crate::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::RunError;
use qemu::session::Session;
use qemu::settings;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::exchange::{Packet, ToEcu};
use std::path::Path;
use std::thread;

/// Placeholder for the exit code of an emulator that a signal ended, as at a lockup of the core.
const NO_EXIT_CODE: i32 = -1;
/// Wheel speed of the bench, rpm, the driver's request, A, and the run's length, s.
const BENCH_RPM: f64 = 1750.0;
const BENCH_REQUEST_A: f64 = 0.1;
const BENCH_S: f64 = 0.15;
/// Ramp time of its dither, s.
const BENCH_RAMP_S: f64 = 0.02;
/// Control ticks of the bench in which its vehicle moves and its dither is on.
pub const BENCH_TICKS: std::ops::Range<u32> = 55..85;

/// A loop with the firmware, for repeated runs.
#[derive(Debug, Clone)]
pub struct Bench {
    target: Target,
    scenario: Scenario<f64>,
    ecu: Scenario<f32>,
    vehicle: VehicleNode,
    /// Packets from the ECU's program on the host without a fault.
    fault_free: Vec<Packet>,
    addresses: Addresses,
}

/// A run with a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct FaultyRun {
    /// The outcome of the fault.
    pub outcome: Outcome,
    /// Packets from the ECU, one per PWM period.
    pub packets: Vec<Packet>,
}

impl Bench {
    /// The target's firmware on a manoeuvre.
    ///
    /// # Errors
    /// If the scenario or the manoeuvre is invalid, or the image lacks a symbol.
    pub fn new(
        target: &Target,
        scenario: &Scenario<f64>,
        manoeuvre: &Manoeuvre,
    ) -> Result<Self, LoopError> {
        let vehicle = VehicleNode::new(scenario, manoeuvre)?;
        let ecu = ecu_scenario(scenario, manoeuvre);
        let mut tasks = Tasks::new(&ecu)?;
        let mut on_host = vehicle.clone();
        let mut fault_free = Vec::new();
        for _ in 0..vehicle.total_periods() {
            tasks.period(&mut |from_ecu| {
                fault_free.push(*from_ecu);
                on_host.answer(from_ecu)
            });
        }
        Ok(Self {
            target: target.clone(),
            scenario: *scenario,
            ecu,
            vehicle,
            fault_free,
            addresses: Addresses::of(target)?,
        })
    }

    /// A short manoeuvre whose dither is on after about 50 control ticks. Up to the fault the core
    /// is stopped at each tick.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn short(target: &Target) -> Result<Self, LoopError> {
        let mut scenario = Scenario::reconstruction();
        scenario.run.duration_s = BENCH_S;
        scenario.dither.waveform = Waveform::Square;
        scenario.dither.start_time_s = 0.0;
        scenario.controller.dither_ramp_s = BENCH_RAMP_S;
        Self::new(
            target,
            &scenario,
            &Manoeuvre::constant(BENCH_RPM, BENCH_REQUEST_A),
        )
    }

    /// Packets from the ECU without a fault, one per PWM period.
    pub fn fault_free(&self) -> &[Packet] {
        &self.fault_free
    }

    /// Runs with a fault at a control tick, from 1.
    ///
    /// # Errors
    /// If the emulator cannot be run or controlled.
    pub fn run(&self, action: Action, tick: u32) -> Result<FaultyRun, RunError> {
        let sockets = tempfile::tempdir().map_err(RunError::NotStarted)?;
        let (gdb, qmp) = (sockets.path().join("gdb"), sockets.path().join("qmp"));
        let listen = |path: &Path| format!("unix:{},server=on,wait=off", path.display());
        let (at_gdb, at_qmp) = (listen(&gdb), listen(&qmp));
        let time_out = self.target.time_out;
        thread::scope(|scope| {
            let debugger = Debugger {
                gdb: &gdb,
                qmp: &qmp,
                addresses: self.addresses,
                time_out,
            };
            let done = scope.spawn(move || debugger.act(action, tick));
            let mut session = Session::start(
                &self.target.image,
                self.target.machine,
                &settings::of(&self.ecu),
                self.target.link,
                &["-S", "-gdb", &at_gdb, "-qmp", &at_qmp],
                time_out,
            )?;
            let run = self.observe(tick, |answer| exchange(&mut session, answer));
            // Ends the emulator, and with it the debugger's connection.
            drop(session);
            // The socket closes with the emulator, so this thread ends too.
            let done = done.join().expect("the debugger does not panic");
            let run = run?;
            // If the firmware has ended, the stub may have closed before its last answer.
            if run.packets.len() == self.fault_free.len() {
                done?;
            }
            Ok(run)
        })
    }

    fn observe(
        &self,
        tick: u32,
        period: impl FnMut(&mut dyn FnMut(&Packet) -> Packet) -> Result<Packet, RunError>,
    ) -> Result<FaultyRun, RunError> {
        let periods_per_tick = self.scenario.periods_per_tick();
        let judge = Judge::new(periods_per_tick, tick);
        observe(
            &self.fault_free,
            self.vehicle.clone(),
            judge,
            tick * periods_per_tick,
            period,
        )
    }

    /// The greatest angles of the fault-free run from a tick on.
    fn fault_free_peaks(&self, tick: u32) -> Peaks {
        let mut vehicle = self.vehicle.clone();
        let mut peaks = Peaks::default();
        for packet in &self.fault_free {
            vehicle.answer(packet);
            if vehicle.periods() > tick * self.scenario.periods_per_tick() {
                peaks = peaks.or(Peaks::of(&vehicle));
            }
        }
        peaks
    }

    /// Runs with a fault, and reports it as a row.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn inject(&self, fault: ProcessorFault) -> Result<Row, RunError> {
        let outcome = self.run(fault.action, fault.tick)?.outcome;
        let tick_s = 1.0 / self.scenario.run.control_rate_hz;
        let lead_in = self.vehicle.total_periods() - self.vehicle.plant().total_periods();
        let lead_in_ticks = lead_in / self.scenario.periods_per_tick();
        let setting = Setting {
            manoeuvre: "on the processor",
            in_loop: "PIL",
            injected_s: f64::from(fault.tick.saturating_sub(lead_in_ticks)) * tick_s,
            fault_free: self.fault_free_peaks(fault.tick),
        };
        Ok(row(&Injection::Processor(fault), &setting, &outcome))
    }

    /// Injects a fault between vehicle and ECU into the ECU's program on the host and into the
    /// firmware. Returns the packets of each, one per PWM period.
    ///
    /// # Errors
    /// If the emulator cannot be run.
    pub fn both(&self, fault: Fault, tick: u32) -> Result<[Vec<Packet>; 2], LoopError> {
        let software = {
            let mut tasks = Tasks::new(&self.ecu)?;
            self.through(fault, tick, |answer| {
                tasks.period(answer);
                Ok(())
            })?
        };
        let target = &self.target;
        let mut session = Session::start(
            &target.image,
            target.machine,
            &settings::of(&self.ecu),
            target.link,
            &[],
            target.time_out,
        )?;
        let processor = self.through(fault, tick, |answer| {
            exchange(&mut session, answer).map(drop)
        })?;
        Ok([software, processor])
    }

    fn through(
        &self,
        fault: Fault,
        tick: u32,
        mut period: impl FnMut(&mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError>,
    ) -> Result<Vec<Packet>, RunError> {
        let mut vehicle = self.vehicle.clone();
        let mut injector = Injector::new(&self.scenario);
        let mut packets = Vec::with_capacity(self.fault_free.len());
        for _ in &self.fault_free {
            if vehicle.periods() == tick * self.scenario.periods_per_tick() {
                injector.begin(fault);
            }
            period(&mut |from_ecu| {
                packets.push(*from_ecu);
                vehicle.answer_through(&mut injector, from_ecu)
            })?;
        }
        Ok(packets)
    }
}

/// Runs a loop whose ECU may end or stop sending, and observes it after the PWM period `from`.
fn observe(
    fault_free: &[Packet],
    mut vehicle: VehicleNode,
    mut judge: Judge,
    from: u32,
    mut period: impl FnMut(&mut dyn FnMut(&Packet) -> Packet) -> Result<Packet, RunError>,
) -> Result<FaultyRun, RunError> {
    let mut packets = Vec::with_capacity(fault_free.len());
    for fault_free in fault_free {
        match period(&mut |from_ecu| vehicle.answer(from_ecu)) {
            Ok(from_ecu) => {
                packets.push(from_ecu);
                if vehicle.periods() > from {
                    judge.observe(&from_ecu, fault_free, &vehicle);
                }
            }
            Err(RunError::LinkLost { exit_code, .. }) => {
                judge.ended(exit_code.unwrap_or(NO_EXIT_CODE), &vehicle);
                break;
            }
            // Also within a packet: the rest of it does not come.
            Err(RunError::TimedOut { .. }) => {
                judge.timed_out(&vehicle);
                break;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(FaultyRun {
        outcome: judge.outcome(false),
        packets,
    })
}

fn exchange(
    session: &mut Session,
    answer: &mut dyn FnMut(&Packet) -> Packet,
) -> Result<Packet, RunError> {
    let received = session.receive()?;
    let packet = answer(&received.packet);
    session.send(&ToEcu {
        packet,
        stop: false,
    })?;
    Ok(received.packet)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::judge::{Detector, Reaction, Verdict};
    use shared_model::e2e::Status;
    use std::time::Duration;

    const TICK: u32 = BENCH_TICKS.start;

    /// The outcome if the ECU's packet of one PWM period does not come, or only its first part.
    fn outcome_without_packet(period: u32) -> Outcome {
        let mut scenario = Scenario::reconstruction();
        scenario.run.duration_s = BENCH_S;
        let manoeuvre = Manoeuvre::constant(BENCH_RPM, BENCH_REQUEST_A);
        let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
        let ecu = ecu_scenario(&scenario, &manoeuvre);
        let mut on_host = vehicle.clone();
        let mut tasks = Tasks::new(&ecu).expect("it is valid");
        let mut fault_free = Vec::new();
        for _ in 0..vehicle.total_periods() {
            tasks.period(&mut |from_ecu| {
                fault_free.push(*from_ecu);
                on_host.answer(from_ecu)
            });
        }
        let judge = Judge::new(scenario.periods_per_tick(), TICK);
        let mut tasks = Tasks::new(&ecu).expect("it is valid");
        let mut periods = 0;
        let run = observe(
            &fault_free,
            vehicle,
            judge,
            TICK * scenario.periods_per_tick(),
            |answer| {
                periods += 1;
                if periods == period {
                    // As the session reports a packet whose rest does not come.
                    return Err(RunError::TimedOut {
                        limit: Duration::from_secs(1),
                        last_line: String::new(),
                    });
                }
                let mut sent = None;
                tasks.period(&mut |from_ecu| {
                    sent = Some(*from_ecu);
                    answer(from_ecu)
                });
                Ok(sent.expect("a duty in every period"))
            },
        );
        run.expect("a lost link is an outcome").outcome
    }

    #[test]
    fn an_ecu_that_stops_within_a_packet_is_detected() {
        for (period, latency_ticks) in
            [(10 * TICK + 1, 1), (10 * TICK + 10, 1), (10 * TICK + 11, 2)]
        {
            let outcome = outcome_without_packet(period);
            assert_eq!(outcome.verdict, Verdict::Detected, "period {period}");
            assert_eq!(outcome.reaction, Reaction::LinkLost);
            let detection = outcome.detection.expect("it was detected");
            assert_eq!(detection.detector, Detector::Vehicle(Status::NoNewData));
            assert_eq!(detection.latency_ticks, latency_ticks, "period {period}");
        }
    }
}
