#![doc = include_str!("../README.md")]

pub mod events;
pub mod reference;
pub mod rounding;
mod stepper;
pub mod taylor;

pub use measures::dual;
pub use measures::{EarlyEnd, Reason, is_bounded};
pub use stepper::Stepper;
