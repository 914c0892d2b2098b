//! The commands that build and test: each a few stages, with their times.

pub mod coverage;
pub mod demo;
pub mod firmware;
pub mod fuzz;
pub mod lint;
pub mod mutants;
pub mod package;
pub mod page;
pub mod proofs;
pub mod setup;
pub mod target_cost;
pub mod test;

use std::time::Instant;

use anyhow::{Context, Result};

use crate::{process, rustup, workspace};

/// Runs one stage: prints its name before, and its time after; an error carries its name.
fn stage<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    println!("== {name}");
    let started = Instant::now();
    let result = work();
    let how = if result.is_ok() { "done" } else { "FAILED" };
    println!(
        "== {name}: {how} in {:.1} s",
        started.elapsed().as_secs_f64()
    );
    result.with_context(|| format!("stage `{name}`"))
}

/// Builds the host's program, which is also the runner of the firmware's folder.
fn build_sim_host() -> Result<()> {
    let mut cargo = rustup::cargo(&workspace::pinned_channel()?)?;
    cargo
        .args(["build", "--release", "--package", "sim-host"])
        .args(workspace::locked());
    process::run(&mut cargo)
}
