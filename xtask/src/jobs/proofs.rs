//! `cargo xtask proofs`: proofs about the firmware.

use anyhow::{Context, Result};

use super::stage;
use crate::outcome::Exit;
use crate::{firmware, process, rustup, setup, workspace};

/// The undefined function that the linker reports where a panic is reachable.
const MISSING_FUNCTION: &str = "a_panic_is_reachable_from_the_control_path";
const NOT_LINKED: &str = "`panic-free` did not build; a missing function in the linker's message means that a panic can be reached";
/// The tests that compare with tests/golden.
const TESTS: [&str; 8] = [
    "test",
    "--release",
    "--package",
    "tests",
    "--test",
    "proofs",
    "--test",
    "unsafe_code",
];
/// Makes those tests write the expected figures.
const OVERWRITE: &str = "DITHERSTEER_OVERWRITE_EXPECTED";

/// Builds the images, and compares their proved figures with the recorded ones, or records them.
pub fn run(overwrite_expected: bool) -> Result<()> {
    let toolchain = stage("set-up", setup::tools)?;
    build(&toolchain)?;
    stage("proofs", || {
        let mut cargo = rustup::cargo(&workspace::pinned_channel()?)?;
        cargo.args(TESTS).args(workspace::locked());
        if overwrite_expected {
            cargo.env(OVERWRITE, "1");
        }
        let ran = process::run(&mut cargo);
        ran.context(Exit::failed("a proof failed; its output is above"))
    })?;
    if overwrite_expected {
        println!("recorded in tests/golden: review `git diff tests/golden`");
    } else {
        println!("passed: the panic-free link, and all figures of tests/golden");
    }
    Ok(())
}

/// Every board's images, and the panic-free proof with them.
pub fn build(toolchain: &str) -> Result<()> {
    for board in firmware::boards()? {
        if firmware::has_can(&board) {
            stage(
                &format!("CAN, with its panic-free proof, for {board}"),
                || {
                    let built = firmware::build_can(toolchain, &board);
                    built.context(Exit::failed(NOT_LINKED))
                },
            )?;
        }
        stage(&format!("firmware for {board}"), || {
            firmware::build(toolchain, &board, &["--bin", "ecu", "--bin", "bench"])
        })?;
        stage(&format!("panic-free proof for {board}"), || {
            prove_panic_free(toolchain, &board)
        })?;
    }
    Ok(())
}

/// Links the control path with a panic handler that calls a function which does not exist.
fn prove_panic_free(toolchain: &str, board: &str) -> Result<()> {
    println!("   the link is the proof: it fails if a panic can be reached from the control path");
    let all = firmware::build(toolchain, board, &["--bins"]);
    all.context(Exit::failed(NOT_LINKED))?;
    println!("   panic-free linked: no panic can be reached");

    // A proof that cannot fail is none: with a panic put into the path, the link must miss the
    // function.
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
