//! Steering ECU: the program of `shared-model` on a Cortex-M, with interrupts, a bus and a safe
//! state around it. No arithmetic of the model is here.
//!
//! | subject | module |
//! |---|---|
//! | requirements on a board | [`board`] |
//! | the program in two interrupts | [`steering`], [`tasks`] |
//! | fault handlers | [`fault`] |
//! | the product: configuration in flash, frames on a bus | [`product`] |
//! | the laboratory: scenario and telemetry through the emulator | [`bench`] |

#![no_std]

pub mod bench;
pub mod board;
pub mod clock;
pub mod fault;
mod nvic;
pub mod product;
pub mod refusal;
pub mod stack;
pub mod steering;
pub mod tasks;
