#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

pub mod archive;
mod c_interface;
mod clock;
pub mod description;
mod ecu;
mod instance;
mod location;
pub mod model;
mod parameters;
pub mod variable;
mod vehicle;
