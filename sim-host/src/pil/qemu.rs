//! The emulator: starts an image with its settings, shows its log, and ends with it.

use crate::pil::elf::Image;
use crate::pil::log::LogDecoder;
pub use crate::pil::socket::SocketError;
use std::io::Read;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

/// The emulator's program.
const PROGRAM: &str = "qemu-system-arm";
const POLL: Duration = Duration::from_millis(5);

pub use crate::interrupt::REQUESTED as INTERRUPTED;

/// A machine of the emulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Machine {
    /// Cortex-M4F.
    #[value(name = "mps2-an386")]
    Mps2An386,
    /// Cortex-M7.
    #[value(name = "mps2-an500")]
    Mps2An500,
    /// STM32F405, a Cortex-M4F, with timers that are those of the chip.
    #[value(name = "netduinoplus2")]
    NetduinoPlus2,
}

impl Machine {
    /// The emulator's name of it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Mps2An500 => "mps2-an500",
            Self::NetduinoPlus2 => "netduinoplus2",
        }
    }

    /// Clock of the PWM's timer that the board's firmware has, Hz.
    pub fn timer_clock_hz(self) -> f64 {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => 25e6,
            Self::NetduinoPlus2 => 16e6,
        }
    }

    /// The emulator's options for a host on `line` at the UART that the board's firmware links it with.
    pub(super) fn serial_options(self, line: &str) -> Vec<&str> {
        match self {
            // UART 0 is the console; UART 1 is the link.
            Self::Mps2An386 | Self::Mps2An500 => vec!["-serial", "null", "-serial", line],
            Self::NetduinoPlus2 => vec!["-serial", line],
        }
    }

    /// Its core.
    pub fn core(self) -> &'static str {
        match self {
            Self::Mps2An386 | Self::NetduinoPlus2 => "Cortex-M4F",
            Self::Mps2An500 => "Cortex-M7",
        }
    }

    /// The firmware's board whose images run on it.
    pub fn board(self) -> &'static str {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => "mps2",
            Self::NetduinoPlus2 => "netduinoplus2",
        }
    }

    /// Virtual time is counted in instructions, and idle time is skipped: the same run every time. An instruction takes 2^5
    /// ns; on the STM32F405 2^3 ns, because its timers run some ten times faster than the program believes.
    fn instruction_shift(self) -> u32 {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => 5,
            Self::NetduinoPlus2 => 3,
        }
    }

    /// Instructions that it executes in a second of its time.
    pub fn instruction_rate_hz(self) -> f64 {
        1e9 / f64::from(1 << self.instruction_shift())
    }
}

/// Why a run could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The emulator is not there.
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
        /// What it said last.
        last_line: String,
    },
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The emulator itself failed.
    #[error("{PROGRAM} failed ({status}): {message}")]
    EmulatorFailed {
        /// How it ended.
        status: ExitStatus,
        /// What it said.
        message: String,
    },
    /// The firmware ended, or closed its link, in the middle of a run.
    #[error(
        "the firmware left the loop{}; its last log line: {last_line}",
        exit_code.map(|code| format!(" with exit code {code} ({})", meaning(code))).unwrap_or_default()
    )]
    LinkLost {
        /// Its exit code, if it gave one.
        exit_code: Option<i32>,
        /// What it said last.
        last_line: String,
    },
    /// The log's symbols cannot be read.
    #[error("cannot decode the firmware's log: {0:#}")]
    Log(anyhow::Error),
    /// The emulator cannot be watched or steered from outside.
    #[error("cannot steer {PROGRAM}: {0}")]
    NotSteered(#[from] SocketError),
}

/// A finished run.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The firmware's exit code.
    pub exit_code: i32,
    /// Its log.
    pub log: Vec<String>,
}

/// The firmware's exit code when records were lost or a task was late.
pub const OVERRUN: i32 = 12;

/// What the firmware's exit code means.
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
        18 => "the twin in C gave other bits",
        _ => "unknown exit code",
    }
}

/// A running emulator, ended when dropped.
pub(super) struct Emulator(pub(super) Child);

impl Drop for Emulator {
    fn drop(&mut self) {
        // Fails only if it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs an image with the given settings in `directory`, where its telemetry goes; `on_line` sees its log as it comes.
///
/// # Errors
/// If the emulator is missing or fails, or the firmware does not end within `limit`. A firmware that ends with an exit code
/// of its own is a finished run.
pub fn run(
    image: &Image,
    machine: Machine,
    settings: &[String],
    directory: &Path,
    limit: Duration,
    on_line: impl Fn(&str) + Sync,
) -> Result<Finished, RunError> {
    let decoder = LogDecoder::new(image).map_err(RunError::Log)?;
    let emulator = start(image, machine, settings, directory, SILENT)?;
    attend(emulator, &decoder, limit, on_line)
}

/// Sees a run to its end.
pub(super) fn attend(
    mut emulator: Emulator,
    decoder: &LogDecoder,
    limit: Duration,
    on_line: impl Fn(&str) + Sync,
) -> Result<Finished, RunError> {
    let console = emulator.0.stdout.take().expect("stdout is piped");
    let errors = emulator.0.stderr.take().expect("stderr is piped");
    thread::scope(|scope| {
        let log = scope.spawn(|| {
            let mut lines = Vec::new();
            decoder.decode(console, |line| {
                on_line(line);
                lines.push(line.to_owned());
            });
            lines
        });
        let errors = scope.spawn(|| read_all(errors));
        let ended = wait(&mut emulator.0, limit);
        // Ends the pipes, and with them the two readers.
        drop(emulator);
        let log = log.join().expect("the log's reader does not panic");
        let message = errors.join().expect("the errors' reader does not panic");
        finish(ended?, log, message, limit)
    })
}

/// Options of an emulator without serial lines.
pub(super) const SILENT: &[&str] = &["-serial", "none"];

/// Starts the emulator; `options` are more of its own.
pub(super) fn start(
    image: &Image,
    machine: Machine,
    settings: &[String],
    directory: &Path,
    options: &[&str],
) -> Result<Emulator, RunError> {
    let mut semihosting = String::from("enable=on,target=native,arg=firmware");
    for setting in settings {
        // A comma ends an option of the emulator, two are one.
        semihosting += &format!(",arg={}", setting.replace(',', ",,"));
    }
    let image = std::path::absolute(&image.path).map_err(RunError::NotStarted)?;
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
        .args(["-semihosting-config", &semihosting])
        .arg("-kernel")
        .arg(image)
        .current_dir(directory)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    end_with_parent(&mut command);
    match command.spawn() {
        Ok(child) => Ok(Emulator(child)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(RunError::NoEmulator),
        Err(error) => Err(RunError::NotStarted(error)),
    }
}

/// Has the kernel end the emulator should this program be killed, when no destructor runs.
fn end_with_parent(command: &mut Command) {
    use std::os::unix::process::CommandExt;
    // SAFETY: between fork and exec only async-signal-safe calls are allowed, and prctl is one.
    unsafe {
        command.pre_exec(|| {
            let signal = Some(rustix::process::Signal::KILL);
            Ok(rustix::process::set_parent_process_death_signal(signal)?)
        });
    }
}

/// `None` if the time is over.
pub(super) fn wait(child: &mut Child, limit: Duration) -> Result<Option<ExitStatus>, RunError> {
    let start = Instant::now();
    while start.elapsed() < limit {
        if INTERRUPTED.load(Ordering::Relaxed) {
            return Err(RunError::Interrupted);
        }
        if let Some(status) = child.try_wait().map_err(RunError::NotStarted)? {
            return Ok(Some(status));
        }
        thread::sleep(POLL);
    }
    Ok(None)
}

fn finish(
    status: Option<ExitStatus>,
    log: Vec<String>,
    message: String,
    limit: Duration,
) -> Result<Finished, RunError> {
    let Some(status) = status else {
        let last_line = log.last().cloned().unwrap_or_else(|| "(none)".into());
        return Err(RunError::TimedOut { limit, last_line });
    };
    match status.code() {
        // The emulator's own failures end with 1 and a message; the firmware never ends with 1.
        Some(exit_code) if exit_code != 1 => Ok(Finished { exit_code, log }),
        _ => Err(RunError::EmulatorFailed {
            status,
            message: message.trim().into(),
        }),
    }
}

fn read_all(mut stream: ChildStderr) -> String {
    let mut bytes = Vec::new();
    // What could be read before an error is all there is to show.
    let _ = stream.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}
