//! Python packages that frames, units, measurement files and maps are checked against, in a virtual
//! environment of their own: nothing is installed into the machine's Python.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::host::{Apt, Manager};
use crate::{process, workspace};

/// Purpose of the packages.
const PURPOSE: &str = "the comparison of frames, units, measurement files and maps with other programs that read them";
/// Prints the version if the packages can be imported.
const PROBE: &str = "import platform, asammdf, cantools, duckdb, e2e, fmpy.fmi2, polars, pyarrow; print('Python', platform.python_version())";
/// Where Debian splits Python, the package that brings `python3 -m venv`.
const DEBIAN_PACKAGE: &str = "python3-venv";

/// The virtual environment's Python, and its version; `None` unless all packages are installed as
/// pinned.
pub fn found() -> Result<Option<(PathBuf, String)>> {
    let python = program(&folder()?);
    let complete = fs::read_to_string(stamp()?).ok() == Some(fs::read_to_string(requirements())?);
    // After an upgrade of the machine's Python the environment may not find its packages.
    let version = process::capture(Command::new(&python).args(["-I", "-c", PROBE]));
    Ok(version
        .filter(|_| complete)
        .map(|version| (python, version)))
}

/// Makes the virtual environment unless it is there; again from nothing if the pinned packages
/// changed.
pub fn ensure() -> Result<()> {
    if found()?.is_some() {
        return Ok(());
    }
    let folder = folder()?;
    println!(
        "setup: installing the Python packages of {} into {}",
        requirements().display(),
        folder.display()
    );
    make(&folder).with_context(|| format!("{PURPOSE} would be untested"))?;
    // Last, so that an interrupted installation is repeated.
    fs::copy(requirements(), stamp()?)?;
    Ok(())
}

/// The steps of set-up.
pub fn plan() -> Result<String> {
    let line = format!(
        "`pip install -r {}` into {}",
        requirements().display(),
        folder()?.display()
    );
    Ok(match (has_venv(), Apt::here()) {
        (true, _) => format!("set-up would: {line}"),
        (false, Some(_)) => {
            format!("set-up would: `apt-get install {DEBIAN_PACKAGE}`, then {line}")
        }
        (false, None) => format!("not by set-up: {}", by_hand()),
    })
}

fn make(folder: &Path) -> Result<()> {
    if !has_venv() {
        if let Some(apt) = Apt::here() {
            println!("setup: installing the system's package {DEBIAN_PACKAGE}");
            apt.bring(DEBIAN_PACKAGE).with_context(by_hand)?;
        }
        if !has_venv() {
            bail!(
                "Python 3 with venv is missing: {}, then run this again",
                by_hand()
            );
        }
    }
    let python = system().context("Python 3 is not on PATH")?;
    process::run(
        Command::new(python)
            .args(["-m", "venv", "--clear"])
            .arg(folder),
    )?;
    let mut pip = Command::new(program(folder));
    pip.args(["-m", "pip", "install", "--quiet", "--no-input"])
        // Every package is listed, and nothing else is needed.
        .args(["--disable-pip-version-check", "--no-deps", "--requirement"])
        .arg(requirements());
    process::run(&mut pip).context(
        "pip could not install them: Python 3.10 or later and a package index that pip reaches are needed \
         (PIP_INDEX_URL names another one), then run this again",
    )
}

/// The packages with their versions.
fn requirements() -> PathBuf {
    workspace::root().join("tests/python/requirements.txt")
}

/// The folder of the virtual environment, which the tests use.
fn folder() -> Result<PathBuf> {
    Ok(workspace::target_dir()?.join("python"))
}

/// A copy of the requirements as they were installed.
fn stamp() -> Result<PathBuf> {
    Ok(folder()?.join("requirements.txt"))
}

fn program(folder: &Path) -> PathBuf {
    folder.join("bin").join("python")
}

/// The machine's Python 3.
fn system() -> Option<PathBuf> {
    process::find("python3")
}

/// Whether there is a Python that can make virtual environments with pip in them.
fn has_venv() -> bool {
    let import =
        |python| process::capture(Command::new(python).args(["-c", "import venv, ensurepip"]));
    system().and_then(import).is_some()
}

/// The line to type.
fn by_hand() -> String {
    match Manager::of_this_machine() {
        Some(manager) => format!("type `{}`", manager.python_line()),
        None => "install Python 3 (https://www.python.org)".to_owned(),
    }
}
