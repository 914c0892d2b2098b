//! `cargo xtask coverage`: every line of the gate is run by a test of the model.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::stage;
use crate::outcome::Exit;
use crate::{process, rustup, workspace};

/// The lines that must be run, all of them.
const COVERED: [&str; 4] = [
    "shared-model/src/gate",
    "shared-model/src/controller.rs",
    "shared-model/src/controller",
    "shared-model/src/delayed_feedback",
];

/// LLVM's two programs, of the version that the compiler was made with.
struct Llvm {
    profdata: PathBuf,
    cov: PathBuf,
}

/// Runs the model's tests with counters in every line, and names the lines that none of them
/// reached.
pub fn run() -> Result<()> {
    let pinned = rustup::require_pinned()?;
    let llvm = Llvm::of(&pinned)?;
    let folder = workspace::target_dir()?.join("coverage");
    let profiles = folder.join("profiles");
    if profiles.exists() {
        fs::remove_dir_all(&profiles)
            .with_context(|| format!("cannot remove {}", profiles.display()))?;
    }
    stage("model tests, counted", || {
        run_tests(&pinned, &folder, &profiles)
    })?;
    let lines = stage("coverage", || llvm.lines(&pinned, &folder, &profiles))?;
    judge(&lines)
}

fn cargo(pinned: &str, folder: &Path, profiles: &Path) -> Result<Command> {
    let mut cargo = rustup::cargo(pinned)?;
    cargo
        .env("CARGO_TARGET_DIR", folder)
        .env("RUSTFLAGS", "-C instrument-coverage")
        .env("LLVM_PROFILE_FILE", profiles.join("%p-%m.profraw"))
        .args(["test", "--package", "shared-model", "--tests"])
        .args(workspace::locked());
    Ok(cargo)
}

fn run_tests(pinned: &str, folder: &Path, profiles: &Path) -> Result<()> {
    let ran = process::run(&mut cargo(pinned, folder, profiles)?);
    ran.context(Exit::failed("a test failed; its output is above"))
}

impl Llvm {
    fn of(pinned: &str) -> Result<Self> {
        let about = process::capture(rustup::tool(pinned, "rustc")?.arg("-vV"));
        let about = about.context("rustc does not report its version")?;
        let value = |key: &str| about.lines().find_map(|line| line.strip_prefix(key));
        let major = value("LLVM version: ").and_then(|version| version.split('.').next());
        let major = major.context("rustc does not report its LLVM's version")?;
        let host = value("host: ").context("rustc does not report its host")?;
        let component = rustup::folder(pinned)?
            .join("lib/rustlib")
            .join(host)
            .join("bin");
        let package = PathBuf::from(format!("/usr/lib/llvm-{major}/bin"));
        for folder in [component, package] {
            let found = Self {
                profdata: folder.join("llvm-profdata"),
                cov: folder.join("llvm-cov"),
            };
            if found.profdata.is_file() && found.cov.is_file() {
                return Ok(found);
            }
        }
        bail!(
            "llvm-profdata and llvm-cov of LLVM {major} are missing: run `rustup component add --toolchain {pinned} \
             llvm-tools`, or on Debian `sudo apt-get install llvm-{major}`, then this again"
        )
    }

    /// How often each line was run, in the format of lcov.
    fn lines(&self, pinned: &str, folder: &Path, profiles: &Path) -> Result<String> {
        let merged = folder.join("merged.profdata");
        let mut merge = Command::new(&self.profdata);
        merge.args(["merge", "--sparse", "--output"]);
        merge.arg(&merged).arg(profiles);
        process::run(&mut merge)?;

        let mut export = Command::new(&self.cov);
        export
            .args(["export", "--format=lcov", "--instr-profile"])
            .arg(&merged);
        for program in test_programs(pinned, folder, profiles)? {
            export.arg("--object").arg(program);
        }
        let sources = COVERED.map(|source| workspace::root().join(source));
        export.arg("--sources").args(sources);
        process::capture(&mut export).context("llvm-cov does not read the tests' counts")
    }
}

/// The tests' programs, as cargo names them: `Executable tests/gate.rs (/path/of/program)`.
fn test_programs(pinned: &str, folder: &Path, profiles: &Path) -> Result<Vec<String>> {
    let mut cargo = cargo(pinned, folder, profiles)?;
    let output = cargo.arg("--no-run").output()?;
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    let named = messages
        .lines()
        .filter(|line| line.trim_start().starts_with("Executable"));
    let programs = named.filter_map(|line| Some(line.split_once('(')?.1.strip_suffix(')')?.into()));
    Ok(programs.collect())
}

fn judge(lcov: &str) -> Result<()> {
    let counts = counts(lcov);
    let files = counts.values().filter(|lines| !lines.is_empty()).count();
    let total: usize = counts.values().map(BTreeMap::len).sum();
    let missed: Vec<String> = counts
        .iter()
        .flat_map(|(file, lines)| {
            let missed = lines.iter().filter(|&(_, &count)| count == 0);
            missed.map(move |(line, _)| format!("{file}:{line}"))
        })
        .collect();
    for line in &missed {
        println!("   not run: {line}");
    }
    // Nothing counted is no pass.
    if total == 0 {
        bail!("no line of {} was counted", COVERED.join(", "));
    }
    if !missed.is_empty() {
        let why = format!("{} of {total} lines are run by no test", missed.len());
        return Err(Exit::failed(why).into());
    }
    println!(
        "passed: all {total} lines of {files} files ({}) are run by tests",
        COVERED.join(", ")
    );
    Ok(())
}

/// Counts by file and line.
fn counts(lcov: &str) -> BTreeMap<String, BTreeMap<u32, u64>> {
    let mut counts: BTreeMap<String, BTreeMap<u32, u64>> = BTreeMap::new();
    let mut file = String::new();
    for line in lcov.lines() {
        if let Some(name) = line.strip_prefix("SF:") {
            name.clone_into(&mut file);
        }
        let count = line.strip_prefix("DA:").and_then(|rest| {
            let (line, count) = rest.split_once(',')?;
            Some((line.parse().ok()?, count.parse::<u64>().ok()?))
        });
        if let Some((line, count)) = count {
            *counts
                .entry(file.clone())
                .or_default()
                .entry(line)
                .or_default() += count;
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    const LCOV: &str = "SF:/gate/fault.rs\nFN:3,name\nDA:3,7\nDA:4,0\nend_of_record\nSF:/gate/mod.rs\nDA:1,1\nend_of_record\n";

    #[test]
    fn lines_that_no_test_runs_fail() {
        assert!(judge(LCOV).is_err());
        assert!(judge(&LCOV.replace("DA:4,0", "DA:4,1")).is_ok());
        assert!(judge("").is_err(), "nothing counted is no pass");
    }
}
