//! `sim-host firmware run`: the cargo runner of the firmware.

use crate::cli::emulator::{machines, open_image};
use crate::cli::outcome::Outcome;
use crate::cli::output::check;
use anyhow::{Context, anyhow, ensure};
use dynamics::config;
use image::Image;
use qemu::Machine;
use qemu::bus_session::BusSession;
use qemu::configured::place;
use qemu::log::LogDecoder;
use qemu::telemetry::Recording;
use shared_model::Scenario;
use shared_model::diagnostic::{Diagnostic, decode_diagnostic};
use shared_model::settings::SettingError;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};
use toml::{Table, Value};

/// Run a firmware image in QEMU, print its log, and return its exit code.
#[derive(clap::Args)]
#[command(
    after_help = "Examples (cargo runs this from firmware/: `cargo run -- SETTINGS`):
  sim-host firmware run target/thumbv7em-none-eabihf/firmware/bench \\
      run.wheel_speed_rpm=1600
  sim-host firmware run target/thumbv7em-none-eabihf/firmware/bench \\
      dither.waveform=sine dither.amplitude_v=1 telemetry=run.bin
  sim-host firmware run --machine mps2-an500 --time-out 60 \\
      target/thumbv7em-none-eabihf/firmware/bench run.duration_s=5

Settings are the keys of `sim-host config`, with a dot between section and name, plus preset=NAME, telemetry=FILE and, for the
image `bench`, pace=host: each PWM period begins when the work of the last one is done, without timing (default: pace=timer).
Exit codes are the firmware's: 0 complete, confirmed by log and telemetry; 10 scenario rejected, 11 telemetry, 12 overrun, 13 panic,
14 hard fault, 15 watchdog, 16 unexpected interrupt. The exit code is 2 if the image could not be run or did not end in time.
The image `ecu` takes no settings and does not end: its log and its status are printed until --time-out or Ctrl-C."
)]
pub struct Arguments {
    /// Machine to emulate
    #[arg(long, value_parser = machines(), default_value = "mps2-an386")]
    machine: Machine,
    /// Time limit for the run, s
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0)]
    time_out: f64,
    /// Overwrite an existing telemetry file
    #[arg(long)]
    force: bool,
    /// Firmware image (ELF)
    image: PathBuf,
    /// Settings after the image, as `key=value`
    #[arg(trailing_var_arg = true)]
    settings: Vec<String>,
}

/// Keys of settings that are not parameters of a scenario: for every image, and for the fault
/// drill.
const OWN_KEYS: [&str; 3] = [TELEMETRY, PACE, "fault="];
const TELEMETRY: &str = "telemetry=";
const PACE: &str = "pace=";

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let time_out = crate::cli::options::time_out(arguments.time_out)?;
    check_settings(&arguments.settings)?;
    let image = open_image(&arguments.image)?;
    let decoder = LogDecoder::new(&image)?;
    if !decoder.is_readable() {
        eprintln!(
            "warning: {} has no defmt symbols: the run has no log, and its outcome is determined by its exit code{}",
            arguments.image.display(),
            if telemetry(arguments).is_some() {
                " and its telemetry"
            } else {
                " only"
            }
        );
    }
    if place(&image).is_some() {
        return run_alone(&image, arguments, time_out);
    }
    check_destination(arguments)?;
    let before = telemetry(arguments).and_then(written);
    let show = &|line: &str| say!("{line}");
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

/// Runs the product's image without a vehicle, until the time limit or Ctrl-C, and prints its log and
/// its status.
fn run_alone(image: &Image, arguments: &Arguments, limit: Duration) -> anyhow::Result<Outcome> {
    /// Time between two looks at the log.
    const LOOK: Duration = Duration::from_millis(200);
    ensure!(
        arguments.settings.is_empty(),
        "setting {}: the image `ecu` has its settings in flash; write them with `sim-host firmware configure`",
        arguments.settings[0]
    );
    let mut session = BusSession::start(image, arguments.machine, limit)?;
    let mut shown = None;
    let start = Instant::now();
    while start.elapsed() < limit && !interrupt::requested() {
        let received = session.run_freely(LOOK)?;
        for line in session.log()? {
            say!("{line}");
        }
        let diagnostics = received.diagnostics.iter();
        for diagnostic in diagnostics.filter_map(decode_diagnostic) {
            if let Diagnostic::Status {
                configuration,
                starts,
                faults_in_a_row,
                ..
            } = diagnostic
            {
                let status = (configuration, starts, faults_in_a_row);
                if shown.replace(status) != Some(status) {
                    say!(
                        "status: start {starts}, configuration {configuration}, faults in a row {faults_in_a_row}"
                    );
                }
            }
        }
    }
    Ok(Outcome::Success)
}

/// Rejects settings that the firmware would reject, before it is started.
fn check_settings(settings: &[String]) -> anyhow::Result<()> {
    let mut scenario = Scenario::<f32>::reconstruction();
    for setting in settings {
        ensure!(
            !setting.starts_with('-'),
            "{setting}: options go before the image: sim-host firmware run [OPTIONS] IMAGE [KEY=VALUE]..."
        );
        ensure!(
            !setting.contains(char::is_whitespace),
            "setting {setting:?}: must not contain spaces"
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

/// The error of an invalid setting: that of the configuration, which has the same keys and lists
/// similar ones.
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

/// The requested telemetry file; of several, the last, as in the firmware.
fn telemetry(arguments: &Arguments) -> Option<&Path> {
    let paths = arguments.settings.iter();
    let mut paths = paths.filter_map(|setting| setting.strip_prefix(TELEMETRY));
    paths.next_back().map(Path::new)
}

/// Modification time of a regular file.
fn written(file: &Path) -> Option<SystemTime> {
    let metadata = std::fs::metadata(file).ok()?;
    metadata.modified().ok().filter(|_| metadata.is_file())
}

/// Checks that a complete run has written complete telemetry. A pipe or a device cannot be read
/// again.
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
        "the run ended with exit code 0, but its telemetry {name} reports exit code {}; run it again",
        trailer.exit_code
    );
    Ok(())
}

/// The firmware overwrites an existing file, so it is checked here.
fn check_destination(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(file) = telemetry(arguments) {
        let image = ("the image", arguments.image.as_path());
        let outputs = check([image], [Some(("telemetry", file))], arguments.force)
            .context("the image was not run; put --force before the image")?;
        ensure!(
            !outputs.data_on_stdout() && !file.to_string_lossy().starts_with(':'),
            "telemetry={}: standard output has the log; give the name of a file",
            file.display()
        );
    }
    Ok(())
}
