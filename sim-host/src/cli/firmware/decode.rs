//! `sim-host firmware decode`: the firmware's telemetry as CSV and as a measurement file.

use crate::cli::measurement::trajectory::{self, Precision};
use crate::cli::outcome::Outcome;
use crate::cli::output::{check, named};
use dynamics::trace_csv;
use dynamics::words::counted;
use files::output;
use pil::equivalence::trace_of;
use qemu::meaning;
use qemu::telemetry::Recording;
use std::path::PathBuf;

/// Check a telemetry file of the firmware, report how its run ended, and write its trajectory as
/// CSV or MDF 4.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host firmware run target/thumbv7em-none-eabihf/firmware/bench \\
      telemetry=decode.bin run.duration_s=5
  sim-host firmware decode decode.bin --out decode.csv
  sim-host firmware decode decode.bin --mdf4 decode.mf4")]
pub struct Arguments {
    /// Telemetry file
    telemetry: PathBuf,
    /// Write the trajectory as CSV, one row per model step
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the trajectory as a measurement file (ASAM MDF 4.10): the states at each model step, the
    /// duty code in each PWM period
    #[arg(long, value_name = "FILE")]
    mdf4: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let input = ("the telemetry", arguments.telemetry.as_path());
    let outputs = [
        named("--out", &arguments.out),
        named("--mdf4", &arguments.mdf4),
    ];
    check([input], outputs, arguments.force)?;
    let recording = Recording::open(&arguments.telemetry)?;
    let trailer = &recording.trailer;
    say!(
        "{} of {}; exit code {}: {}; {}; deepest stack {}; PWM at {} of {} (neutral {})",
        counted(recording.records.len(), "record"),
        counted(recording.header.samples_per_step, "duty code"),
        trailer.exit_code,
        meaning(trailer.exit_code.try_into().unwrap_or(-1)),
        counted(trailer.overruns, "overrun"),
        counted(trailer.stack_bytes, "byte"),
        trailer.final_duty,
        recording.header.pwm_period,
        trailer.neutral_duty,
    );
    let trace = trace_of(&recording);
    if let Some(out) = &arguments.out {
        output::write(out, arguments.force, |to| {
            Ok(trace_csv::write_csv(&trace, to)?)
        })?;
    }
    if let Some(path) = &arguments.mdf4 {
        let comment = format!("Telemetry of the ECU, {}.", arguments.telemetry.display());
        trajectory::write(&trace, Precision::Single, comment, path, arguments.force)?;
    }
    Ok(Outcome::Success)
}
