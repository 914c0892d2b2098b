//! Exit codes: 0 passed, 1 a test or a verdict failed, 2 it could not run.

use std::fmt;
use std::process::ExitCode;

/// The code of an error other than [`Exit`]: the command could not run.
pub const COULD_NOT_RUN: u8 = 2;

/// An error that ends xtask with a code of its own.
#[derive(Debug)]
pub struct Exit {
    code: u8,
    why: String,
}

impl Exit {
    /// A test or a proof ran, and failed.
    pub fn failed(why: impl Into<String>) -> Self {
        Self::with_code(1, why)
    }

    /// A code that another program ended with, passed on.
    pub fn with_code(code: u8, why: impl Into<String>) -> Self {
        Self {
            code,
            why: why.into(),
        }
    }
}

impl fmt::Display for Exit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)
    }
}

impl std::error::Error for Exit {}

/// The exit code a result stands for.
fn code(result: &anyhow::Result<()>) -> u8 {
    match result {
        Ok(()) => 0,
        Err(error) => error
            .downcast_ref::<Exit>()
            .map_or(COULD_NOT_RUN, |exit| exit.code),
    }
}

/// Prints the reason on the last line, and turns the result into xtask's exit code.
pub fn report(result: anyhow::Result<()>) -> ExitCode {
    if let Err(error) = &result {
        eprintln!("xtask: {error:#}");
    }
    ExitCode::from(code(&result))
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context, anyhow};

    #[test]
    fn codes_are_distinct() {
        assert_eq!(code(&Ok(())), 0);
        assert_eq!(code(&Err(anyhow!("no such tool"))), 2);
        assert_eq!(code(&Err(Exit::failed("a test failed").into())), 1);
        assert_eq!(code(&Err(Exit::with_code(7, "odd").into())), 7);
    }

    #[test]
    fn context_keeps_the_code() {
        let result: anyhow::Result<()> = Err(Exit::failed("a test failed").into());
        assert_eq!(code(&result.context("stage 3")), 1);
    }
}
