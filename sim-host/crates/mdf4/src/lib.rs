#![doc = include_str!("../README.md")]

mod block;
mod channel;
mod file;

pub use channel::{Channel, Group, Samples};
pub use file::File;
