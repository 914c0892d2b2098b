#![doc = include_str!("../README.md")]

pub mod firmware;
pub mod paper;
pub mod report;
pub mod reproduce;
pub mod verify;
