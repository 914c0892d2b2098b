#![doc = include_str!("../README.md")]

#[cfg(not(target_os = "linux"))]
compile_error!(
    "sim-host needs Linux: it ends the emulator with itself, and keeps both on one core, by Linux's own calls"
);

pub use dynamics::{engine, interrupt, motion};

pub mod averaging;
pub mod bounded;
pub mod chaos;
pub mod characteristics;
pub mod closed_loop;
pub mod component;
pub mod config;
pub mod convergence;
mod decimal;
pub mod equivalence;
pub mod image;
pub mod instructions;
pub mod map;
pub mod output;
pub mod paper;
pub mod pil;
pub mod realisability;
pub mod report;
pub mod reproduce;
pub mod schedule;
pub mod simulate;
pub mod trace;
pub mod verdict;
pub mod verify;
pub mod words;
