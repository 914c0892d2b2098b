//! Faults in manoeuvres with the ECU's program on the host, many runs in parallel.

use super::catalogue::{Fault, Kind};
use super::injection::Injection;
use super::injector::Injector;
use super::judge::{Judge, Outcome, Peaks};
use super::row::{Row, Setting, row};
use super::tasks::Tasks;
use crate::manoeuvre::Manoeuvre;
use crate::mil_sil_pil::LoopError;
use crate::vehicle_node::{VehicleNode, ecu_scenario};
use qemu::RunError;
use rayon::prelude::*;
use shared_model::Scenario;
use shared_model::exchange::Packet;

/// Time from the injection to the end of a run, s.
pub const OBSERVED_S: f64 = 5.0;

/// A loop in the middle of a manoeuvre.
#[derive(Debug, Clone)]
struct Loop {
    ecu: Tasks,
    vehicle: VehicleNode,
    injector: Injector,
}

impl Loop {
    fn period(&mut self) -> Packet {
        let Self {
            ecu,
            vehicle,
            injector,
        } = self;
        let mut sent = None;
        ecu.period(&mut |from_ecu| {
            sent = Some(*from_ecu);
            vehicle.answer_through(injector, from_ecu)
        });
        sent.expect("the ECU sends a duty in every period")
    }
}

/// A manoeuvre without a fault, with the loop saved at the times of injection.
#[derive(Debug, Clone)]
pub struct FaultFree {
    /// The manoeuvre's name.
    pub name: String,
    pwm_rate_hz: f64,
    periods_per_tick: u32,
    lead_in_periods: u32,
    /// Packets from the ECU, one per PWM period.
    packets: Vec<Packet>,
    /// Angles of the vehicle, one per control tick.
    peaks: Vec<Peaks>,
    /// The loop at the times of injection.
    saved: Vec<Loop>,
}

impl FaultFree {
    /// Runs the manoeuvre to its end. Faults will be injected at `times_s` from its start; times
    /// after its end are ignored.
    ///
    /// # Errors
    /// If the scenario or the manoeuvre is invalid.
    pub fn run(
        scenario: &Scenario<f64>,
        manoeuvre: &Manoeuvre,
        times_s: &[f64],
    ) -> Result<Self, LoopError> {
        let vehicle = VehicleNode::new(scenario, manoeuvre)?;
        let total = vehicle.total_periods();
        let mut fault_free = Self {
            name: manoeuvre.name.clone(),
            pwm_rate_hz: scenario.run.pwm_rate_hz,
            periods_per_tick: scenario.periods_per_tick(),
            lead_in_periods: total - vehicle.plant().total_periods(),
            packets: Vec::with_capacity(total as usize),
            peaks: Vec::new(),
            saved: Vec::new(),
        };
        let injections: Vec<u32> = times_s
            .iter()
            .map(|time_s| fault_free.period_of(*time_s))
            .collect();
        let mut now = Loop {
            ecu: Tasks::new(&ecu_scenario(scenario, manoeuvre))?,
            vehicle,
            injector: Injector::new(scenario),
        };
        for period in 0..total {
            if injections.contains(&period) {
                fault_free.saved.push(now.clone());
            }
            fault_free.packets.push(now.period());
            let periods = now.vehicle.periods();
            if periods.is_multiple_of(fault_free.periods_per_tick) {
                fault_free.peaks.push(Peaks::of(&now.vehicle));
            }
        }
        Ok(fault_free)
    }

    /// The PWM period, directly after a control tick, at that time from the manoeuvre's start.
    fn period_of(&self, time_s: f64) -> u32 {
        let tick_s = f64::from(self.periods_per_tick) / self.pwm_rate_hz;
        self.lead_in_periods + (time_s / tick_s).round() as u32 * self.periods_per_tick
    }

    fn end_of(&self, from: u32) -> u32 {
        let observed = (OBSERVED_S * self.pwm_rate_hz) as u32;
        (from + observed).min(self.packets.len() as u32)
    }

    /// Continues from a saved loop with a fault.
    fn inject(&self, saved: &Loop, fault: Fault) -> Outcome {
        let mut now = saved.clone();
        let from = now.vehicle.periods();
        let mut judge = Judge::new(self.periods_per_tick, from / self.periods_per_tick);
        match fault.kind {
            Kind::Timing(failure) => now.ecu.fail(failure),
            Kind::Controller(failure) => now.ecu.fail_controller(failure),
            _ => now.injector.begin(fault),
        }
        let to = self.end_of(from);
        for fault_free in &self.packets[from as usize..to as usize] {
            let from_ecu = now.period();
            judge.observe(&from_ecu, fault_free, &now.vehicle);
        }
        judge.outcome(now.injector.is_value_corrupted())
    }

    /// The run into which a fault is injected at a saved loop.
    fn setting(&self, saved: &Loop) -> Setting<'_> {
        let from = saved.vehicle.periods();
        let ticks = |period: u32| (period / self.periods_per_tick) as usize;
        let observed = &self.peaks[ticks(from)..ticks(self.end_of(from))];
        Setting {
            manoeuvre: &self.name,
            in_loop: "SIL",
            injected_s: saved.vehicle.plant().time_s(),
            fault_free: observed.iter().copied().fold(Peaks::default(), Peaks::or),
        }
    }
}

/// Injects every fault at every time of every manoeuvre, in parallel. `on_run` is called after each
/// run.
///
/// # Errors
/// If the user interrupts the campaign.
pub fn inject(
    manoeuvres: &[FaultFree],
    faults: &[Fault],
    on_run: &(dyn Fn() + Sync),
) -> Result<Vec<Row>, RunError> {
    let saved = manoeuvres.iter().flat_map(|fault_free| {
        fault_free
            .saved
            .iter()
            .map(move |saved| (fault_free, saved))
    });
    let jobs: Vec<_> = saved
        .flat_map(|(fault_free, saved)| faults.iter().map(move |fault| (fault_free, saved, *fault)))
        .collect();
    jobs.into_par_iter()
        .map(|(fault_free, saved, fault)| {
            if interrupt::requested() {
                return Err(RunError::Interrupted);
            }
            let outcome = fault_free.inject(saved, fault);
            on_run();
            let setting = fault_free.setting(saved);
            Ok(row(&Injection::Loop(fault), &setting, &outcome))
        })
        .collect()
}

/// The number of runs of [`inject`].
pub fn runs(manoeuvres: &[FaultFree], faults: &[Fault]) -> usize {
    let saved: usize = manoeuvres.iter().map(|run| run.saved.len()).sum();
    saved * faults.len()
}
