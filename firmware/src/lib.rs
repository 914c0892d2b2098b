//! Steering ECU: the program of `shared-model` on a Cortex-M, with interrupts, telemetry and a safe state around it. No
//! arithmetic of the model is here.
//!
//! | question | module |
//! |---|---|
//! | what runs when? | [`app`], [`interrupts`] |
//! | what does it do without and with a vehicle? | [`open_loop`], [`in_loop`] |
//! | what does a board have to bring? | [`board`] |
//! | what happens on a fault? | [`fault`] |
//! | how do records leave the ECU? | [`recorder`] |
//! | how do log lines? | [`log`] |

#![no_std]

pub mod app;
pub mod board;
pub mod clock;
pub mod command_line;
pub mod counters;
pub mod exit;
pub mod fault;
pub mod host_file;
pub mod in_loop;
pub mod interrupts;
pub mod link;
pub mod log;
pub mod open_loop;
pub mod recorder;
pub mod refusal;
pub mod spacing;
pub mod stack;
pub mod tasks;
