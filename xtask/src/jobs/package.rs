//! `cargo xtask package`: packs each publishable package and builds it from its package alone.

use anyhow::{Context, Result};

use super::stage;
use crate::outcome::Exit;
use crate::{process, rustup, workspace};

/// Packages that are of no use outside this checkout; their manifests forbid to publish them.
const OWN: [&str; 5] = ["c-reference", "firmware", "page", "tests", "xtask"];

/// Packs all others and builds each from its package: four minutes on two cores.
pub fn run() -> Result<()> {
    // A folder of its own for each run: cargo unpacks the packages by the folder's path and their version, and would
    // take those of an earlier run at the same path.
    let folder = workspace::target_dir()?.join(format!("packages-{}", std::process::id()));
    let mut cargo = rustup::cargo(&workspace::pinned_channel()?)?;
    cargo
        .args(["package", "--workspace", "--allow-dirty"])
        .args(OWN.iter().flat_map(|package| ["--exclude", package]))
        .args(workspace::locked())
        .arg("--target-dir")
        .arg(&folder)
        // Only whether it builds matters, so it is not optimised.
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0")
        .env("CARGO_PROFILE_DEV_DEBUG", "false");
    let built = stage("packages", || process::run(&mut cargo));
    // What is left of it does no harm.
    let _ = std::fs::remove_dir_all(&folder);
    built.context(Exit::failed(
        "a package does not build; the output is above",
    ))?;
    println!("passed: every publishable package builds from its packed files");
    Ok(())
}
