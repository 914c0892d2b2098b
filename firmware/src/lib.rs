//! Steering ECU: the program of `shared-model` on a Cortex-M, with interrupts, telemetry and a safe
//! state around it. No arithmetic of the model is here.
//!
//! | subject | module |
//! |---|---|
//! | start, end and interrupts of a run | [`app`], [`interrupts`] |
//! | the tasks without and with a vehicle | [`open_loop`], [`in_loop`] |
//! | requirements on a board | [`board`] |
//! | fault handlers | [`fault`] |
//! | telemetry | [`recorder`] |
//! | log | [`log`] |

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
pub mod jitter;
pub mod link;
pub mod log;
pub mod open_loop;
pub mod recorder;
pub mod refusal;
pub mod stack;
pub mod tasks;
