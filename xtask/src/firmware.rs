//! Builds the firmware, with the toolchain that has the target.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::setup::probe::FIRMWARE;
use crate::{process, rustup, workspace};

/// The default board. Its images are where a plain `cargo build` puts them.
pub const USUAL_BOARD: &str = "mps2";

/// The feature that puts the product's bus on CAN.
pub const CAN: [&str; 2] = ["--features", "can"];

/// Cargo's variable for flags of the target's code alone.
const RUSTFLAGS_OF_TARGET: &str = "CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUSTFLAGS";

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

/// The firmware's programs.
const PROGRAMS: [&str; 3] = ["ecu", "bench", "panic-free"];

/// Builds the firmware's programs that `selection` names for a board, or all of them for
/// `["--bins"]`.
pub fn build(toolchain: &str, board: &str, selection: &[&str]) -> Result<()> {
    process::run(cargo(toolchain, "build", board)?.args(selection))?;
    let is_selected = |program: &&str| selection.contains(program) || selection == ["--bins"];
    for program in PROGRAMS.into_iter().filter(is_selected) {
        place(board, program, program)?;
    }
    Ok(())
}

/// Copies a program from where the boards are built to the board's own folder, as `name`: the
/// programs of all boards have the same names.
fn place(board: &str, program: &str, name: &str) -> Result<()> {
    let from = output(&build_dir(board)?, program);
    let to = elf(board, name)?;
    if from == to {
        return Ok(());
    }
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    // It may be a link to a file of cargo's.
    let _ = fs::remove_file(&to);
    let copied = fs::copy(&from, &to);
    copied.with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    Ok(())
}

/// Whether a board has a CAN.
pub fn has_can(board: &str) -> bool {
    let folder = workspace::firmware().join("src").join("board");
    folder.join(board).join("can.rs").exists()
}

/// Builds the product with its bus on CAN, and its panic-free proof, as `ecu-can` and
/// `panic-free-can`. The packages that it depends on are those of the other programs, so only the
/// firmware itself is compiled again. Before `build`, which makes the files of the other names.
pub fn build_can(toolchain: &str, board: &str) -> Result<()> {
    let mut cargo = cargo(toolchain, "build", board)?;
    let programs = ["ecu", "panic-free"];
    for program in programs {
        cargo.args(["--bin", program]);
    }
    process::run(cargo.args(CAN))?;
    for program in programs {
        place(board, program, &format!("{program}-can"))?;
    }
    Ok(())
}

/// A command of cargo on the firmware for a board, in the firmware's folder, where its own
/// configuration holds.
pub fn cargo(toolchain: &str, command: &str, board: &str) -> Result<Command> {
    let mut cargo = cargo_for_target(toolchain, command, &build_dir(board)?)?;
    cargo
        .arg("--no-default-features")
        .arg(format!("--features=board-{board}"));
    Ok(cargo)
}

/// A command of cargo on a package for the usual board.
pub fn cargo_on(toolchain: &str, command: &str, package: &str) -> Result<Command> {
    let mut cargo = cargo_for_target(toolchain, command, &build_dir(USUAL_BOARD)?)?;
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
    // A section with the frame of each function, for the bound of the stack. The option is not
    // stable yet; the code is the same with and without it.
    cargo
        .env("RUSTC_BOOTSTRAP", "1")
        .env(RUSTFLAGS_OF_TARGET, "-Zemit-stack-sizes");
    Ok(cargo)
}

/// An image for a board.
pub fn elf(board: &str, image: &str) -> Result<PathBuf> {
    let common = workspace::target_dir()?;
    let folder = match board {
        USUAL_BOARD => common,
        _ => common.join("boards").join(board),
    };
    Ok(output(&folder, image))
}

fn output(target_dir: &Path, image: &str) -> PathBuf {
    target_dir.join(FIRMWARE.name).join("firmware").join(image)
}

/// The usual board has the usual folder; all others share one, so that a board costs the packages of
/// its own chip and not those of all.
fn build_dir(board: &str) -> Result<PathBuf> {
    let common = workspace::target_dir()?;
    Ok(match board {
        USUAL_BOARD => common,
        _ => common.join("boards").join("shared"),
    })
}
