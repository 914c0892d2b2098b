//! Measures of chaos: the largest Lyapunov exponent and the period.

pub mod lyapunov;
pub mod period;
