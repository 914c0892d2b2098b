//! Processor in the loop: the firmware's image, the emulator that runs it, and what it tells.

#[cfg(unix)]
pub mod debug;
pub mod elf;
#[cfg(unix)]
pub mod gdb;
pub mod log;
pub mod qemu;
#[cfg(unix)]
pub mod qmp;
#[cfg(unix)]
pub mod session;
pub mod settings;
#[cfg(unix)]
mod socket;
pub mod telemetry;
