//! Refused scenarios: the reason in the log, and the exit code.

use super::command_line::CommandError;
use super::exit::ExitCode;
use crate::board::{Board, Current};
use crate::refusal::log_invalid_scenario;
use shared_model::InvalidScenario;

/// For a command line that cannot be read, or a word of it that is no setting.
pub fn refuse_command(error: &CommandError) -> ExitCode {
    match error {
        CommandError::Unreadable => defmt::error!("scenario refused: no readable command line"),
        CommandError::Setting(word, error) => {
            defmt::error!("scenario refused: {=str}: {=str}", word, error.reason());
        }
    }
    ExitCode::BadScenario
}

/// For a scenario that cannot be run.
pub fn refuse_scenario(error: &InvalidScenario) -> ExitCode {
    log_invalid_scenario(error);
    ExitCode::BadScenario
}

/// For a scenario with the timer clock of another board.
pub fn refuse_timer_clock(timer_clock_hz: f32) -> ExitCode {
    defmt::error!(
        "scenario refused: servo.timer_clock_hz = {=f32}: must be {=u32}, this board's",
        timer_clock_hz,
        Current::TIMER_CLOCK_HZ
    );
    ExitCode::BadScenario
}
