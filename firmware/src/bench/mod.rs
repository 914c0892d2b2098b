//! The laboratory: the scenario comes from the emulator's command line, telemetry goes into the
//! host's files, both by semihosting.
//!
//! | subject | module |
//! |---|---|
//! | start, end and interrupts of a run | [`app`], [`interrupts`] |
//! | the tasks without and with a vehicle | [`open_loop`], [`in_loop`] |
//! | telemetry | [`recorder`] |
//! | pace of the PWM periods, measurements | [`pace`], [`counters`], [`jitter`] |
//! | faults on purpose | [`drill`] |

pub mod app;
pub mod command_line;
pub mod counters;
pub mod drill;
pub mod exit;
pub mod host_file;
pub mod in_loop;
pub mod interrupts;
pub mod jitter;
pub mod link;
pub mod open_loop;
pub mod pace;
pub mod recorder;
pub mod refusal;
pub mod run_state;
