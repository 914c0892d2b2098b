//! `cargo xtask demo`: from nothing to a report.

use std::process::Command;

use anyhow::{Result, bail};

use super::{build_sim_host, stage};
use crate::outcome::Exit;
use crate::{firmware, process, setup, workspace};

/// Sets up, builds, and lets the host's program run and judge the firmware.
pub fn run(args: &[String]) -> Result<()> {
    let toolchain = stage("set-up", setup::tools)?;
    stage("firmware", || {
        firmware::build(&toolchain, firmware::USUAL_BOARD, &["--bins"])
    })?;
    stage("host program", build_sim_host)?;
    stage("verify", || verify(args))
}

fn verify(args: &[String]) -> Result<()> {
    let mut sim_host = Command::new(workspace::sim_host()?);
    sim_host
        .current_dir(workspace::root())
        .args(["verify", "--force", "--firmware"])
        .arg(firmware::elf(firmware::USUAL_BOARD, "bench")?)
        .args(args);
    let status = process::status(&mut sim_host)?;
    match status.code() {
        Some(0) => Ok(()),
        Some(code) => {
            let why = format!(
                "sim-host ended with exit code {code}; its last line of output has the reason"
            );
            Err(Exit::with_code(u8::try_from(code)?, why).into())
        }
        None => bail!("sim-host was stopped: {status}"),
    }
}
