//! The scenario from the command line that the emulator was started with.

use super::pace::Pace;
use crate::board::{Board, Current};
use cortex_m_semihosting::syscall1;
use shared_model::Scenario;
use shared_model::settings::SettingError;

/// SYS_GET_CMDLINE.
const GET_COMMAND_LINE: usize = 0x15;
/// Longest command line, bytes.
const MAX_BYTES: usize = 4096;
/// Key of the telemetry file's path.
const TELEMETRY: &str = "telemetry=";
/// Key of the link's name.
const LINK: &str = "link=";
/// Key of the pace of a run without a link.
const PACE: &str = "pace=";
/// Key of a preset, which replaces the whole scenario.
const PRESET: &str = "preset=";

/// Key of a fault to provoke, which replaces the run; all other settings are ignored.
const FAULT: &str = "fault=";

/// Content of the command line.
pub enum Command {
    /// A run.
    Run(Run),
    /// A fault to provoke, by its name.
    Drill(&'static str),
}

/// A run's settings.
pub struct Run {
    /// The scenario, not yet validated.
    pub scenario: Scenario<f32>,
    /// Path of the telemetry file on the host, if telemetry is requested.
    pub telemetry: Option<&'static str>,
    /// Name of the link to a vehicle, if the ECU is to steer one.
    pub link: Option<&'static str>,
    /// The pace of a run without a link; a link has its own.
    pub pace: Pace,
}

/// Reason why the command line was refused.
pub enum CommandError {
    /// The host gives none, or a longer one than the buffer holds.
    Unreadable,
    /// A setting that is not one.
    Setting(&'static str, SettingError),
}

/// Reads the command line: the image's name, then settings, separated by blanks.
///
/// # Errors
/// If it cannot be read or has a setting that is not one.
pub fn read() -> Result<Command, CommandError> {
    parse(text().ok_or(CommandError::Unreadable)?)
}

/// The command line; `None` if the host has none or a longer one than the buffer, or at the second
/// call.
fn text() -> Option<&'static str> {
    let buffer = cortex_m::singleton!(: [u8; MAX_BYTES] = [0; MAX_BYTES])?;
    let mut block = [buffer.as_mut_ptr() as usize, MAX_BYTES];
    // SAFETY: the operation writes at most MAX_BYTES bytes of the buffer and both words of the
    // block.
    let failed = unsafe { syscall1(GET_COMMAND_LINE, block.as_mut_ptr() as usize) };
    let text = core::str::from_utf8(buffer.get(..block[1])?).ok()?;
    (failed == 0).then_some(text.trim_end_matches('\0'))
}

fn parse(text: &'static str) -> Result<Command, CommandError> {
    let words = || text.split_ascii_whitespace().skip(1);
    if let Some(name) = words().find_map(|word| word.strip_prefix(FAULT)) {
        return Ok(Command::Drill(name));
    }
    let mut run = Run {
        scenario: Scenario::reconstruction(),
        telemetry: None,
        link: None,
        pace: Pace::Timer,
    };
    let timer_clock_hz = Current::TIMER_CLOCK_HZ as f32;
    run.scenario.servo.timer_clock_hz = timer_clock_hz;
    for word in words() {
        if let Some(path) = word.strip_prefix(TELEMETRY) {
            run.telemetry = Some(path);
        } else if let Some(name) = word.strip_prefix(LINK) {
            run.link = Some(name);
        } else if let Some(name) = word.strip_prefix(PACE) {
            let error = CommandError::Setting(word, SettingError::UnknownChoice);
            run.pace = Pace::of(name).ok_or(error)?;
        } else {
            let applied = run.scenario.apply(word);
            applied.map_err(|error| CommandError::Setting(word, error))?;
        }
        // A preset is one for any board.
        if word.starts_with(PRESET) {
            run.scenario.servo.timer_clock_hz = timer_clock_hz;
        }
    }
    Ok(Command::Run(run))
}
