//! `cargo xtask firmware`.

use anyhow::{Context, Result, bail};

use super::stage;
use crate::{firmware, rustup, setup};

/// What stands for every board.
const ALL: &str = "all";

/// Builds the firmware's programs for `board`, or for all boards, and prints the path of each
/// bench image. A board with a CAN has `ecu-can` beside it.
pub fn run(board: &str) -> Result<()> {
    let known = firmware::boards()?;
    let chosen: Vec<&str> = match known.iter().find(|known| *known == board) {
        Some(board) => vec![board],
        None if board == ALL => known.iter().map(String::as_str).collect(),
        None => bail!("no board {board}: choose {} or {ALL}", known.join(", ")),
    };
    let pinned = rustup::require_pinned()?;
    let toolchain = setup::target::toolchain(&setup::probe::FIRMWARE, &pinned)?;
    let toolchain = toolchain.with_context(|| {
        format!(
            "{} is missing: run `cargo xtask setup`",
            setup::probe::FIRMWARE.name
        )
    })?;
    for board in &chosen {
        if firmware::has_can(board) {
            stage(&format!("firmware with CAN for {board}"), || {
                firmware::build_can(&toolchain, board)
            })?;
        }
        stage(&format!("firmware for {board}"), || {
            firmware::build(&toolchain, board, &["--bins"])
        })?;
    }
    for board in chosen {
        println!("{}", firmware::elf(board, "bench")?.display());
    }
    Ok(())
}
