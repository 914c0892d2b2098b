//! QEMU, from the system's packages.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::host::{Apt, Manager};
use crate::process;

/// The program's name, and its package's where set-up installs it.
pub const PROGRAM: &str = "qemu-system-arm";

/// Where QEMU is, and its version line.
pub fn found() -> Option<(PathBuf, String)> {
    let path = process::find(PROGRAM)?;
    let version = process::capture(Command::new(&path).arg("--version"))?;
    Some((path, version.lines().next().unwrap_or_default().to_owned()))
}

/// Installs QEMU unless it is there.
pub fn ensure() -> Result<()> {
    if found().is_some() {
        return Ok(());
    }
    let Some(apt) = Apt::here() else {
        bail!("{PROGRAM} is missing: {}, then run this again", by_hand());
    };
    println!("setup: installing the system's package {PROGRAM}");
    apt.bring(PROGRAM)
        .with_context(|| format!("{PROGRAM} is missing: {}, then run this again", by_hand()))?;
    if found().is_none() {
        bail!("the package {PROGRAM} is installed, but there is no {PROGRAM} on PATH");
    }
    Ok(())
}

/// The steps of set-up.
pub fn plan() -> String {
    match Apt::here() {
        Some(_) => format!("set-up would: `apt-get install --no-install-recommends {PROGRAM}`"),
        None => format!("not by set-up: {}", by_hand()),
    }
}

/// The line to type.
fn by_hand() -> String {
    match Manager::of_this_machine() {
        Some(manager) => format!("type `{}`", manager.qemu_line()),
        None => "install QEMU (https://www.qemu.org)".to_owned(),
    }
}
