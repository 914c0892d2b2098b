//! Arithmetics and integrators for analysis.

pub mod dual;
pub mod events;
pub mod reference;
pub mod rounding;
pub mod taylor;
