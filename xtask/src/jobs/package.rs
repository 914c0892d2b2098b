//! `cargo xtask package`: packs each publishable package and builds it from its package alone.

use anyhow::{Context, Result};

use super::stage;
use crate::outcome::Exit;
use crate::{process, rustup, workspace};

/// Packages that are of no use outside this checkout; their manifests forbid to publish them.
const OWN: [&str; 4] = ["c-reference", "firmware", "tests", "xtask"];

/// Packs all others and builds each from its package: four minutes on two cores.
pub fn run() -> Result<()> {
    let mut cargo = rustup::cargo(&workspace::pinned_channel()?)?;
    cargo
        .args(["package", "--workspace", "--allow-dirty"])
        .args(OWN.iter().flat_map(|package| ["--exclude", package]))
        .args(workspace::locked())
        // Only whether it builds matters, so it is not optimised.
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0")
        .env("CARGO_PROFILE_DEV_DEBUG", "false");
    stage("packages", || process::run(&mut cargo)).context(Exit::failed(
        "a package does not build; the output is above",
    ))?;
    println!("passed: every publishable package builds from its packed files");
    Ok(())
}
