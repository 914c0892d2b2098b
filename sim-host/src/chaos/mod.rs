//! Measures of chaos: the largest Lyapunov exponent, the period, the Poincaré section and the power spectrum.

pub mod lyapunov;
pub mod period;
pub mod poincare;
pub mod power_spectrum;
