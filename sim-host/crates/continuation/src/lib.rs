#![doc = include_str!("../README.md")]

pub mod arclength;
pub mod branch;
mod codimension_two;
pub mod curve;
pub mod equilibrium;
mod failure;
pub mod orbit;
pub mod start;
pub mod system;
mod test_function;
pub mod trajectory;
pub mod vehicle;

pub use codimension_two::{CodimensionTwo, Condition};
pub use failure::Failure;
pub use test_function::Bifurcation;
