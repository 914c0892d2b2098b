#![doc = include_str!("../README.md")]

pub mod axes;
pub mod axis;
pub mod canvas;
pub mod chart;
pub mod colour_scale;
pub mod figure;
pub mod junit;
pub mod matrix;
pub mod number;
pub mod page;
pub mod raster;
pub mod reduce;
pub mod style;
pub mod terminal;
pub mod text;
pub mod verdict;
