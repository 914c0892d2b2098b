//! `cargo xtask firmware`.

use anyhow::{Context, Result};

use super::stage;
use crate::{firmware, rustup, setup};

/// Builds the firmware's programs and prints the path of the ECU's.
pub fn run() -> Result<()> {
    let pinned = rustup::require_pinned()?;
    let toolchain = setup::target::toolchain(&pinned)?;
    let toolchain = toolchain.with_context(|| {
        format!(
            "{} is missing: run `cargo xtask setup`",
            setup::target::TARGET
        )
    })?;
    stage("firmware", || firmware::build(&toolchain, &["--bins"]))?;
    println!("{}", firmware::elf()?.display());
    Ok(())
}
