//! Processor in the loop: the firmware's image, the emulator that runs it, and what it tells.

pub mod elf;
pub mod log;
pub mod qemu;
pub mod session;
pub mod settings;
pub mod telemetry;
