//! Measures of chaos: Lyapunov exponents by three independent methods, and the period.
//!
//! | question | module |
//! |---|---|
//! | what is a motion to the methods? | [`flow`] |
//! | exponents by tangent dynamics, the largest one or all | [`lyapunov`] |
//! | the largest exponent by two neighbouring motions | [`twin`] |
//! | the largest exponent by synchronisation, the paper's method | [`synchronisation`] |
//! | which period has a motion? | [`period`] |

pub mod flow;
pub mod lyapunov;
pub mod period;
pub mod synchronisation;
pub mod twin;
