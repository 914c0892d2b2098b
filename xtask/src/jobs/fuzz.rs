//! `cargo xtask fuzz`: hostile bytes for the readers, led by coverage.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::stage;
use crate::outcome::Exit;
use crate::{process, rustup, workspace};

/// The readers (`fuzz/src/lib.rs`), and the default number of inputs of each: ten million where one
/// takes microseconds, the number for some ten minutes where it takes longer.
const TARGETS: [(&str, u64); 11] = [
    ("telemetry", 10_000_000),
    ("recording", 1_000_000),
    ("tile", 10_000_000),
    ("configuration", 2_000_000),
    ("manoeuvre", 2_000_000),
    ("record", 10_000_000),
    ("settings", 10_000_000),
    ("serial", 10_000_000),
    ("frames", 10_000_000),
    ("elf", 2_000_000),
    ("log", 10_000_000),
];
/// What LLVM puts into the code, as libFuzzer reads it.
const COVERAGE: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=3 \
     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
     -Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing";
/// Limits of one input: seconds, MB and bytes.
const LIMITS: [&str; 3] = ["-timeout=20", "-rss_limit_mb=2048", "-max_len=16384"];

/// Builds the driver and runs it on one reader, or on all.
pub fn run(target: Option<&str>, inputs: Option<u64>) -> Result<()> {
    let chosen: Vec<_> = TARGETS
        .into_iter()
        .filter(|(name, _)| target.is_none_or(|target| target == *name))
        .collect();
    if chosen.is_empty() {
        let names = TARGETS.map(|(name, _)| name).join(", ");
        bail!("no such reader: must be one of {names}");
    }
    let pinned = rustup::require_pinned()?;
    let folder = workspace::target_dir()?.join("fuzz");
    let driver = stage("driver", || build(&pinned, &folder))?;
    for (name, usual) in &chosen {
        let inputs = inputs.unwrap_or(*usual);
        stage(&format!("{name}, {inputs} inputs"), || {
            fuzz(&driver, &folder, name, inputs)
        })?;
    }
    println!("passed: no input made a reader panic, hang or take too much memory");
    Ok(())
}

fn build(pinned: &str, folder: &Path) -> Result<PathBuf> {
    let about = process::capture(rustup::tool(pinned, "rustc")?.arg("-vV"));
    let about = about.context("rustc does not report its host")?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.context("rustc does not report its host")?;
    let mut cargo = rustup::cargo(pinned)?;
    // With a target named, the flags are not those of build scripts and macros.
    cargo
        .env("CARGO_TARGET_DIR", folder)
        .env("RUSTFLAGS", COVERAGE)
        .args(["build", "--profile", "fuzz", "--package", "fuzz"])
        .args(["--bin", "guided", "--features", "guided", "--target", host])
        .args(workspace::locked());
    process::run(&mut cargo).context(
        "libFuzzer is built from source and needs a C++ compiler (Debian: apt-get install g++)",
    )?;
    Ok(folder.join(host).join("fuzz/guided"))
}

fn fuzz(driver: &Path, folder: &Path, name: &str, inputs: u64) -> Result<()> {
    let [found, failed] = ["corpus", "failed"].map(|kind| folder.join(kind).join(name));
    for folder in [&found, &failed] {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    let mut command = std::process::Command::new(driver);
    command
        .current_dir(workspace::root())
        .env("FUZZ_TARGET", name)
        .env("FUZZ_SEEDS", &found)
        .arg(format!("-runs={inputs}"))
        .args(LIMITS)
        .args(["-print_final_stats=1", "-verbosity=0"])
        .arg(format!("-artifact_prefix={}/", failed.display()))
        .arg(&found)
        .arg(workspace::root().join("fuzz/corpus").join(name));
    let status = process::status(&mut command)?;
    if status.success() {
        return Ok(());
    }
    let why = format!(
        "the reader `{name}` failed: the input is in {}; copy it to fuzz/corpus/{name}/, and `cargo test -p fuzz` shows the panic",
        failed.display()
    );
    Err(Exit::failed(why).into())
}
