//! `sim-host simulate`: one run on the host, as CSV.

use super::options::{RunOptions, advice};
use super::outcome::Outcome;
use super::output::check;
use anyhow::bail;
use dynamics::simulate::{early_end, simulate};
use dynamics::trace_csv;
use dynamics::words::counted;
use files::output;
use std::path::PathBuf;

/// Simulate a scenario on the host and write its trajectory as CSV.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host simulate --rpm 1750 --time 20 --out simulate.csv
  sim-host simulate --rpm 1750 --dither square --amplitude-v 0.1 --time 20 \\
      --out simulate-square.csv
  sim-host config > vehicle.toml
  sim-host simulate --config vehicle.toml --f32 --out simulate-f32.csv")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    /// Output file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Compute in f32, as on the ECU, instead of f64
    #[arg(long)]
    f32: bool,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let out = Some(("--out", arguments.out.as_path()));
    check(arguments.run.config.input(), [out], arguments.force)?;
    let trace = if arguments.f32 {
        simulate(&scenario.map(&|value| value as f32))?
    } else {
        simulate(&scenario)?
    };
    if let Some(end) = early_end(&scenario, &trace) {
        bail!("{end}; no file was written. {}", advice(end.reason));
    }
    output::write(&arguments.out, arguments.force, |to| {
        Ok(trace_csv::write_csv(&trace, to)?)
    })?;
    say!(
        "{} over {} s in {}",
        counted(trace.states.len(), "state"),
        trace.time_s(trace.states.len() - 1),
        arguments.out.display()
    );
    Ok(Outcome::Success)
}
