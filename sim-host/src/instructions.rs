//! Instructions that the ECU's tasks take, counted by the emulator. They are no cycles of silicon.

use crate::closed_loop::drive::{Drive, ecu_scenario};
use crate::closed_loop::ecu::Processor;
use crate::closed_loop::manoeuvre::Manoeuvre;
use crate::closed_loop::plant::InvalidPlant;
use crate::closed_loop::run::run;
use crate::pil::elf::Image;
use crate::pil::qemu::{Machine, RunError, meaning};
use crate::pil::session::{LinkKind, Session};
use crate::pil::settings;
use crate::pil::telemetry::Recording;
use shared_model::Scenario;
use std::collections::BTreeMap;
use std::time::Duration;

/// Instructions, and how often: ascending.
pub type Histogram = Vec<(u32, u64)>;

/// What the two tasks of a run took.
#[derive(Debug, Clone, Default)]
pub struct Instructions {
    /// The control task.
    pub control: Histogram,
    /// The slowest PWM task of each control tick.
    pub pwm: Histogram,
    /// PWM periods in a control tick.
    pub periods_a_tick: u32,
    /// Instructions that the core executes in a control tick.
    pub tick: f64,
}

impl Instructions {
    /// Of a run in open loop.
    pub fn of(recording: &Recording) -> Self {
        let header = &recording.header;
        let count = |counts: u16| recording.instructions(counts);
        let records = || recording.records.iter();
        Self {
            control: histogram(records().map(|record| count(record.control_cost))),
            pwm: histogram(records().map(|record| count(record.pwm_cost))),
            periods_a_tick: header.samples_per_step.into(),
            tick: f64::from(header.instruction_rate_hz) / f64::from(header.step_rate_hz),
        }
    }

    /// Share of its time that the core is busy with both tasks where each is at its worst; above 1 there is not enough.
    pub fn worst_share(&self) -> f64 {
        let pwm = f64::from(self.periods_a_tick) * f64::from(most(&self.pwm));
        (f64::from(most(&self.control)) + pwm) / self.tick
    }
}

fn histogram(instructions: impl Iterator<Item = u32>) -> Histogram {
    let mut histogram = BTreeMap::new();
    for count in instructions {
        *histogram.entry(count).or_insert(0) += 1;
    }
    histogram.into_iter().collect()
}

/// The greatest number of instructions; 0 of none.
pub fn most(histogram: &[(u32, u64)]) -> u32 {
    histogram.last().map_or(0, |&(count, _)| count)
}

/// The number that half of all do not exceed; 0 of none.
pub fn median(histogram: &[(u32, u64)]) -> u32 {
    let total: u64 = histogram.iter().map(|&(_, times)| times).sum();
    let mut seen = 0;
    for &(count, times) in histogram {
        seen += times;
        if 2 * seen >= total {
            return count;
        }
    }
    0
}

/// Why a run in the loop could not be made.
#[derive(Debug, thiserror::Error)]
pub enum InLoopError {
    /// The vehicle cannot be driven so.
    #[error(transparent)]
    Plant(#[from] InvalidPlant),
    /// The emulator or the firmware did not end as it should.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The firmware ended with an exit code of its own.
    #[error("the firmware ended with exit code {exit_code}: {}", meaning(*.exit_code))]
    Firmware {
        /// Which.
        exit_code: i32,
    },
}

/// A run in the loop.
#[derive(Debug, Clone)]
pub struct InLoop {
    /// What its tasks took.
    pub instructions: Instructions,
    /// The firmware's log.
    pub log: Vec<String>,
}

/// Drives a manoeuvre with the firmware in the loop, on a machine whose timers all have the clock that they are said to have.
///
/// # Errors
/// If it cannot be driven, or the firmware does not do it.
pub fn in_loop(
    image: &Image,
    machine: Machine,
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    limit: Duration,
) -> Result<InLoop, InLoopError> {
    let drive = Drive::new(scenario, manoeuvre)?;
    let settings = settings::of(&ecu_scenario(scenario, manoeuvre));
    let session = Session::start(image, machine, &settings, LinkKind::Files, &[], limit)?;
    let mut ecu = Processor::new(session);
    run(&mut ecu, drive, || {})?;
    let rate_hz = machine.instruction_rate_hz();
    // The tasks are counted with the clock of the PWM's timer.
    let instructions_a_count = rate_hz / scenario.servo.timer_clock_hz;
    let count = |counts: u16| (f64::from(counts) * instructions_a_count).round() as u32;
    let instructions = Instructions {
        control: histogram(ecu.costs().iter().map(|&(_, control)| count(control))),
        pwm: histogram(ecu.costs().iter().map(|&(pwm, _)| count(pwm))),
        periods_a_tick: scenario.periods_per_tick(),
        tick: rate_hz / scenario.run.control_rate_hz,
    };
    let ended = ecu.finish()?;
    match ended.exit_code {
        0 => Ok(InLoop {
            instructions,
            log: ended.log,
        }),
        exit_code => Err(InLoopError::Firmware { exit_code }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_do_not_exceed_the_median() {
        let histogram = histogram([5, 3, 3, 9].into_iter());
        assert_eq!(histogram, [(3, 2), (5, 1), (9, 1)]);
        assert_eq!((median(&histogram), most(&histogram)), (3, 9));
        assert_eq!((median(&[]), most(&[])), (0, 0));
    }

    #[test]
    fn the_worst_of_both_tasks_share_a_tick() {
        let instructions = Instructions {
            control: vec![(100, 7), (400, 1)],
            pwm: vec![(50, 8)],
            periods_a_tick: 10,
            tick: 1000.0,
        };
        assert!((instructions.worst_share() - 0.9).abs() < 1e-12);
    }
}
