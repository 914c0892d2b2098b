//! Makes this machine ready: the compiler's target, and QEMU.

mod debian;
pub mod qemu;
pub mod target;

use anyhow::Result;

/// Installs what is missing, and returns the toolchain that builds the firmware.
pub fn tools() -> Result<String> {
    let toolchain = target::ensure()?;
    qemu::ensure()?;
    Ok(toolchain)
}
