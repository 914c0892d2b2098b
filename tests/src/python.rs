//! Python with the packages of the tests.

use crate::{root, target};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// A script of `tests/python` in the Python of `cargo xtask setup`, to be started with further
/// arguments.
///
/// # Panics
/// If it is not there with the packages as pinned: a comparison that cannot be made has not passed.
pub fn script(name: &str) -> Command {
    let mut command = Command::new(interpreter());
    // Isolated: no other packages by way of the environment.
    command
        .arg("-I")
        .arg(root().join("tests/python").join(name));
    command
}

fn interpreter() -> PathBuf {
    let folder = target().join("python");
    // Set-up leaves this copy when everything is installed.
    let installed = fs::read_to_string(folder.join("requirements.txt")).unwrap_or_default();
    assert!(
        installed == include_str!("../python/requirements.txt"),
        "untested: {} does not have the packages of tests/python/requirements.txt: run `cargo xtask setup`",
        folder.display()
    );
    folder.join("bin/python")
}
