//! A run of an image in the emulator, from start to end, with its settings and its log.

use crate::emulator::{Emulator, first_words};
use crate::log::{Lines, LogDecoder, LogError};
use crate::machine::Machine;
use crate::socket::SocketError;
use image::Image;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// The emulator's program.
const PROGRAM: &str = "qemu-system-arm";
const POLL: Duration = Duration::from_millis(5);
/// Part of the last log line of every image that ends with exit code 0 (`firmware/src/app.rs`).
const COMPLETE: &str = "run complete";

/// An error of a run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The emulator is missing.
    #[error(
        "{PROGRAM} is not installed; run `cargo xtask setup`, or install QEMU for Arm (Debian: apt-get install qemu-system-arm)"
    )]
    NoEmulator,
    /// The emulator cannot be started.
    #[error("cannot start {PROGRAM}: {0}")]
    NotStarted(std::io::Error),
    /// The firmware did not end in time.
    #[error("the firmware did not end within {} s and was stopped; its last log line: {last_line}", limit.as_secs_f64())]
    TimedOut {
        /// The time-out.
        limit: Duration,
        /// The last log line.
        last_line: String,
    },
    /// The user interrupted the run.
    #[error("interrupted")]
    Interrupted,
    /// The emulator itself failed.
    #[error(
        "{PROGRAM} itself failed ({status}){}",
        if message.is_empty() { " without a message".into() } else { format!(": {message}") }
    )]
    EmulatorFailed {
        /// How it ended: its exit code, or the signal that ended it.
        status: ExitStatus,
        /// Its message.
        message: String,
    },
    /// A program other than the firmware ended with exit code 0.
    #[error(
        "{PROGRAM} ended with exit code 0, but without the firmware's last log line, {COMPLETE:?} (the last one was: \
         {last_line}); check that the image is one of this firmware and that `{PROGRAM} --version` is QEMU"
    )]
    NotComplete {
        /// The last line.
        last_line: String,
    },
    /// The image has no symbols for its log, which shows whether the run was complete.
    #[error(
        "the image has no defmt symbols, so its log cannot be read; give the ELF that `cargo xtask firmware` builds, not a \
         stripped one"
    )]
    NoLog,
    /// The firmware ended, or closed its link, in the middle of a run.
    #[error(
        "the firmware left the loop {}; its last log line: {last_line}",
        match exit_code {
            Some(code) => format!("with exit code {code} ({})", meaning(*code)),
            None => "in a lockup of the core, a fault within the handler of a fault".into(),
        }
    )]
    LinkLost {
        /// Its exit code; none if the core locked up.
        exit_code: Option<i32>,
        /// The last log line.
        last_line: String,
    },
    /// A fault after the servo's pin, over a link that has none.
    #[error(
        "the duty captured on the servo's pin is not the one that the firmware put out ({sent} counts), but {captured} counts: the link `ticks` cannot carry it; use `files` or `timed`"
    )]
    CapturedDuty {
        /// The firmware's duty code.
        sent: u16,
        /// The captured one.
        captured: u16,
    },
    /// The image lacks a symbol of this firmware.
    #[error(
        "the image has no {name}: it must be this project's image `ecu`; build it with `cargo xtask firmware`"
    )]
    NoSymbol {
        /// Name of the symbol.
        name: &'static str,
    },
    /// The log's symbols are invalid.
    #[error("cannot decode the firmware's log: {0}")]
    Log(#[from] LogError),
    /// The emulator cannot be debugged.
    #[error("cannot debug {PROGRAM}: {0}")]
    NotSteered(#[from] SocketError),
}

/// A finished run.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The firmware's exit code. It is 0 only if the log confirms that the run is complete, or is
    /// not readable.
    pub exit_code: i32,
    /// The last lines of its log.
    pub log: Vec<String>,
}

/// The firmware's exit code when records were lost or a task was late.
pub const OVERRUN: i32 = 12;

/// The meaning of the firmware's exit code.
pub fn meaning(exit_code: i32) -> &'static str {
    match exit_code {
        0 => "the run is complete",
        10 => "the scenario was refused",
        11 => "the telemetry file cannot be written",
        OVERRUN => "overrun: records were lost, or a control task was not done in its period",
        13 => "panic; the PWM was put to neutral",
        14 => "hard fault; the PWM was put to neutral",
        15 => "the watchdog bit; the PWM was put to neutral",
        16 => "unexpected interrupt; the PWM was put to neutral",
        17 => "the link to the vehicle is lost; the PWM was put to neutral",
        _ => "unknown exit code",
    }
}

/// Runs an image with the given settings in `directory`, into which it writes its telemetry.
/// `on_line` is called with each log line.
///
/// # Errors
/// If the emulator is missing or fails, the image has no readable log, the firmware does not end
/// within `limit`, or exit code 0 comes without the log line of a complete run. A firmware that
/// ends with another exit code is a finished run.
pub fn run(
    image: &Image,
    machine: Machine,
    settings: &[String],
    directory: &Path,
    limit: Duration,
    on_line: &(dyn Fn(&str) + Sync),
) -> Result<Finished, RunError> {
    let decoder = LogDecoder::new(image)?;
    if !decoder.is_readable() {
        return Err(RunError::NoLog);
    }
    run_with(
        &decoder, image, machine, settings, directory, limit, on_line,
    )
}

/// As [`run`], but also without a readable log. The exit code alone then determines the outcome.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    decoder: &LogDecoder,
    image: &Image,
    machine: Machine,
    settings: &[String],
    directory: &Path,
    limit: Duration,
    on_line: &(dyn Fn(&str) + Sync),
) -> Result<Finished, RunError> {
    let emulator = start(image, machine, settings, directory, SILENT)?;
    attend(emulator, decoder, limit, on_line)
}

/// Waits for the end of a run.
pub(crate) fn attend(
    mut emulator: Emulator,
    decoder: &LogDecoder,
    limit: Duration,
    on_line: &(dyn Fn(&str) + Sync),
) -> Result<Finished, RunError> {
    let mut console = emulator.output();
    let errors = emulator.errors();
    thread::scope(|scope| {
        let log = scope.spawn(|| {
            let mut lines = Lines::default();
            decoder.decode(&mut console, &mut |line| {
                on_line(line);
                lines.push(line);
            });
            lines.into_vec()
        });
        let errors = scope.spawn(|| first_words(errors));
        let ended = wait(&mut emulator, limit);
        // Closes the pipes, which ends both readers.
        drop(emulator);
        let log = log.join().expect("the log's reader does not panic");
        let message = errors.join().expect("the errors' reader does not panic");
        let Some(status) = ended? else {
            let last_line = last_of(&log);
            return Err(RunError::TimedOut { limit, last_line });
        };
        finish(status, log, message, decoder.is_readable())
    })
}

/// Options of an emulator without serial lines.
pub(crate) const SILENT: &[&str] = &["-serial", "none"];

/// Starts the emulator with semihosting, the scenario's settings and additional `options`.
pub(crate) fn start(
    image: &Image,
    machine: Machine,
    settings: &[String],
    directory: &Path,
    options: &[&str],
) -> Result<Emulator, RunError> {
    let mut semihosting = String::from("enable=on,target=native,arg=firmware");
    for setting in settings {
        // A comma ends an option of the emulator; a double comma is a literal one.
        semihosting += &format!(",arg={}", setting.replace(',', ",,"));
    }
    let options = [options, &["-semihosting-config", &semihosting]].concat();
    start_alone(&image.path, machine, directory, &options)
}

/// Starts the emulator without semihosting, with additional `options`.
pub(crate) fn start_alone(
    elf: &Path,
    machine: Machine,
    directory: &Path,
    options: &[&str],
) -> Result<Emulator, RunError> {
    let elf = std::path::absolute(elf).map_err(RunError::NotStarted)?;
    let mut command = Command::new(PROGRAM);
    command
        .args(["-machine", machine.name(), "-display", "none"])
        .args(["-monitor", "none"])
        .arg("-icount")
        .arg(format!(
            "shift={},align=off,sleep=off",
            machine.instruction_shift()
        ))
        .args(options)
        .arg("-kernel")
        .arg(elf)
        .current_dir(directory)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    match Emulator::spawn(&mut command) {
        Ok(emulator) => Ok(emulator),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(RunError::NoEmulator),
        Err(error) => Err(RunError::NotStarted(error)),
    }
}

/// `None` after a time-out.
pub(crate) fn wait(
    emulator: &mut Emulator,
    limit: Duration,
) -> Result<Option<ExitStatus>, RunError> {
    let start = Instant::now();
    while start.elapsed() < limit {
        if interrupt::requested() {
            return Err(RunError::Interrupted);
        }
        if let Some(status) = emulator.try_wait().map_err(RunError::NotStarted)? {
            return Ok(Some(status));
        }
        thread::sleep(POLL);
    }
    Ok(None)
}

/// Determines the outcome of a run whose emulator has ended.
pub(crate) fn finish(
    status: ExitStatus,
    log: Vec<String>,
    message: String,
    is_readable: bool,
) -> Result<Finished, RunError> {
    let exit_code = exit_code(status, message)?;
    let is_complete = || log.last().is_some_and(|line| line.contains(COMPLETE));
    if exit_code == 0 && is_readable && !is_complete() {
        let last_line = last_of(&log);
        return Err(RunError::NotComplete { last_line });
    }
    Ok(Finished { exit_code, log })
}

/// The firmware's exit code. The emulator's own failures end with 1 and a message, or by a signal;
/// the firmware never ends with 1.
pub(crate) fn exit_code(status: ExitStatus, message: String) -> Result<i32, RunError> {
    match status.code() {
        Some(exit_code) if exit_code != 1 => Ok(exit_code),
        _ => Err(RunError::EmulatorFailed { status, message }),
    }
}

fn last_of(log: &[String]) -> String {
    log.last().cloned().unwrap_or_else(|| "(none)".into())
}
