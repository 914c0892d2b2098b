//! `sim-host firmware run`: the cargo runner of the firmware.

use crate::cli::emulator::{machines, open_image};
use crate::cli::outcome::Outcome;
use crate::cli::output::check;
use anyhow::{Context, anyhow, ensure};
use dynamics::config;
use qemu::Machine;
use qemu::log::LogDecoder;
use qemu::telemetry::Recording;
use shared_model::Scenario;
use shared_model::settings::SettingError;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use toml::{Table, Value};

/// Run a firmware image in QEMU: show its log, pass its exit code on, and end with it.
#[derive(clap::Args)]
#[command(
    after_help = "Examples (cargo runs this from firmware/: `cargo run -- SETTINGS`):
  sim-host firmware run target/thumbv7em-none-eabihf/firmware/ecu \\
      run.wheel_speed_rpm=1600
  sim-host firmware run target/thumbv7em-none-eabihf/firmware/ecu \\
      dither.waveform=sine dither.amplitude_v=1 telemetry=run.bin
  sim-host firmware run --machine mps2-an500 --time-out 60 \\
      target/thumbv7em-none-eabihf/firmware/ecu run.duration_s=5

Settings are the keys of `sim-host config`, with a dot between section and name, plus preset=NAME and telemetry=FILE.
Exit codes are the firmware's: 0 complete, as its log and its telemetry say too; 10 scenario refused, 11 telemetry, 12 overrun, 13 panic, 14 hard fault, 15
watchdog, 16 unexpected interrupt; 2 if it could not be run or did not end in time."
)]
pub struct Arguments {
    /// Machine to emulate
    #[arg(long, value_parser = machines(), default_value = "mps2-an386")]
    machine: Machine,
    /// Longest time that the run may take, s
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0)]
    time_out: f64,
    /// Overwrite the telemetry file if it exists
    #[arg(long)]
    force: bool,
    /// Firmware image (ELF)
    image: PathBuf,
    /// Settings, `key=value`, after the image
    #[arg(trailing_var_arg = true)]
    settings: Vec<String>,
}

/// Keys of settings that are no parameters of a scenario: of every image, and of the fault drill.
const OWN_KEYS: [&str; 2] = [TELEMETRY, "fault="];
const TELEMETRY: &str = "telemetry=";

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let time_out = crate::cli::options::time_out(arguments.time_out)?;
    check_settings(&arguments.settings)?;
    let image = open_image(&arguments.image)?;
    let decoder = LogDecoder::new(&image)?;
    if !decoder.is_readable() {
        eprintln!(
            "warning: {} has no defmt symbols: the run has no log, and is judged by its exit code{}",
            arguments.image.display(),
            if telemetry(arguments).is_some() {
                " and its telemetry"
            } else {
                " alone"
            }
        );
    }
    check_destination(arguments)?;
    let before = telemetry(arguments).and_then(written);
    let show = |line: &str| say!("{line}");
    let finished = qemu::run_with(
        &decoder,
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
    } else if let Some(file) = telemetry(arguments) {
        check_telemetry(file, before)?;
    }
    Ok(Outcome::Code(
        u8::try_from(code).unwrap_or(crate::cli::outcome::COULD_NOT_RUN),
    ))
}

/// Refuses, before anything is started, what the firmware would refuse by name.
fn check_settings(settings: &[String]) -> anyhow::Result<()> {
    let mut scenario = Scenario::<f32>::reconstruction();
    for setting in settings {
        ensure!(
            !setting.starts_with('-'),
            "{setting}: options go before the image: sim-host firmware run [OPTIONS] IMAGE [KEY=VALUE]..."
        );
        ensure!(
            !setting.contains(char::is_whitespace),
            "setting {setting:?}: the firmware takes no blanks in a setting"
        );
        if OWN_KEYS.iter().any(|key| setting.starts_with(key)) {
            continue;
        }
        scenario
            .apply(setting)
            .map_err(|error| refusal(setting, error))?;
    }
    Ok(())
}

/// Why a setting is none: in the words of the configuration, which has the same keys and lists what could be meant.
fn refusal(setting: &str, error: SettingError) -> anyhow::Error {
    let in_configuration = setting.split_once('=').and_then(|(key, value)| {
        let value = Value::String(value.into());
        let nested = key.rsplit('.').fold(value, |inner, name| {
            Value::Table(Table::from_iter([(name.to_owned(), inner)]))
        });
        config::over_preset(nested.try_into().ok()?, None).err()
    });
    match in_configuration {
        Some(known) => anyhow!("setting {setting}: {known}"),
        None => anyhow!("setting {setting}: {error}, for instance run.wheel_speed_rpm=1600"),
    }
}

/// The telemetry file that is asked for; of several the last, as the firmware takes it.
fn telemetry(arguments: &Arguments) -> Option<&Path> {
    let paths = arguments.settings.iter();
    let mut paths = paths.filter_map(|setting| setting.strip_prefix(TELEMETRY));
    paths.next_back().map(Path::new)
}

/// When a regular file was written last.
fn written(file: &Path) -> Option<SystemTime> {
    let metadata = std::fs::metadata(file).ok()?;
    metadata.modified().ok().filter(|_| metadata.is_file())
}

/// A complete run leaves its telemetry with its end. Of a pipe or a device nothing can be read again.
fn check_telemetry(file: &Path, before: Option<SystemTime>) -> anyhow::Result<()> {
    let name = file.display();
    if file.exists() && !file.is_file() {
        return Ok(());
    }
    let after = written(file);
    ensure!(
        after.is_some() && after != before,
        "the run ended with exit code 0, but did not write its telemetry {name}; is the image one of this firmware?"
    );
    let trailer = Recording::last_trailer(file).with_context(|| name.to_string())?;
    ensure!(
        trailer.exit_code == 0,
        "the run ended with exit code 0, but its telemetry {name} says {}; run it again",
        trailer.exit_code
    );
    Ok(())
}

/// The firmware overwrites what is there without asking, so it is asked here.
fn check_destination(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(file) = telemetry(arguments) {
        let image = ("the image", arguments.image.as_path());
        let outputs = check([image], [Some(("telemetry", file))], arguments.force)
            .context("nothing was run; --force goes before the image")?;
        ensure!(
            !outputs.data_on_stdout() && !file.to_string_lossy().starts_with(':'),
            "telemetry={}: it would get among the log; give the name of a file",
            file.display()
        );
    }
    Ok(())
}
