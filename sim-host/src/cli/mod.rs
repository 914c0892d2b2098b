//! One file a subcommand, and what they share: exit codes, configuration options, output files.

// First, for its macro.
#[macro_use]
mod stdout;

mod averaging;
mod basin;
mod config;
mod convergence;
mod decode;
mod emulator;
mod equilibria;
mod faults;
mod grid;
mod image;
mod lyapunov;
mod map;
mod nonlinearity;
mod orbit;
mod output;
mod phase;
mod pil;
mod poincare;
mod qemu;
mod realisability;
mod regions;
mod reproduce;
mod schedule;
mod settled;
mod simulate;
mod spectrum;
mod sweep;
mod tires;
mod verify;

use clap::{Args, Parser, Subcommand};
use dynamics::config::{ConfigError, differences, over_preset, read, validate};
use dynamics::words::Short;
use engine::Reason;
use output::{Named, named};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::settings::Choice;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Exit code of a failed verdict.
const FAILED: u8 = 1;
/// Exit code where the job could not be done.
const COULD_NOT_RUN: u8 = 2;
/// Time that an interrupted job has to write its results.
const GRACE: Duration = Duration::from_millis(900);

/// Host simulator of the steering ECU: compares it with the firmware in QEMU, and shows chaos and its suppression by dither.
///
/// Exit codes: 0 verdict pass, 1 verdict fail, 2 could not run (missing tool, bad input, time-out). The last line says why.
#[derive(Parser)]
#[command(name = "sim-host", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Verify(verify::Arguments),
    Pil(pil::Arguments),
    Simulate(simulate::Arguments),
    Reproduce(reproduce::Arguments),
    Lyapunov(lyapunov::Arguments),
    Averaging(averaging::Arguments),
    Convergence(convergence::Arguments),
    Orbit(orbit::Arguments),
    Regions(regions::Arguments),
    Equilibria(equilibria::Arguments),
    Basin(basin::Arguments),
    Phase(phase::Arguments),
    Poincare(poincare::Arguments),
    Spectrum(spectrum::Arguments),
    Tires(tires::Arguments),
    Nonlinearity(nonlinearity::Arguments),
    Map(map::Arguments),
    Schedule(schedule::Arguments),
    Realisability(realisability::Arguments),
    Faults(faults::Arguments),
    Config(config::Arguments),
    Decode(decode::Arguments),
    Image(image::Arguments),
    Qemu(qemu::Arguments),
}

/// How a job ended that could be done.
enum Done {
    /// Well, or with a verdict of pass.
    Well,
    /// With a verdict of fail.
    Failed,
    /// With an exit code to pass on.
    Code(u8),
}

/// Runs the command line.
pub fn main() -> ExitCode {
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(usage) => return show(&usage),
    };
    if let Err(error) = ctrlc::set_handler(end_soon) {
        eprintln!("warning: Ctrl-C ends this program at once: {error}");
    }
    let done = interrupt::catch(|| run(command)).unwrap_or_else(|stopped| Err(stopped.into()));
    match done.and_then(|done| stdout::finish().map(|()| done)) {
        Ok(Done::Well) => ExitCode::SUCCESS,
        Ok(Done::Failed) => ExitCode::from(FAILED),
        Ok(Done::Code(code)) => ExitCode::from(code),
        Err(error) => could_not_run(&error),
    }
}

/// Ctrl-C or SIGTERM: long jobs end in good order and write the results that are complete. A second one ends them at once, and so does
/// the end of the grace period.
fn end_soon() {
    if interrupt::request() {
        std::process::exit(COULD_NOT_RUN.into());
    }
    std::thread::spawn(|| {
        std::thread::sleep(GRACE);
        eprintln!("error: interrupted; what was not written by now is lost");
        std::process::exit(COULD_NOT_RUN.into());
    });
}

fn run(command: Command) -> anyhow::Result<Done> {
    match command {
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Pil(arguments) => pil::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Lyapunov(arguments) => lyapunov::run(&arguments),
        Command::Averaging(arguments) => averaging::run(&arguments),
        Command::Convergence(arguments) => convergence::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Regions(arguments) => regions::run(&arguments),
        Command::Equilibria(arguments) => equilibria::run(&arguments),
        Command::Basin(arguments) => basin::run(&arguments),
        Command::Phase(arguments) => phase::run(&arguments),
        Command::Poincare(arguments) => poincare::run(&arguments),
        Command::Spectrum(arguments) => spectrum::run(&arguments),
        Command::Tires(arguments) => tires::run(&arguments),
        Command::Nonlinearity(arguments) => nonlinearity::run(&arguments),
        Command::Map(arguments) => map::run(&arguments),
        Command::Schedule(arguments) => schedule::run(&arguments),
        Command::Realisability(arguments) => realisability::run(&arguments),
        Command::Faults(arguments) => faults::run(&arguments),
        Command::Config(arguments) => config::run(&arguments),
        Command::Decode(arguments) => decode::run(&arguments),
        Command::Image(arguments) => image::run(&arguments),
        Command::Qemu(arguments) => qemu::run(&arguments),
    }
}

fn could_not_run(error: &anyhow::Error) -> ExitCode {
    eprintln!("error: {}", message(error));
    ExitCode::from(COULD_NOT_RUN)
}

/// Shows a help text, or what is wrong with the command line.
fn show(usage: &clap::Error) -> ExitCode {
    let code = ExitCode::from(usage.exit_code() as u8);
    match usage.print() {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            could_not_run(&anyhow::Error::new(error).context("cannot write to standard output"))
        }
        _ => code,
    }
}

/// The error and its causes, each once: some say their cause themselves, others leave that to the chain.
fn message(error: &anyhow::Error) -> String {
    let mut message = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if message.is_empty() {
            message = cause;
        } else if !message.contains(&cause) {
            message = format!("{message}: {cause}");
        }
    }
    message
}

/// Where a scenario's parameters come from.
#[derive(Args)]
struct ConfigOptions {
    /// Preset: `reconstruction` (the reading that reproduces the paper) or `printed` (the equations as printed)
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// TOML file over the preset; `sim-host config` prints a complete one
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl ConfigOptions {
    /// The scenario.
    fn load(&self) -> Result<Scenario<f64>, ConfigError> {
        match &self.config {
            Some(file) => load_file(file, self.preset.as_deref()),
            None => over_preset(toml::Table::new(), self.preset.as_deref()),
        }
    }

    /// The file that is read, if any.
    fn input(&self) -> Option<Named<'_>> {
        named("--config", &self.config)
    }

    /// As they are given on a command line, each with a blank before it.
    fn words(&self) -> String {
        let preset = self.preset.iter().map(|name| format!(" --preset {name}"));
        let config = self.config.iter();
        let config = config.map(|file| format!(" --config {}", file.display()));
        preset.chain(config).collect()
    }
}

/// The scenario of a file. It is said in which parameters it differs from the paper's, and if the file holds none.
fn load_file(file: &Path, preset: Option<&str>) -> Result<Scenario<f64>, ConfigError> {
    let over = read(file)?;
    if sets_nothing(&over) {
        eprintln!(
            "warning: {} sets no parameter, so all are the preset's; `sim-host config` prints a complete file",
            file.display()
        );
    }
    let scenario = over_preset(over, preset)?;
    let differences = differences(&scenario);
    if differences.is_empty() {
        eprintln!("parameters: the paper's");
    } else {
        eprintln!(
            "parameters that differ from the paper's: {}",
            differences.join(", ")
        );
    }
    Ok(scenario)
}

/// Whether a file holds nothing, or sections with nothing in them.
fn sets_nothing(table: &toml::Table) -> bool {
    table
        .values()
        .all(|value| value.as_table().is_some_and(sets_nothing))
}

/// What to do about a motion that ends early.
fn advice(reason: Reason) -> &'static str {
    match reason {
        Reason::Diverges => {
            "Set B of Table 1 with the cubic tyre diverges, and so does a negative peak_n"
        }
        _ => "Raise run.control_rate_hz, and run.pwm_rate_hz with it",
    }
}

/// Parameters of a run that are set most often.
#[derive(Args)]
struct RunOptions {
    #[command(flatten)]
    config: ConfigOptions,
    /// Wheel speed, rpm
    #[arg(long, value_name = "RPM", allow_negative_numbers = true)]
    rpm: Option<f64>,
    /// Waveform of the dither: none, square or sine
    #[arg(long, value_name = "WAVEFORM", value_parser = waveform)]
    dither: Option<Waveform>,
    /// Amplitude of the dither, V
    #[arg(long, value_name = "VOLTS", allow_negative_numbers = true)]
    amplitude_v: Option<f64>,
    /// Length of the run, s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    time: Option<f64>,
}

impl RunOptions {
    /// The scenario, checked.
    fn scenario(&self) -> Result<Scenario<f64>, ConfigError> {
        let mut scenario = self.config.load()?;
        let run = &mut scenario.run;
        run.wheel_speed_rpm = self.rpm.unwrap_or(run.wheel_speed_rpm);
        run.duration_s = self.time.unwrap_or(run.duration_s);
        let dither = &mut scenario.dither;
        dither.waveform = self.dither.unwrap_or(dither.waveform);
        dither.amplitude_v = self.amplitude_v.unwrap_or(dither.amplitude_v);
        validate(&scenario)?;
        Ok(scenario)
    }
}

fn waveform(name: &str) -> Result<Waveform, String> {
    let names = || Waveform::ALL.map(Waveform::name).join(", ");
    Waveform::from_name(name).ok_or_else(|| format!("must be one of {}", names()))
}

/// Least and greatest time-out, s.
const TIME_OUTS_S: std::ops::RangeInclusive<f64> = 0.1..=86_400.0;

fn time_out(seconds: f64) -> anyhow::Result<Duration> {
    anyhow::ensure!(
        TIME_OUTS_S.contains(&seconds),
        "--time-out {}: must be from {} to {} s",
        Short(seconds),
        TIME_OUTS_S.start(),
        TIME_OUTS_S.end()
    );
    Ok(Duration::from_secs_f64(seconds))
}
