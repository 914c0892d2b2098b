//! Builds the firmware, with the toolchain that has the target.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::setup::probe::TARGET;
use crate::{process, rustup, workspace};

/// The default board. Its images are where a plain `cargo build` puts them.
pub const USUAL_BOARD: &str = "mps2";

/// All boards: the folders in the firmware's `src/board`.
pub fn boards() -> Result<Vec<String>> {
    let folder = workspace::firmware().join("src").join("board");
    let entries = fs::read_dir(&folder);
    let entries = entries.with_context(|| format!("cannot read {}", folder.display()))?;
    let folders = entries.flatten().filter(|entry| entry.path().is_dir());
    let mut boards: Vec<String> = folders
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    boards.sort();
    Ok(boards)
}

/// Builds the firmware's programs that `selection` names for a board, or all of them for
/// `["--bins"]`.
pub fn build(toolchain: &str, board: &str, selection: &[&str]) -> Result<()> {
    process::run(cargo(toolchain, "build", board)?.args(selection))
}

/// A command of cargo on the firmware for a board, in the firmware's folder, where its own
/// configuration holds.
pub fn cargo(toolchain: &str, command: &str, board: &str) -> Result<Command> {
    cargo_into(toolchain, command, board, &target_dir(board)?)
}

fn cargo_into(toolchain: &str, command: &str, board: &str, target_dir: &Path) -> Result<Command> {
    let mut cargo = cargo_for_target(toolchain, command, target_dir)?;
    cargo
        .arg("--no-default-features")
        .arg(format!("--features=board-{board}"));
    Ok(cargo)
}

/// A command of cargo on a package for the usual board.
pub fn cargo_on(toolchain: &str, command: &str, package: &str) -> Result<Command> {
    let mut cargo = cargo_for_target(toolchain, command, &target_dir(USUAL_BOARD)?)?;
    cargo.args(["--package", package]);
    Ok(cargo)
}

fn cargo_for_target(toolchain: &str, command: &str, target_dir: &Path) -> Result<Command> {
    let mut cargo = rustup::cargo(toolchain)?;
    cargo
        .current_dir(workspace::firmware())
        .arg(command)
        .args(["--profile", "firmware"])
        .args(workspace::locked())
        .arg("--target-dir")
        .arg(target_dir);
    // These would override that configuration: its target, and its linker arguments.
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

/// A build of the ECU's program with a section `.stack_sizes`, the frame of each function, in a
/// folder of its own.
///
/// The option is not stable yet. For one crate alone it may still be used, and as that crate's
/// compilation makes the code of all others, too, the frames are those of the whole program. The
/// code is that of [`build`].
pub fn framed(toolchain: &str, board: &str) -> Result<Command> {
    let mut cargo = cargo_into(toolchain, "rustc", board, &framed_target_dir(board)?)?;
    cargo
        .env("RUSTC_BOOTSTRAP", "ecu")
        .args(["--bin", "ecu", "--", "-Zemit-stack-sizes"]);
    Ok(cargo)
}

/// The image that [`framed`] builds.
pub fn framed_elf(board: &str) -> Result<PathBuf> {
    Ok(framed_target_dir(board)?
        .join(TARGET)
        .join("firmware")
        .join("ecu"))
}

fn framed_target_dir(board: &str) -> Result<PathBuf> {
    Ok(workspace::target_dir()?.join("stack-sizes").join(board))
}

/// The ECU's program for a board.
pub fn elf(board: &str) -> Result<PathBuf> {
    Ok(target_dir(board)?.join(TARGET).join("firmware").join("ecu"))
}

/// One for each board, or their programs, which have the same names, would replace each other.
fn target_dir(board: &str) -> Result<PathBuf> {
    let common = workspace::target_dir()?;
    Ok(match board {
        USUAL_BOARD => common,
        _ => common.join("boards").join(board),
    })
}
