//! `sim-host firmware decode`: the firmware's telemetry as CSV.

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
/// CSV.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host firmware run target/thumbv7em-none-eabihf/firmware/bench \\
      telemetry=decode.bin run.duration_s=5
  sim-host firmware decode decode.bin --out decode.csv")]
pub struct Arguments {
    /// Telemetry file
    telemetry: PathBuf,
    /// Output file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let input = ("the telemetry", arguments.telemetry.as_path());
    check([input], [named("--out", &arguments.out)], arguments.force)?;
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
    if let Some(out) = &arguments.out {
        let trace = trace_of(&recording);
        output::write(out, arguments.force, |to| {
            Ok(trace_csv::write_csv(&trace, to)?)
        })?;
    }
    Ok(Outcome::Success)
}
