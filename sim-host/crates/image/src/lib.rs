#![doc = include_str!("../README.md")]

mod analysis_error;
mod budget;
pub mod call_graph;
mod image;
pub mod memory;
pub mod stack;
mod thumb;

pub use analysis_error::AnalysisError;
pub use call_graph::function_names;
pub use image::{Image, ImageError, Symbol};
