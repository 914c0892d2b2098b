//! Outcome of a job: exit code and last line.

use std::process::ExitCode;

/// Exit code of a failed verdict.
pub const FAILED: u8 = 1;
/// Exit code of a job that could not run.
pub const COULD_NOT_RUN: u8 = 2;
/// The outcome of a completed job.
pub enum Outcome {
    /// Success, or a verdict of pass.
    Success,
    /// A verdict of fail.
    Failed,
    /// The exit code of another program.
    Code(u8),
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Success => Self::SUCCESS,
            Outcome::Failed => Self::from(FAILED),
            Outcome::Code(code) => Self::from(code),
        }
    }
}

/// Prints an error.
pub fn could_not_run(error: &anyhow::Error) -> ExitCode {
    eprintln!("error: {}", message(error));
    ExitCode::from(COULD_NOT_RUN)
}

/// The error and its causes, each once. Some messages already contain their cause.
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
