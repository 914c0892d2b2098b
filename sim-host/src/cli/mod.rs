//! Command line: one file per subcommand, and their shared options, outputs and exit codes.

// First, because the other modules use its macro.
#[macro_use]
mod stdout;

mod averaging;
mod basin;
mod config;
mod continuation;
mod convergence;
mod emulator;
mod equilibria;
mod faults;
mod feedback;
mod feedback_table;
mod firmware;
mod fmu;
mod grid;
mod groups;
mod lyapunov;
#[cfg(feature = "manuals")]
mod manuals;
mod map;
mod measurement;
mod nonlinearity;
mod options;
mod orbit;
mod outcome;
mod output;
mod phase;
mod pil;
mod pil_replay;
mod poincare;
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

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use outcome::{COULD_NOT_RUN, Outcome, could_not_run};
use std::io::ErrorKind;
use std::process::ExitCode;
use std::time::Duration;

/// Time limit for an interrupted job to write its results.
const GRACE: Duration = Duration::from_millis(900);

/// Simulate the steering ECU on the host, compare it with the firmware in QEMU, and analyse chaos
/// and its suppression by dither.
///
/// Exit codes: 0 verdict pass, 1 verdict fail, 2 could not run (missing tool, invalid input,
/// time-out). The last line gives the reason.
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
    Continue(continuation::Arguments),
    Regions(regions::Arguments),
    Equilibria(equilibria::Arguments),
    Basin(basin::Arguments),
    Feedback(feedback::Arguments),
    Phase(phase::Arguments),
    Poincare(poincare::Arguments),
    Spectrum(spectrum::Arguments),
    Tires(tires::Arguments),
    Nonlinearity(nonlinearity::Arguments),
    Map(map::Arguments),
    Schedule(schedule::Arguments),
    Realisability(realisability::Arguments),
    Faults(faults::Arguments),
    Fmu(fmu::Arguments),
    Config(config::Arguments),
    #[command(subcommand)]
    Firmware(firmware::Command),
    // Earlier names of the tools below `firmware`.
    #[command(hide = true)]
    Decode(firmware::decode::Arguments),
    #[command(hide = true)]
    Image(firmware::image::Arguments),
    #[command(hide = true)]
    Qemu(firmware::run::Arguments),
    #[cfg(feature = "manuals")]
    #[command(hide = true)]
    Manuals(manuals::Arguments),
}

/// Runs the command line.
pub fn main() -> ExitCode {
    let parsed = groups::show_in_groups(Cli::command())
        .try_get_matches()
        .and_then(|matches| Cli::from_arg_matches(&matches));
    let command = match parsed {
        Ok(cli) => cli.command,
        Err(usage) => return show(&usage),
    };
    if let Err(error) = ctrlc::set_handler(end_soon) {
        eprintln!("warning: Ctrl-C will end this program without writing results: {error}");
    }
    let done = interrupt::catch(|| run(command)).unwrap_or_else(|stopped| Err(stopped.into()));
    match done.and_then(|done| stdout::finish().map(|()| done)) {
        Ok(outcome) => outcome.into(),
        Err(error) => could_not_run(&error),
    }
}

/// On Ctrl-C or SIGTERM, long jobs finish their work in progress and write the results so far. A
/// second signal ends them immediately, as does the end of the grace period.
fn end_soon() {
    if interrupt::request() {
        std::process::exit(COULD_NOT_RUN.into());
    }
    std::thread::spawn(|| {
        std::thread::sleep(GRACE);
        eprintln!("error: interrupted; unwritten results are lost");
        std::process::exit(COULD_NOT_RUN.into());
    });
}

fn run(command: Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Pil(arguments) => pil::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Lyapunov(arguments) => lyapunov::run(&arguments),
        Command::Averaging(arguments) => averaging::run(&arguments),
        Command::Convergence(arguments) => convergence::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Continue(arguments) => continuation::run(&arguments),
        Command::Regions(arguments) => regions::run(&arguments),
        Command::Equilibria(arguments) => equilibria::run(&arguments),
        Command::Basin(arguments) => basin::run(&arguments),
        Command::Feedback(arguments) => feedback::run(&arguments),
        Command::Phase(arguments) => phase::run(&arguments),
        Command::Poincare(arguments) => poincare::run(&arguments),
        Command::Spectrum(arguments) => spectrum::run(&arguments),
        Command::Tires(arguments) => tires::run(&arguments),
        Command::Nonlinearity(arguments) => nonlinearity::run(&arguments),
        Command::Map(arguments) => map::run(&arguments),
        Command::Schedule(arguments) => schedule::run(&arguments),
        Command::Realisability(arguments) => realisability::run(&arguments),
        Command::Faults(arguments) => faults::run(&arguments),
        Command::Fmu(arguments) => fmu::run(&arguments),
        Command::Config(arguments) => config::run(&arguments),
        Command::Firmware(command) => firmware::run(&command),
        Command::Decode(arguments) => firmware::decode::run(&arguments),
        Command::Image(arguments) => firmware::image::run(&arguments),
        Command::Qemu(arguments) => firmware::run::run(&arguments),
        #[cfg(feature = "manuals")]
        Command::Manuals(arguments) => manuals::run(&arguments, Cli::command()),
    }
}

/// Prints a help text or an error of the command line.
fn show(usage: &clap::Error) -> ExitCode {
    let code = ExitCode::from(usage.exit_code() as u8);
    match usage.print() {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            could_not_run(&anyhow::Error::new(error).context("cannot write to standard output"))
        }
        _ => code,
    }
}
