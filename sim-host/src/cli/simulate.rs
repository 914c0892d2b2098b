//! `sim-host simulate`: one run on the host, as CSV and as a measurement file.

use super::measurement::trajectory::{self, Precision};
use super::options::{RunOptions, advice};
use super::outcome::Outcome;
use super::output::{check, named};
use anyhow::bail;
use dynamics::config::to_toml;
use dynamics::simulate::{early_end, simulate};
use dynamics::trace_csv;
use dynamics::words::counted;
use files::output;
use std::path::PathBuf;

/// Simulate a scenario on the host and write its trajectory as CSV or MDF 4.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host simulate --rpm 1750 --time 20 --out simulate.csv
  sim-host simulate --rpm 1750 --dither square --amplitude-v 0.1 --time 20 \\
      --out simulate-square.csv
  sim-host simulate --rpm 1750 --time 20 --mdf4 simulate.mf4
  sim-host config > vehicle.toml
  sim-host simulate --config vehicle.toml --f32 --out simulate-f32.csv")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    /// Write the trajectory as CSV, one row per model step
    #[arg(long, value_name = "FILE", required_unless_present = "mdf4")]
    out: Option<PathBuf>,
    /// Write the trajectory as a measurement file (ASAM MDF 4.10): the states at each model step, the
    /// duty code in each PWM period
    #[arg(long, value_name = "FILE")]
    mdf4: Option<PathBuf>,
    /// Compute in f32, as on the ECU, instead of f64
    #[arg(long)]
    f32: bool,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let (out, mdf4) = (&arguments.out, &arguments.mdf4);
    let outputs = [named("--out", out), named("--mdf4", mdf4)];
    check(arguments.run.config.input(), outputs, arguments.force)?;
    let trace = if arguments.f32 {
        simulate(&scenario.map(&|value| value as f32))?
    } else {
        simulate(&scenario)?
    };
    if let Some(end) = early_end(&scenario, &trace) {
        bail!("{end}; no file was written. {}", advice(end.reason));
    }
    if let Some(path) = out {
        output::write(path, arguments.force, |to| {
            Ok(trace_csv::write_csv(&trace, to)?)
        })?;
    }
    if let Some(path) = mdf4 {
        let precision = match arguments.f32 {
            true => Precision::Single,
            false => Precision::Double,
        };
        trajectory::write(&trace, precision, to_toml(&scenario), path, arguments.force)?;
    }
    let files = [out, mdf4].into_iter().flatten();
    let files: Vec<String> = files.map(|file| file.display().to_string()).collect();
    say!(
        "{} over {} s in {}",
        counted(trace.states.len(), "state"),
        trace.time_s(trace.states.len() - 1),
        files.join(" and ")
    );
    Ok(Outcome::Success)
}
