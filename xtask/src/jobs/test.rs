//! `cargo xtask test`: every test and proof, up to the first that fails.

use anyhow::{Context, Result};

use super::{page, proofs, stage, target_cost};
use crate::outcome::Exit;
use crate::{process, rustup, setup, workspace};

/// Steps in debug, where overflow checks and debug assertions are on.
const MODEL: [&str; 4] = ["--package", "shared-model", "--features", "serde"];
/// The firmware's programs run in QEMU, started by tests of the host.
const HOST: [&str; 4] = ["--release", "--workspace", "--exclude", "firmware"];

/// Sets up, builds and tests.
pub fn run() -> Result<()> {
    let toolchain = stage("set-up", setup::tools)?;
    // Before any test: a comparison that would be left out is no pass.
    stage("Python packages of the tests", setup::python::ensure)?;
    let for_browser = stage("target of the page", || {
        setup::target::ensure(&setup::probe::BROWSER)
    })?;
    // Not every machine has a browser.
    let browser = stage("browser of the page's test", setup::browser::ensure);
    // Nor is every user root.
    let slurm = stage("Slurm of the cluster's test", setup::slurm::ensure);
    proofs::build(&toolchain)?;
    page::build(&for_browser)?;
    if target_cost::has_c_compiler() {
        target_cost::build(&toolchain)?;
    }
    stage("build of the model's tests", || {
        cargo_test(&MODEL, &["--no-run"])
    })?;
    stage("model tests with overflow checks", || tests(&MODEL))?;
    stage("build of all tests", || cargo_test(&HOST, &["--no-run"]))?;
    stage("all tests", || tests(&HOST))?;
    println!(
        "passed: the panic-free proof of the firmware for every board, the model's tests with overflow checks, all tests in release"
    );
    let optional = [
        ("the page in a browser", browser),
        ("the map on Slurm", slurm),
    ];
    for (what, outcome) in optional {
        if let Err(error) = outcome {
            println!("   UNTESTED: {what}: {error:#}");
        }
    }
    println!("   slow proofs, not run: cargo xtask package, mutants, coverage, fuzz");
    Ok(())
}

fn tests(selection: &[&str]) -> Result<()> {
    let ran = cargo_test(selection, &[]);
    ran.context(Exit::failed("a test failed; its output is above"))
}

fn cargo_test(selection: &[&str], more: &[&str]) -> Result<()> {
    let mut cargo = rustup::cargo(&workspace::pinned_channel()?)?;
    cargo
        .arg("test")
        .args(selection)
        .args(more)
        .args(workspace::locked());
    process::run(&mut cargo)
}
