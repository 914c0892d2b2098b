#![doc = include_str!("../README.md")]

pub mod input;
pub mod output;
