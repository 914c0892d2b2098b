//! `sim-host simulate`: one run on the host, as CSV.

use super::options::{RunOptions, advice};
use super::outcome::Outcome;
use super::output::check;
use anyhow::bail;
use dynamics::simulate::{early_end, simulate};
use dynamics::trace::Trace;
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
    write(&trace, &arguments.out, arguments.force)?;
    say!(
        "{} over {} s in {}",
        counted(trace.states.len(), "state"),
        trace.time_s(trace.states.len() - 1),
        arguments.out.display()
    );
    Ok(Outcome::Success)
}

/// Writes a trajectory as CSV, one row per model step; the duty code is that of the step's last PWM
/// period.
pub fn write(trace: &Trace, path: &std::path::Path, force: bool) -> anyhow::Result<()> {
    Ok(output::write(path, force, |to| {
        let mut csv = csv::Writer::from_writer(to);
        csv.write_record([
            "time_s",
            "sideslip_rad",
            "yaw_rate_rad_per_s",
            "steering_angle_rad",
            "steering_rate_rad_per_s",
            "friction_mode",
            "duty_code",
        ])?;
        let duties = trace.duties.chunks(trace.samples_per_step);
        for (k, (state, duties)) in trace.states.iter().zip(duties).enumerate() {
            let mut row = vec![trace.time_s(k).to_string()];
            row.extend(state.x.iter().map(f64::to_string));
            row.push(format!("{:?}", state.friction).to_lowercase());
            row.push(duties.last().map_or(String::new(), u16::to_string));
            csv.write_record(row)?;
        }
        Ok(csv.flush()?)
    })?)
}
