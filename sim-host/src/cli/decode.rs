//! `sim-host decode`: the firmware's telemetry as CSV.

use super::output::check_free;
use super::{Done, simulate};
use sim_host::pil::qemu::meaning;
use sim_host::pil::telemetry::Recording;
use std::path::PathBuf;

/// Check a telemetry file of the firmware, say how its run ended, and write its motion as CSV.
#[derive(clap::Args)]
#[command(after_help = "Example:
  (cd firmware && cargo run -- telemetry=run.bin run.duration_s=5)
  sim-host decode firmware/run.bin --out run.csv")]
pub struct Arguments {
    /// Telemetry file
    telemetry: PathBuf,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite the file if it exists
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Done> {
    if let Some(out) = &arguments.out {
        check_free(out, arguments.force)?;
    }
    let recording = Recording::open(&arguments.telemetry)?;
    let trailer = &recording.trailer;
    say!(
        "{} records of {} duty codes; exit code {}: {}; {} overruns; deepest stack {} bytes; PWM at {} of {} (neutral {})",
        recording.records.len(),
        recording.header.samples_per_step,
        trailer.exit_code,
        meaning(trailer.exit_code.try_into().unwrap_or(-1)),
        trailer.overruns,
        trailer.stack_bytes,
        trailer.final_duty,
        recording.header.pwm_period,
        trailer.neutral_duty,
    );
    if let Some(out) = &arguments.out {
        simulate::write(&recording.trace(), out, arguments.force)?;
    }
    Ok(Done::Well)
}
