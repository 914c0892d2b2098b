//! `cargo xtask lint`: format and clippy, warnings are errors.

use anyhow::{Context, Result, bail};

use super::stage;
use crate::outcome::Exit;
use crate::{firmware, process, rustup, setup, workspace};

const DENY_WARNINGS: [&str; 3] = ["--", "-D", "warnings"];

/// Checks the format of everything, then lints host and firmware.
pub fn run() -> Result<()> {
    let pinned = rustup::require_pinned()?;
    require_components(&pinned)?;
    stage("format", || format(&pinned))?;
    stage("clippy on the host's packages", || host(&pinned))?;
    stage("API documentation", || documentation(&pinned))?;
    // Only the pinned toolchain has a clippy.
    if setup::target::toolchain(&setup::probe::FIRMWARE, &pinned)?.as_ref() != Some(&pinned) {
        bail!(
            "format and host are clean, but the firmware is not linted: {}",
            setup::target::missing(&setup::probe::FIRMWARE, &pinned)
        );
    }
    for board in firmware::boards()? {
        stage(&format!("clippy on the firmware for {board}"), || {
            firmware(&pinned, &board)?;
            if firmware::has_can(&board) {
                clippy(
                    firmware::cargo(&pinned, "clippy", &board)?
                        .args(["--bin", "ecu"])
                        .args(firmware::CAN),
                )?;
            }
            Ok(())
        })?;
    }
    println!("passed: format, clippy on host and firmware");
    Ok(())
}

fn require_components(pinned: &str) -> Result<()> {
    for (component, program) in [("rustfmt", "rustfmt"), ("clippy", "cargo-clippy")] {
        if process::capture(rustup::tool(pinned, program)?.arg("--version")).is_none() {
            bail!(
                "{component} is missing: run `rustup component add --toolchain {pinned} rustfmt clippy`, then this again"
            );
        }
    }
    Ok(())
}

fn format(pinned: &str) -> Result<()> {
    let done = process::run(rustup::cargo(pinned)?.args(["fmt", "--all", "--check"]));
    done.context(Exit::failed("the format differs: run `cargo fmt --all`"))
}

fn documentation(pinned: &str) -> Result<()> {
    let mut cargo = rustup::cargo(pinned)?;
    cargo
        .args(["doc", "--no-deps", "--workspace", "--exclude", "firmware"])
        .args(workspace::locked())
        .env("RUSTDOCFLAGS", DENY_WARNINGS[1..].join(" "));
    let done = process::run(&mut cargo);
    done.context(Exit::failed(
        "the documentation has warnings; they are above",
    ))
}

fn host(pinned: &str) -> Result<()> {
    let mut cargo = rustup::cargo(pinned)?;
    cargo
        .args(["clippy", "--workspace", "--exclude", "firmware"])
        .arg("--all-targets")
        .args(workspace::locked());
    clippy(&mut cargo)
}

fn firmware(pinned: &str, board: &str) -> Result<()> {
    clippy(firmware::cargo(pinned, "clippy", board)?.arg("--bins"))
}

fn clippy(cargo: &mut std::process::Command) -> Result<()> {
    let done = process::run(cargo.args(DENY_WARNINGS));
    done.context(Exit::failed("clippy found something; it is named above"))
}
