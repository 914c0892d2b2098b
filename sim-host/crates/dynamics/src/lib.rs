#![doc = include_str!("../README.md")]

pub mod attractor;
pub mod averaging;
pub mod basin;
pub mod bifurcations;
pub mod characteristics;
pub mod component;
pub mod config;
pub mod convergence;
mod decimal;
pub mod delayed_feedback;
pub mod eigenvalues;
pub mod equilibria;
pub mod extrema;
pub mod fixed_step;
pub mod flow;
pub mod lyapunov;
pub mod map;
pub mod method;
mod module_comment;
pub mod observe;
pub mod orbit;
pub mod poincare;
pub mod power_spectrum;
pub mod realisability;
pub mod regions;
pub mod schedule;
pub mod section;
mod settled;
pub mod simulate;
pub mod sweep;
pub mod synchronisation;
pub mod trace_csv;
pub mod two_particle;
pub mod unit;
pub mod words;

pub use measures::{period, trace};
