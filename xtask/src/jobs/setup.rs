//! `cargo xtask setup`.

use anyhow::Result;

use super::{build_sim_host, stage};
use crate::{setup, workspace};

/// Installs missing tools and builds the runner.
pub fn run() -> Result<()> {
    let toolchain = stage("set-up", setup::tools)?;
    stage("runner", build_sim_host)?;
    // Last: without these only a test is missing.
    stage("Python packages of the tests", setup::python::ensure)?;
    stage("target of the page", || {
        setup::target::ensure(&setup::probe::BROWSER)
    })?;
    stage("browser of the page's test", setup::browser::ensure)?;
    if setup::slurm::is_usable() {
        stage("Slurm of the cluster's test", setup::slurm::ensure)?;
    }
    println!(
        "the firmware builds with toolchain {toolchain}; its runner is {}",
        workspace::sim_host()?.display()
    );
    println!("set-up is complete");
    Ok(())
}
