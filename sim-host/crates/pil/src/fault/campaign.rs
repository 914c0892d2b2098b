//! Faults on manoeuvres, many at a time, each judged against the manoeuvre's clean run.

use super::accepted;
use super::catalogue::{Class, Fault, Kind};
use super::injector::Injector;
use super::judge::{Judge, Outcome, Peaks, Verdict};
use super::tasks::Tasks;
use crate::drive::{Drive, ecu_scenario};
use crate::levels::LevelError;
use crate::manoeuvre::Manoeuvre;
use qemu::RunError;
use rayon::prelude::*;
use serde::Serialize;
use shared_model::Scenario;
use shared_model::exchange::Packet;
use std::collections::BTreeMap;

/// Time for which a run goes on behind its injection, s.
pub const WATCHED_S: f64 = 5.0;

/// A loop in the middle of a manoeuvre.
#[derive(Debug, Clone)]
struct Loop {
    ecu: Tasks,
    drive: Drive,
    between: Injector,
}

impl Loop {
    fn period(&mut self) -> Packet {
        let Self {
            ecu,
            drive,
            between,
        } = self;
        let mut put_out = None;
        ecu.period(&mut |from_ecu| {
            put_out = Some(*from_ecu);
            drive.answer_through(between, from_ecu)
        });
        put_out.expect("the ECU puts out a duty in every period")
    }
}

/// A manoeuvre as it goes without a fault, to be gone on with from several moments.
#[derive(Debug, Clone)]
pub struct Clean {
    /// The manoeuvre's name.
    pub name: String,
    pwm_rate_hz: f64,
    periods_a_tick: u32,
    lead_in_periods: u32,
    /// What the ECU puts out, one a PWM period.
    packets: Vec<Packet>,
    /// The vehicle, one a control tick.
    peaks: Vec<Peaks>,
    /// The loop at the moments of injection.
    moments: Vec<Loop>,
}

impl Clean {
    /// Drives the manoeuvre to its end. Faults will be injected at `times_s` from its start; those behind its end are left out.
    ///
    /// # Errors
    /// If scenario or manoeuvre are not valid.
    pub fn drive(
        scenario: &Scenario<f64>,
        manoeuvre: &Manoeuvre,
        times_s: &[f64],
    ) -> Result<Self, LevelError> {
        let drive = Drive::new(scenario, manoeuvre)?;
        let total = drive.total_periods();
        let mut clean = Self {
            name: manoeuvre.name.clone(),
            pwm_rate_hz: scenario.run.pwm_rate_hz,
            periods_a_tick: scenario.periods_per_tick(),
            lead_in_periods: total - drive.plant().total_periods(),
            packets: Vec::with_capacity(total as usize),
            peaks: Vec::new(),
            moments: Vec::new(),
        };
        let moments: Vec<u32> = times_s
            .iter()
            .map(|time_s| clean.period_of(*time_s))
            .collect();
        let mut now = Loop {
            ecu: Tasks::new(&ecu_scenario(scenario, manoeuvre))?,
            drive,
            between: Injector::new(scenario),
        };
        for period in 0..total {
            if moments.contains(&period) {
                clean.moments.push(now.clone());
            }
            clean.packets.push(now.period());
            if now.drive.periods().is_multiple_of(clean.periods_a_tick) {
                clean.peaks.push(Peaks::of(&now.drive));
            }
        }
        Ok(clean)
    }

    /// The PWM period of that time from the manoeuvre's start, behind a control tick.
    fn period_of(&self, time_s: f64) -> u32 {
        let tick_s = f64::from(self.periods_a_tick) / self.pwm_rate_hz;
        self.lead_in_periods + (time_s / tick_s).round() as u32 * self.periods_a_tick
    }

    fn end_of(&self, from: u32) -> u32 {
        let watched = (WATCHED_S * self.pwm_rate_hz) as u32;
        (from + watched).min(self.packets.len() as u32)
    }

    /// Goes on from a moment with a fault.
    fn inject(&self, moment: &Loop, fault: Fault) -> Outcome {
        let mut now = moment.clone();
        let from = now.drive.periods();
        let mut judge = Judge::new(self.periods_a_tick, from / self.periods_a_tick);
        match fault.kind {
            Kind::Timing(failure) => now.ecu.fail(failure),
            _ => now.between.begin(fault),
        }
        let to = self.end_of(from);
        for clean in &self.packets[from as usize..to as usize] {
            let from_ecu = now.period();
            judge.look(&from_ecu, clean, &now.drive);
        }
        judge.conclude(now.between.stays_wrong())
    }

    /// The vehicle's greatest angles over the time for which a run from that moment is watched.
    fn peaks(&self, moment: &Loop) -> Peaks {
        let from = moment.drive.periods();
        let ticks = |period: u32| (period / self.periods_a_tick) as usize;
        let watched = &self.peaks[ticks(from)..ticks(self.end_of(from))];
        watched.iter().copied().fold(Peaks::default(), Peaks::or)
    }
}

/// A fault and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Class of the fault.
    pub class: Class,
    /// Kind of the fault.
    pub kind: String,
    /// The fault.
    pub fault: String,
    /// The manoeuvre.
    pub manoeuvre: String,
    /// Where the ECU ran: `software` or `processor`.
    pub level: &'static str,
    /// Time of the injection from the manoeuvre's start, s.
    pub injected_s: f64,
    /// How it is judged.
    pub verdict: Verdict,
    /// Why it may be silent, if it may.
    pub accepted: Option<&'static str>,
    /// Who found it.
    pub found_by: Option<String>,
    /// Control ticks from the injection to the one that found it.
    pub latency_ticks: Option<u32>,
    /// What the ECU did.
    pub reaction: &'static str,
    /// Greatest magnitude of the steering angle from the injection on, rad.
    pub steering_angle_rad: f64,
    /// The same in the clean run, rad.
    pub clean_steering_angle_rad: f64,
    /// Greatest magnitude of the front slip angle from the injection on, rad.
    pub front_slip_angle_rad: f64,
    /// The same in the clean run, rad.
    pub clean_front_slip_angle_rad: f64,
}

impl Row {
    /// Silent, and not on the list of those that may be.
    pub fn is_unlisted(&self) -> bool {
        self.verdict == Verdict::Silent && self.accepted.is_none()
    }

    /// Of an outcome.
    pub(super) fn new(
        (class, kind, fault): (Class, &str, String),
        (manoeuvre, level, injected_s): (&str, &'static str, f64),
        outcome: &Outcome,
        accepted: Option<&'static str>,
        clean: Peaks,
    ) -> Self {
        let finding = outcome.finding;
        Self {
            class,
            kind: kind.into(),
            fault,
            manoeuvre: manoeuvre.into(),
            level,
            injected_s,
            verdict: outcome.verdict,
            accepted: accepted.filter(|_| outcome.verdict == Verdict::Silent),
            found_by: finding.map(|finding| finding.finder.describe()),
            latency_ticks: finding.map(|finding| finding.latency_ticks),
            reaction: outcome.reaction.name(),
            steering_angle_rad: outcome.peaks.steering_angle_rad,
            clean_steering_angle_rad: clean.steering_angle_rad,
            front_slip_angle_rad: outcome.peaks.front_slip_angle_rad,
            clean_front_slip_angle_rad: clean.front_slip_angle_rad,
        }
    }
}

/// Injects every fault at every moment of every manoeuvre, side by side; `on_run` is called behind each run.
///
/// # Errors
/// If the user asks to stop.
pub fn inject(
    cleans: &[Clean],
    faults: &[Fault],
    on_run: impl Fn() + Sync,
) -> Result<Vec<Row>, RunError> {
    let moments = cleans
        .iter()
        .flat_map(|clean| clean.moments.iter().map(move |moment| (clean, moment)));
    let jobs: Vec<_> = moments
        .flat_map(|(clean, moment)| faults.iter().map(move |fault| (clean, moment, *fault)))
        .collect();
    jobs.into_par_iter()
        .map(|(clean, moment, fault)| {
            if interrupt::requested() {
                return Err(RunError::Interrupted);
            }
            let outcome = clean.inject(moment, fault);
            on_run();
            Ok(Row::new(
                (fault.class(), fault.kind.name(), fault.to_string()),
                (&clean.name, "software", moment.drive.plant().time_s()),
                &outcome,
                accepted::reason(&fault),
                clean.peaks(moment),
            ))
        })
        .collect()
}

/// Runs that [`inject`] makes.
pub fn runs(cleans: &[Clean], faults: &[Fault]) -> usize {
    let moments: usize = cleans.iter().map(|clean| clean.moments.len()).sum();
    moments * faults.len()
}

/// How many faults of a class came to what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Total {
    /// All.
    pub injected: usize,
    /// Trajectory, servo neutral or ECU started again.
    pub detected: usize,
    /// Trajectory, and gone on.
    pub tolerated: usize,
    /// Nothing came of them.
    pub harmless: usize,
    /// Not found, and on the list of those that may be.
    pub silent_listed: usize,
    /// Not found, and not on it.
    pub silent_unlisted: usize,
    /// Greatest latency, control ticks.
    pub worst_latency_ticks: u32,
}

/// Totals by class.
pub fn totals(rows: &[Row]) -> BTreeMap<Class, Total> {
    let mut totals: BTreeMap<Class, Total> = BTreeMap::new();
    for row in rows {
        let total = totals.entry(row.class).or_default();
        total.injected += 1;
        *match row.verdict {
            Verdict::Detected => &mut total.detected,
            Verdict::Tolerated => &mut total.tolerated,
            Verdict::Harmless => &mut total.harmless,
            Verdict::Silent if row.is_unlisted() => &mut total.silent_unlisted,
            Verdict::Silent => &mut total.silent_listed,
        } += 1;
        let latency = row.latency_ticks.unwrap_or(0);
        total.worst_latency_ticks = total.worst_latency_ticks.max(latency);
    }
    totals
}
