//! `sim-host qemu`: the cargo runner of the firmware.

use super::Done;
use super::output::check;
use anyhow::{Context, bail, ensure};
use sim_host::pil::elf::Image;
use sim_host::pil::qemu::{self, Machine};
use std::path::{Path, PathBuf};

/// Run a firmware image in QEMU: show its log, pass its exit code on, and end with it.
#[derive(clap::Args)]
#[command(
    after_help = "Examples (cargo runs this from firmware/: `cargo run -- SETTINGS`):
  sim-host qemu target/thumbv7em-none-eabihf/firmware/ecu \\
      run.wheel_speed_rpm=1600
  sim-host qemu target/thumbv7em-none-eabihf/firmware/ecu \\
      dither.waveform=sine dither.amplitude_v=1 telemetry=run.bin
  sim-host qemu --machine mps2-an500 --time-out 60 \\
      target/thumbv7em-none-eabihf/firmware/ecu run.duration_s=5

Settings are the keys of `sim-host config`, with a dot between section and name, plus preset=NAME and telemetry=FILE.
Exit codes are the firmware's: 0 complete, 10 scenario refused, 11 telemetry, 12 overrun, 13 panic, 14 hard fault, 15
watchdog, 16 unexpected interrupt; 2 if it could not be run or did not end in time."
)]
pub struct Arguments {
    /// Machine to emulate
    #[arg(long, value_enum, default_value = "mps2-an386")]
    machine: Machine,
    /// Longest time that the run may take, s
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0)]
    time_out: f64,
    /// Overwrite the telemetry file if it exists
    #[arg(long)]
    force: bool,
    /// Firmware image (ELF)
    image: PathBuf,
    /// Settings, `key=value`
    #[arg(trailing_var_arg = true)]
    settings: Vec<String>,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Done> {
    let time_out = super::time_out(arguments.time_out)?;
    let image = Image::open(&arguments.image)?;
    if let Some(setting) = arguments
        .settings
        .iter()
        .find(|s| s.contains(char::is_whitespace))
    {
        bail!("setting {setting:?}: the firmware takes no blanks in a setting");
    }
    check_telemetry(arguments)?;
    let show = |line: &str| say!("{line}");
    let finished = qemu::run(
        &image,
        arguments.machine,
        &arguments.settings,
        Path::new("."),
        time_out,
        show,
    )?;
    let code = finished.exit_code;
    if code != 0 {
        eprintln!(
            "firmware ended with exit code {code}: {}",
            qemu::meaning(code)
        );
    }
    Ok(Done::Code(
        u8::try_from(code).unwrap_or(super::COULD_NOT_RUN),
    ))
}

/// The firmware overwrites what is there without asking, so it is asked here.
fn check_telemetry(arguments: &Arguments) -> anyhow::Result<()> {
    let settings = arguments.settings.iter();
    let file = settings.filter_map(|setting| setting.strip_prefix("telemetry="));
    // The last of several counts.
    if let Some(file) = file.last() {
        let image = ("the image", arguments.image.as_path());
        let outputs = check(
            [image],
            [Some(("telemetry", Path::new(file)))],
            arguments.force,
        )
        .context("nothing was run; --force goes before the image")?;
        ensure!(
            !outputs.data_on_stdout() && !file.starts_with(':'),
            "telemetry={file}: it would get among the log; give the name of a file"
        );
    }
    Ok(())
}
