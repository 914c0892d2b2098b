#![doc = include_str!("../README.md")]

pub mod dual;
mod early_end;
pub mod events;
pub mod reference;
pub mod rounding;
mod stepper;
pub mod taylor;

pub use early_end::{EarlyEnd, Reason, is_bounded};
pub use stepper::Stepper;
