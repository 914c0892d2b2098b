//! `cargo xtask mutants`: mutation tests of gate, controller and ECU program.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::stage;
use crate::outcome::Exit;
use crate::{process, rustup, workspace};

/// The tool, in the version whose mutations [`SURVIVORS`] names.
const TOOL: &str = "cargo-mutants";
const VERSION: &str = "27.1.0";
/// The files to mutate.
const MUTATED: [&str; 6] = [
    "shared-model/src/gate/*.rs",
    "shared-model/src/controller.rs",
    "shared-model/src/controller/*.rs",
    "shared-model/src/delayed_feedback/*.rs",
    "shared-model/src/ecu.rs",
    "shared-model/src/ecu/*.rs",
];
/// The tests that have to fail, beside those inside the library.
const TESTS: [&str; 6] = [
    "controller",
    "ecu",
    "feedback",
    "gate",
    "limiter",
    "plausibility",
];
/// The mutations that no test can detect, each below its reason.
const SURVIVORS: &str = "shared-model/mutants-survivors.txt";
/// Exit codes of the tool: all caught, some missed, some ran into the time limit.
const JUDGED: [i32; 3] = [0, 2, 3];

/// Mutates, tests, and compares the survivors with the list of those with a reason.
pub fn run() -> Result<()> {
    let pinned = rustup::require_pinned()?;
    let tools = workspace::target_dir()?.join("tools");
    stage("tool", || ensure(&pinned, &tools))?;
    let results = workspace::target_dir()?.join("mutants");
    stage("mutations", || mutate(&pinned, &tools, &results))?;
    let lists = results.join("mutants.out");
    let read = |path: PathBuf| {
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let (missed, caught) = (
        read(lists.join("missed.txt"))?,
        read(lists.join("caught.txt"))?,
    );
    let named = read(workspace::root().join(SURVIVORS))?;
    judge(&missed, &named)?;
    println!(
        "passed: {} mutations caught, {} named in {SURVIVORS} survive",
        caught.lines().count(),
        missed.lines().count()
    );
    Ok(())
}

fn program(tools: &Path) -> PathBuf {
    tools.join("bin").join(TOOL)
}

fn ensure(pinned: &str, tools: &Path) -> Result<()> {
    let version = process::capture(Command::new(program(tools)).args(["mutants", "--version"]));
    if version.is_some_and(|line| line.ends_with(VERSION)) {
        return Ok(());
    }
    println!(
        "installing {TOOL} {VERSION} into {} (a minute or two)",
        tools.display()
    );
    let mut cargo = rustup::cargo(pinned)?;
    cargo
        .args(["install", TOOL, "--version", VERSION, "--locked", "--root"])
        .arg(tools);
    process::run(&mut cargo).with_context(|| {
        format!(
            "{TOOL} is missing: type `cargo install {TOOL} --version {VERSION} --locked --root {}`, then run this again",
            tools.display()
        )
    })
}

fn mutate(pinned: &str, tools: &Path, results: &Path) -> Result<()> {
    fs::create_dir_all(results)?;
    let program = program(tools);
    // Through the toolchain's environment, so that the cargo which the tool starts is the pinned
    // one.
    let mut command = rustup::tool(pinned, &program.to_string_lossy())?;
    command
        .current_dir(workspace::root())
        .args([
            "mutants",
            "--package",
            "shared-model",
            "--profile",
            "mutants",
        ])
        .args(["--no-times", "--jobs", "2", "--minimum-test-timeout", "30"])
        .arg("--output")
        .arg(results);
    for file in MUTATED {
        command.args(["--file", file]);
    }
    // To cargo's every call, so that no other test is even built.
    command.arg("--cargo-arg=--lib");
    for test in TESTS {
        command.arg(format!("--cargo-arg=--test={test}"));
    }
    let status = process::status(&mut command)?;
    if status.code().is_some_and(|code| JUDGED.contains(&code)) {
        return Ok(());
    }
    bail!(
        "{TOOL} ended with {status}; its log is in {}",
        results.display()
    )
}

/// Survivors and names must be the same, line for line.
fn judge(missed: &str, named: &str) -> Result<()> {
    let missed = sorted(missed.lines().map(without_place));
    let is_name = |line: &&str| !line.trim().is_empty() && !line.starts_with('#');
    let named = sorted(named.lines().filter(is_name).map(str::to_owned));
    let unnamed = without(&missed, &named);
    let caught = without(&named, &missed);
    for survivor in &unnamed {
        println!("   survives without a reason: {survivor}");
    }
    for name in &caught {
        println!("   named, but caught or gone: {name}");
    }
    if unnamed.is_empty() && caught.is_empty() {
        return Ok(());
    }
    let why = format!(
        "{} survivors are not in {SURVIVORS}, {} in it do not survive",
        unnamed.len(),
        caught.len()
    );
    Err(Exit::failed(why).into())
}

fn sorted(lines: impl Iterator<Item = String>) -> Vec<String> {
    let mut lines: Vec<_> = lines.collect();
    lines.sort_unstable();
    lines
}

/// `path:line:column: mutation` without line and column, which any edit moves.
fn without_place(line: &str) -> String {
    let mut parts = line.splitn(4, ':');
    match (parts.next(), parts.nth(2)) {
        (Some(path), Some(mutation)) => format!("{path}:{mutation}"),
        _ => line.to_owned(),
    }
}

/// The elements that occur in `lines` more often than in `others`.
fn without(lines: &[String], others: &[String]) -> Vec<String> {
    let mut left = others.to_vec();
    let mut is_new = |line: &&String| match left.iter().position(|other| other == *line) {
        Some(at) => {
            left.swap_remove(at);
            false
        }
        None => true,
    };
    lines.iter().filter(|line| is_new(line)).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MISSED: &str = "a/b.rs:3:9: replace > with >= in f\na/b.rs:7:1: replace > with >= in f\n";
    const NAME: &str = "a/b.rs: replace > with >= in f\n";

    #[test]
    fn every_survivor_is_named_as_often_as_it_is_there() {
        let twice = format!("# at equality both give the same\n{NAME}\n{NAME}");
        assert!(judge(MISSED, &twice).is_ok());
        assert!(judge(MISSED, NAME).is_err(), "one is not named");
        assert!(judge(MISSED, "").is_err());
        assert!(judge("", NAME).is_err(), "named, but caught");
        assert!(judge("", "# nothing survives\n").is_ok());
    }
}
