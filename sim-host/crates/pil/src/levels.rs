//! A manoeuvre at every level: model, software and processor in the loop, and whether they command the same.

use super::drive::{Drive, ecu_scenario};
use super::ecu::{Model, Processor, Software};
use super::manoeuvre::Manoeuvre;
use super::plant::InvalidPlant;
use super::run::{Comparison, Depth, Exchange, Run, compare, run};
use image::Image;
use qemu::session::{LinkKind, Session};
use qemu::settings;
use qemu::{Machine, RunError, meaning};
use shared_model::{InvalidScenario, Scenario};
use std::time::{Duration, Instant};

/// Where the processor in the loop is emulated.
#[derive(Debug, Clone)]
pub struct Target {
    /// The firmware.
    pub image: Image,
    /// The emulator's machine.
    pub machine: Machine,
    /// What carries the exchange.
    pub link: LinkKind,
    /// Longest time that the emulator may take for one answer.
    pub time_out: Duration,
}

/// Why a manoeuvre could not be driven.
#[derive(Debug, thiserror::Error)]
pub enum LevelError {
    /// Scenario or manoeuvre are not valid.
    #[error(transparent)]
    Plant(#[from] InvalidPlant),
    /// The scenario is not one that an ECU can run.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
    /// The emulator or the firmware did not do as it should.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The image is not one of this firmware.
    #[error("the image has no {name}")]
    NoSymbol {
        /// What is looked for in it.
        name: &'static str,
    },
    /// The firmware ended the run with a code of its own.
    #[error("the firmware ended with exit code {exit_code}: {}", meaning(*exit_code))]
    Firmware {
        /// The code.
        exit_code: i32,
    },
}

/// The firmware's run.
#[derive(Debug, Clone)]
pub struct ProcessorRun {
    /// What was driven.
    pub run: Run,
    /// Time that it took.
    pub elapsed: Duration,
    /// Counts that the PWM task (at most, in one period) and the control task took, one pair a control tick.
    pub costs: Vec<(u16, u16)>,
    /// The firmware's log.
    pub log: Vec<String>,
}

/// What an ECU of f64 would have put out instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct DoublePrecision {
    /// Duty codes that differ from the ECU's.
    pub different_duties: usize,
    /// Greatest difference, counts.
    pub worst_counts: u16,
}

/// A manoeuvre at every level.
#[derive(Debug, Clone)]
pub struct Levels {
    /// The manoeuvre's name.
    pub name: String,
    /// Time simulated, s, the lead-in included.
    pub simulated_s: f64,
    /// Model against software in the loop.
    pub model_software: Comparison,
    /// Software against processor in the loop.
    pub software_processor: Comparison,
    /// Model in the loop in f64 against that in f32, both in a loop of their own.
    pub double_precision: DoublePrecision,
    /// The firmware's run.
    pub processor: ProcessorRun,
}

impl Levels {
    /// All levels command the same, bit for bit.
    pub fn agree(&self) -> bool {
        self.model_software.is_equal() && self.software_processor.is_equal()
    }

    /// Simulated time over the time it took, processor in the loop.
    pub fn speed(&self) -> f64 {
        self.simulated_s / self.processor.elapsed.as_secs_f64()
    }
}

/// Drives a manoeuvre at every level; `on_period` is called behind each PWM period of the firmware's run.
///
/// # Errors
/// If it cannot be driven.
pub fn drive(
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    target: &Target,
    on_period: impl FnMut(),
) -> Result<Levels, LevelError> {
    let own = ecu_scenario(scenario, manoeuvre);
    let loop_of = || Drive::new(scenario, manoeuvre);
    let model = run(&mut Model::new(&own)?, loop_of()?, || {})?.exchanges;
    let double = &mut Model::new(&own.map(&f64::from))?;
    let double = run(double, loop_of()?, || {})?.exchanges;
    let double_precision = deviation(&model, &double);
    drop(double);
    let software = run(&mut Software::new(&own)?, loop_of()?, || {})?.exchanges;
    let model_software = compare(&model, &software, Depth::Commands);
    drop(model);
    let processor = on_processor(&own, loop_of()?, target, on_period)?;
    let periods = processor.run.exchanges.len() as f64;
    Ok(Levels {
        name: manoeuvre.name.clone(),
        simulated_s: periods / scenario.run.pwm_rate_hz,
        model_software,
        software_processor: compare(&software, &processor.run.exchanges, Depth::Bytes),
        double_precision,
        processor,
    })
}

/// Drives with the firmware alone.
///
/// # Errors
/// If it cannot be driven.
pub fn on_processor(
    ecu: &Scenario<f32>,
    drive: Drive,
    target: &Target,
    on_period: impl FnMut(),
) -> Result<ProcessorRun, LevelError> {
    let session = Session::start(
        &target.image,
        target.machine,
        &settings::of(ecu),
        target.link,
        &[],
        target.time_out,
    )?;
    let mut processor = Processor::new(session);
    let start = Instant::now();
    let run = run(&mut processor, drive, on_period)?;
    let elapsed = start.elapsed();
    let costs = processor.costs().to_vec();
    let ended = processor.finish()?;
    if ended.exit_code != 0 {
        return Err(LevelError::Firmware {
            exit_code: ended.exit_code,
        });
    }
    Ok(ProcessorRun {
        run,
        elapsed,
        costs,
        log: ended.log,
    })
}

fn deviation(single: &[Exchange], double: &[Exchange]) -> DoublePrecision {
    let code = |exchange: &Exchange| exchange.from_ecu.duty_code;
    let differences = single
        .iter()
        .zip(double)
        .map(|(a, b)| code(a).abs_diff(code(b)));
    let (mut different_duties, mut worst_counts) = (0, 0);
    for difference in differences {
        different_duties += usize::from(difference > 0);
        worst_counts = worst_counts.max(difference);
    }
    DoublePrecision {
        different_duties,
        worst_counts,
    }
}
