//! Processor in the loop: the firmware's image, the emulator that runs it, and what it tells.

pub mod debug;
pub mod elf;
pub mod gdb;
pub mod log;
pub mod qemu;
pub mod qmp;
mod socket;
pub mod settings;
pub mod telemetry;
