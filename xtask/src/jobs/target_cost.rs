//! `cargo xtask target-cost`: instructions of Rust on the target, beside the same program in C.

use anyhow::{Context, Result, bail};

use super::stage;
use crate::host::Manager;
use crate::outcome::Exit;
use crate::{firmware, process, rustup, setup, workspace};

const C_COMPILER: &str = "arm-none-eabi-gcc";
/// The package of the image, and its feature that compiles the C sources.
const PACKAGE: &str = "c-reference";
const WITH_C: [&str; 2] = ["--features", "gcc"];
/// The test that runs it and judges.
const TEST: [&str; 8] = [
    "test",
    "--release",
    "--package",
    "tests",
    "--test",
    "cost",
    "--",
    "--nocapture",
];
/// Makes the test write the expected figures.
const OVERWRITE: &str = "DITHERSTEER_OVERWRITE_EXPECTED";

/// Builds both, and compares their bits and instructions, or records the latter.
pub fn run(overwrite_expected: bool) -> Result<()> {
    if !has_c_compiler() {
        let cure = Manager::of_this_machine().map_or_else(
            || "install GCC and newlib for arm-none-eabi".to_owned(),
            |manager| format!("type `{}`", manager.arm_gcc_line()),
        );
        bail!("{C_COMPILER} is missing: {cure}, then run this again");
    }
    let toolchain = stage("set-up", setup::tools)?;
    build(&toolchain)?;
    stage("comparison", || {
        let mut cargo = rustup::cargo(&workspace::pinned_channel()?)?;
        cargo.args(workspace::locked()).args(TEST);
        if overwrite_expected {
            cargo.env(OVERWRITE, "1");
        }
        let ran = process::run(&mut cargo);
        ran.context(Exit::failed(
            "bits differ, or Rust takes more instructions than C; the test's output is above",
        ))
    })?;
    println!("passed: the bits of C, in no more instructions");
    Ok(())
}

/// Whether the C compiler is installed. Set-up does not install it: nothing else needs it.
pub fn has_c_compiler() -> bool {
    process::find(C_COMPILER).is_some()
}

/// Builds the image that contains both languages.
pub fn build(toolchain: &str) -> Result<()> {
    stage("C reference", || {
        process::run(firmware::cargo_on(toolchain, "build", PACKAGE)?.args(WITH_C))
    })
}
