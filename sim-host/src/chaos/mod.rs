//! Measures of chaos: the largest Lyapunov exponent, the period, attractors and what becomes of them along a parameter.

pub mod attractor;
pub mod basin;
pub mod equilibria;
pub mod extrema;
pub mod lyapunov;
pub mod orbit;
pub mod period;
pub mod polynomial;
pub mod regions;
pub mod sweep;
