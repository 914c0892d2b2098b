#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod bus;
pub mod can;
pub mod configuration;
pub mod controller;
pub mod delayed_feedback;
pub mod diagnostic;
pub mod dither;
pub mod e2e;
pub mod e2e_state_machine;
pub mod ecu;
pub mod ecu_schedule;
pub mod exchange;
pub mod frame;
pub mod freshness;
pub mod friction;
pub mod gate;
pub mod independent_clock;
pub mod integrate;
mod limit;
mod listed;
pub mod open_loop;
pub mod parameter;
pub mod policy;
pub mod real;
pub mod scenario;
pub mod schedule;
pub mod schedule_table;
pub mod segments;
pub mod serial;
pub mod servo;
pub mod settings;
pub mod short;
pub mod signal;
pub mod stability;
pub mod steering;
pub mod telemetry;
pub mod tick_exchange;
pub mod tire;
pub mod validation;
pub mod vehicle;

pub use real::Real;
pub use scenario::{Preset, Scenario};
pub use validation::{InvalidScenario, MAX_RATIO};
