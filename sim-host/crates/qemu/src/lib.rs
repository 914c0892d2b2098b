#![doc = include_str!("../README.md")]

#[cfg(not(target_os = "linux"))]
compile_error!(
    "qemu needs Linux: it ends the emulator with itself, and keeps both on one core, by Linux's own calls"
);

pub mod bus_session;
pub mod configured;
pub mod debug;
mod emulator;
pub mod gdb;
pub mod log;
mod machine;
pub mod periods;
mod pipes;
pub mod qmp;
mod rtt;
mod run;
pub mod session;
pub mod settings;
mod socket;
pub mod telemetry;

pub use machine::Machine;
pub use run::{Finished, OVERRUN, RunError, meaning, run, run_with};
pub use socket::SocketError;
