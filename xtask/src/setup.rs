//! Prepares this machine: the compiler's target, QEMU, and for the tests Python packages.

mod debian;
pub mod probe;
pub mod python;
pub mod qemu;
pub mod target;

use anyhow::Result;

/// Installs the missing tools that build and run the firmware, and returns the toolchain that
/// builds the firmware.
pub fn tools() -> Result<String> {
    let toolchain = target::ensure()?;
    qemu::ensure()?;
    Ok(toolchain)
}
