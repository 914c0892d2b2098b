#![doc = include_str!("../README.md")]

pub mod dual;
pub mod early_end;
pub mod exponent;
pub mod period;
pub mod regime;
pub mod trace;

pub use early_end::{EarlyEnd, Reason, is_bounded};
