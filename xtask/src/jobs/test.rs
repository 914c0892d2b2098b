//! `cargo xtask test`: every test and proof, up to the first that fails.

use anyhow::{Context, Result};

use super::stage;
use crate::outcome::Exit;
use crate::{firmware, process, rustup, setup, workspace};

/// Steps in debug, where overflow checks and debug assertions are on.
const MODEL: [&str; 4] = ["--package", "shared-model", "--features", "serde"];
/// The firmware's programs run in QEMU, started by tests of the host.
const HOST: [&str; 4] = ["--release", "--workspace", "--exclude", "firmware"];

/// What the linker misses where a panic can be reached.
const MISSING_FUNCTION: &str = "a_panic_is_reachable_from_the_control_path";

/// Sets up, builds and tests.
pub fn run() -> Result<()> {
    let toolchain = stage("set-up", setup::tools)?;
    // Before any test: a comparison that would be left out is no pass.
    stage("Python packages of the tests", setup::python::ensure)?;
    for board in firmware::boards()? {
        stage(&format!("firmware for {board}"), || {
            firmware::build(
                &toolchain,
                &board,
                &["--bin", "ecu", "--bin", "fault-drill"],
            )
        })?;
        stage(&format!("panic-free proof for {board}"), || {
            prove_panic_free(&toolchain, &board)
        })?;
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
    Ok(())
}

/// Links the control path with a panic handler that calls a function which does not exist.
fn prove_panic_free(toolchain: &str, board: &str) -> Result<()> {
    println!("   the link is the proof: it fails if a panic can be reached from the control path");
    let all = firmware::build(toolchain, board, &["--bins"]);
    all.context(Exit::failed("`panic-free` did not build; a missing function in the linker's message means that a panic can be reached"))?;
    println!("   panic-free linked: no panic can be reached");

    // A proof that cannot fail is none: with a panic put into the path, the link must miss the function.
    let mut cargo = firmware::cargo(toolchain, "build", board)?;
    cargo.args(["--bin", "panic-free", "--features", "reachable-panic"]);
    let output = cargo.output().context("cargo does not start")?;
    let seen = String::from_utf8_lossy(&output.stderr).contains(MISSING_FUNCTION);
    if output.status.success() || !seen {
        let why = "`panic-free` with a panic in its path did not fail as it should: the proof proves nothing";
        return Err(Exit::failed(why).into());
    }
    println!("   with a panic put into the path it does not link: the proof can fail");
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
