//! Measures of chaos: Lyapunov exponents by three independent methods, the period, attractors and what becomes of them along a
//! parameter.
//!
//! | question | module |
//! |---|---|
//! | what is a motion to the exponents' methods? | [`flow`] |
//! | exponents by tangent dynamics, the largest one or all | [`lyapunov`] |
//! | the largest exponent by two neighbouring motions | [`twin`] |
//! | the largest exponent by synchronisation, the paper's method | [`synchronisation`] |
//! | one of these methods by its name, along a sweep | [`method`] |

pub mod attractor;
pub mod basin;
pub mod equilibria;
pub mod extrema;
pub mod flow;
pub mod lyapunov;
pub mod orbit;
pub mod period;
pub mod polynomial;
pub mod regions;
pub mod sweep;
pub mod synchronisation;
pub mod twin;
