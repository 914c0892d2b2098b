#![doc = include_str!("../README.md")]

pub mod disturbance;
pub mod drive;
pub mod ecu;
pub mod equivalence;
pub mod fault;
pub mod figure;
pub mod instructions;
pub mod levels;
pub mod manoeuvre;
pub mod plant;
pub mod profile;
pub mod record;
pub mod recording;
pub mod run;
pub mod sensor;
pub mod servo_filter;
