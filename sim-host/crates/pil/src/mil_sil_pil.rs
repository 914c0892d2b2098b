//! A manoeuvre as MIL, SIL and PIL (model, software and processor in the loop), and a comparison of
//! their commands.

use super::closed_loop::{Exchange, Run, run};
use super::comparison::{Comparison, Depth, compare};
use super::ecu::{Model, OnBus, Processor, Software};
use super::manoeuvre::Manoeuvre;
use super::plant::InvalidPlant;
use super::vehicle_node::{VehicleNode, ecu_scenario};
use image::Image;
use qemu::bus_session::BusSession;
use qemu::configured::configured;
use qemu::session::{LinkKind, Session};
use qemu::settings;
use qemu::{Machine, RunError, meaning};
use shared_model::{InvalidScenario, Scenario};
use std::time::{Duration, Instant};

/// The emulated processor and its firmware.
#[derive(Debug, Clone)]
pub struct Target {
    /// The firmware.
    pub image: Image,
    /// The emulator's machine.
    pub machine: Machine,
    /// The link between emulator and host.
    pub link: LinkKind,
    /// Longest time for one answer of the emulator.
    pub time_out: Duration,
}

/// An error of a run in the loop.
#[derive(Debug, thiserror::Error)]
pub enum LoopError {
    /// The scenario or the manoeuvre is invalid.
    #[error(transparent)]
    Plant(#[from] InvalidPlant),
    /// An ECU cannot run the scenario.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
    /// The emulator or the firmware failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The image lacks a symbol or an instruction of this firmware.
    #[error(
        "the image has no {name}: it must be this project's firmware (`ecu` for the link uart, `bench` for all others); build it with `cargo xtask firmware`"
    )]
    NoSymbol {
        /// Name of the symbol or instruction.
        name: &'static str,
    },
    /// The firmware ended the run with an exit code.
    #[error("the firmware ended with exit code {exit_code}: {}", meaning(*exit_code))]
    Firmware {
        /// The code.
        exit_code: i32,
    },
}

/// The firmware's run.
#[derive(Debug, Clone)]
pub struct ProcessorRun {
    /// The run.
    pub run: Run,
    /// Elapsed time.
    pub elapsed: Duration,
    /// Counts of the PWM task (the maximum of one period) and of the control task, one pair per
    /// control tick; none from the product's image.
    pub costs: Vec<(u16, u16)>,
    /// The firmware's log.
    pub log: Vec<String>,
}

/// Differences of an ECU in f64 from the ECU in f32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct DoublePrecision {
    /// Duty codes that differ.
    pub different_duties: usize,
    /// Greatest difference, counts.
    pub worst_counts: u16,
}

/// A manoeuvre as MIL, SIL and PIL.
#[derive(Debug, Clone)]
pub struct MilSilPil {
    /// The manoeuvre's name.
    pub name: String,
    /// Simulated time, including the lead-in, s.
    pub simulated_s: f64,
    /// MIL compared with SIL.
    pub model_software: Comparison,
    /// SIL compared with PIL.
    pub software_processor: Comparison,
    /// MIL in f64 compared with MIL in f32, each in a separate loop.
    pub double_precision: DoublePrecision,
    /// The firmware's run.
    pub processor: ProcessorRun,
}

impl MilSilPil {
    /// The commands of MIL, SIL and PIL are bit-identical.
    pub fn agree(&self) -> bool {
        self.model_software.is_equal() && self.software_processor.is_equal()
    }

    /// Simulated time over elapsed time of PIL.
    pub fn speed(&self) -> f64 {
        self.simulated_s / self.processor.elapsed.as_secs_f64()
    }
}

/// Runs a manoeuvre as MIL, SIL and PIL. `on_period` is called after each PWM period of the
/// firmware's run.
///
/// # Errors
/// If the manoeuvre cannot be run.
pub fn run_all(
    scenario: &Scenario<f64>,
    manoeuvre: &Manoeuvre,
    target: &Target,
    on_period: &mut dyn FnMut(),
) -> Result<MilSilPil, LoopError> {
    let own = ecu_scenario(scenario, manoeuvre);
    let vehicle = || VehicleNode::new(scenario, manoeuvre);
    let model = run(&mut Model::new(&own)?, vehicle()?, &mut || {})?.exchanges;
    let double = &mut Model::new(&own.map(&f64::from))?;
    let double = run(double, vehicle()?, &mut || {})?.exchanges;
    let double_precision = deviation(&model, &double);
    drop(double);
    let software = run(&mut Software::new(&own)?, vehicle()?, &mut || {})?.exchanges;
    let model_software = compare(&model, &software, Depth::Commands);
    drop(model);
    let processor = on_processor(&own, vehicle()?, target, on_period)?;
    let periods = processor.run.exchanges.len() as f64;
    Ok(MilSilPil {
        name: manoeuvre.name.clone(),
        simulated_s: periods / scenario.run.pwm_rate_hz,
        model_software,
        software_processor: compare(&software, &processor.run.exchanges, Depth::Bytes),
        double_precision,
        processor,
    })
}

/// Runs a manoeuvre as PIL only.
///
/// # Errors
/// If the manoeuvre cannot be run.
pub fn on_processor(
    ecu: &Scenario<f32>,
    vehicle: VehicleNode,
    target: &Target,
    on_period: &mut dyn FnMut(),
) -> Result<ProcessorRun, LoopError> {
    if target.link == LinkKind::Uart {
        return on_bus(ecu, vehicle, target, on_period);
    }
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
    let run = run(&mut processor, vehicle, on_period)?;
    let elapsed = start.elapsed();
    let costs = processor.costs().to_vec();
    let ended = processor.finish()?;
    if ended.exit_code != 0 {
        return Err(LoopError::Firmware {
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

/// On the product's image, configured with the scenario.
fn on_bus(
    ecu: &Scenario<f32>,
    vehicle: VehicleNode,
    target: &Target,
    on_period: &mut dyn FnMut(),
) -> Result<ProcessorRun, LoopError> {
    let image = configured(&target.image, ecu, target.machine.board());
    let image = image.ok_or(LoopError::NoSymbol {
        name: "configuration section",
    })?;
    let session = BusSession::start(&image, target.machine, target.time_out)?;
    let mut processor = OnBus::new(session, ecu.periods_per_tick());
    let start = Instant::now();
    let run = run(&mut processor, vehicle, on_period)?;
    let elapsed = start.elapsed();
    Ok(ProcessorRun {
        run,
        elapsed,
        costs: Vec::new(),
        log: processor.finish()?,
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
