//! Host side of the steering ECU: the same model in f64, the firmware in QEMU, and the comparison of the two.
//!
//! | question | module |
//! |---|---|
//! | how does a scenario move? | [`simulate`] |
//! | how is a motion stepped in a sweep? | [`motion`] |
//! | what are the state's components called? | [`component`] |
//! | what do tyres and dither look like as curves? | [`characteristics`] |
//! | what of the dither can an actuator produce? | [`realisability`] |
//! | is a motion chaotic, or which period has it? | [`chaos`] |
//! | where does averaging the dither start to hold? | [`averaging`] |
//! | which motion has each wheel speed and dither amplitude, with which exponent? | [`map`] |
//! | which amplitude suppresses the chaos at which speed? | [`schedule`] |
//! | how good is the fixed step? | [`convergence`], [`engine::reference`] |
//! | how does the vehicle move under the ECU's duty, and what do its sensors tell? | [`closed_loop`] |
//! | how is the firmware run? | [`pil`] |
//! | do firmware and host agree? | [`equivalence`] |
//! | how many instructions do its tasks take? | [`instructions`] |
//! | how deep can the firmware's stack get, and does it fit its board? | [`image`] |
//! | what does a whole verification do? | [`verify`] |
//! | how are configurations read? | [`config`] |
//! | how are results shown? | [`report`], [`verdict`] |
//! | how are files written? | [`output`] |

#[cfg(not(target_os = "linux"))]
compile_error!(
    "sim-host needs Linux: it ends the emulator with itself, and keeps both on one core, by Linux's own calls"
);

pub use dynamics::{engine, motion};

pub mod averaging;
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
