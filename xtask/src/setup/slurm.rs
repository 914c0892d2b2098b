//! Slurm for the test of a map on a cluster. It is installed for root alone, as its daemons need
//! root.

use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::host::{self, Apt};
use crate::process;

/// Debian's packages; the first one names the version.
const PACKAGES: [&str; 4] = ["slurmctld", "slurmd", "slurm-client", "munge"];

/// Whether the user is root.
pub fn is_usable() -> bool {
    process::capture(Command::new("id").arg("-u")).as_deref() == Some("0")
}

/// The installed version; `None` if a package is missing.
pub fn found() -> Option<String> {
    let versions: Option<Vec<_>> = PACKAGES.into_iter().map(host::installed).collect();
    versions?.into_iter().next()
}

/// Installs the missing packages.
pub fn ensure() -> Result<()> {
    if !is_usable() {
        bail!("Slurm's daemons need root");
    }
    if found().is_some() {
        return Ok(());
    }
    let apt = Apt::here().context("there is no apt-get to install Slurm with")?;
    let packages = PACKAGES.into_iter();
    for package in packages.filter(|package| host::installed(package).is_none()) {
        println!("setup: installing the system's package {package}");
        apt.bring(package)?;
    }
    Ok(())
}

/// The steps of set-up.
pub fn plan() -> String {
    format!("set-up would: `apt-get install {}`", PACKAGES.join(" "))
}
