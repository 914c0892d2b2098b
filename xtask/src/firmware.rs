//! Builds the firmware, with the toolchain that has the target.

use std::path::PathBuf;

use anyhow::Result;

use crate::setup::target::TARGET;
use crate::{process, rustup, workspace};

/// Arguments that choose the firmware's profile.
pub const PROFILE: [&str; 2] = ["--profile", "firmware"];

/// Builds the firmware's programs that `selection` names, or all of them for `["--bins"]`.
pub fn build(toolchain: &str, selection: &[&str]) -> Result<()> {
    let mut cargo = cargo(toolchain)?;
    cargo
        .arg("build")
        .args(PROFILE)
        .args(workspace::locked())
        .args(selection);
    process::run(&mut cargo)
}

/// Cargo in the firmware's folder, where its own configuration holds.
pub fn cargo(toolchain: &str) -> Result<std::process::Command> {
    let mut cargo = rustup::cargo(toolchain)?;
    cargo.current_dir(workspace::firmware());
    // These would replace what that configuration says: its target, and its linker arguments.
    for variable in [
        "RUSTFLAGS",
        "CARGO_ENCODED_RUSTFLAGS",
        "CARGO_BUILD_RUSTFLAGS",
        "CARGO_BUILD_TARGET",
    ] {
        cargo.env_remove(variable);
    }
    Ok(cargo)
}

/// The ECU's program.
pub fn elf() -> Result<PathBuf> {
    Ok(workspace::target_dir()?
        .join(TARGET)
        .join("firmware")
        .join("ecu"))
}
