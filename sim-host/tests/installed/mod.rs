//! A copy of the program, as if it were installed.

use std::path::Path;
use std::process::Command;

/// Copies the program to `to`. By another process: a program that this one has open for writing
/// cannot be started, and a test beside it that starts a process keeps it open for a moment.
pub fn copy_program(to: &Path) {
    let copied = Command::new("cp")
        .arg(env!("CARGO_BIN_EXE_sim-host"))
        .arg(to)
        .status();
    assert!(copied.expect("cp starts").success());
}
