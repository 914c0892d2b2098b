//! Processor in the loop: the firmware's image, the emulator that runs it, and what it tells.

pub mod debug;
pub mod elf;
mod emulator;
pub mod gdb;
pub mod log;
pub mod qemu;
pub mod qmp;
pub mod session;
pub mod settings;
mod socket;
pub mod telemetry;
