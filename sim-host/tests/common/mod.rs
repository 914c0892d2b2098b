//! The program as its user meets it, for the tests of the command line.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// An empty folder that goes with its test.
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder can be made")
}

/// The program in `folder`, not started yet.
pub fn command(folder: &Path, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sim-host"));
    command.args(arguments).current_dir(folder);
    command
}

/// Runs it and expects the exit code.
pub fn assert_ends(command: &mut Command, code: i32) -> Output {
    let output = command.output().expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{command:?}: {message}");
    output
}

/// Expects exit code 2 and an error message with all of `parts`.
pub fn assert_refused(
    folder: &Path,
    arguments: impl IntoIterator<Item = impl AsRef<OsStr>>,
    parts: &[&str],
) {
    let mut command = command(folder, arguments);
    let output = assert_ends(&mut command, 2);
    let message = String::from_utf8_lossy(&output.stderr);
    for part in parts {
        assert!(
            message.contains(part),
            "{command:?}: {message} lacks {part:?}"
        );
    }
}
