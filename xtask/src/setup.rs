//! Prepares this machine: the compiler's targets, QEMU, and for the tests Python packages, a browser
//! and Slurm.

pub mod browser;
mod debian;
pub mod probe;
pub mod python;
pub mod qemu;
pub mod slurm;
pub mod target;

use anyhow::Result;

/// Installs the missing tools that build and run the firmware, and returns the toolchain that
/// builds the firmware.
pub fn tools() -> Result<String> {
    let toolchain = target::ensure(&probe::FIRMWARE)?;
    target::use_for_firmware(&toolchain)?;
    qemu::ensure()?;
    Ok(toolchain)
}
