//! `cargo xtask test`: every test and proof, up to the first that fails.

use anyhow::{Context, Result};

use super::stage;
use crate::outcome::Exit;
use crate::{firmware, process, rustup, setup, workspace};

/// Steps in debug, where overflow checks and debug assertions are on.
const MODEL: [&str; 2] = ["--package", "shared-model"];
/// The firmware's programs run in QEMU, started by tests of the host.
const HOST: [&str; 4] = ["--release", "--workspace", "--exclude", "firmware"];

/// Sets up, builds and tests.
pub fn run() -> Result<()> {
    let toolchain = stage("set-up", setup::tools)?;
    stage("firmware", || {
        firmware::build(&toolchain, &["--bin", "ecu", "--bin", "fault-drill"])
    })?;
    stage("panic-free proof", || prove_panic_free(&toolchain))?;
    stage("build of the model's tests", || {
        cargo_test(&MODEL, &["--no-run"])
    })?;
    stage("model tests with overflow checks", || tests(&MODEL))?;
    stage("build of all tests", || cargo_test(&HOST, &["--no-run"]))?;
    stage("all tests", || tests(&HOST))?;
    println!(
        "passed: the panic-free proof of the firmware, the model's tests with overflow checks, all tests in release"
    );
    Ok(())
}

/// Links the control path with a panic handler that calls a function which does not exist.
fn prove_panic_free(toolchain: &str) -> Result<()> {
    println!("   the link is the proof: it fails if a panic can be reached from the control path");
    let all = firmware::build(toolchain, &["--bins"]);
    all.context(Exit::failed("`panic-free` did not build; a missing function in the linker's message means that a panic can be reached"))?;
    println!("   panic-free linked: no panic can be reached");
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
