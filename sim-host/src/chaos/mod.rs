//! Measures of chaos: Lyapunov exponents by three independent methods, the period, attractors, and what becomes of them along a
//! parameter.
//!
//! | question | module |
//! |---|---|
//! | what do motions do behind their transients? | [`observe`], [`fixed_step`] |
//! | what is a motion to the methods? | [`flow`] |
//! | exponents by tangent dynamics, the largest one or all | [`lyapunov`] |
//! | the largest exponent by two neighbouring motions | [`twin`] |
//! | the largest exponent by synchronisation, the paper's method | [`synchronisation`] |
//! | what does each of these say of a vehicle's motion? | [`method`] |
//! | which period has a motion? | [`period`], [`extrema`] |
//! | what does a motion end on? | [`attractor`], [`basin`] |
//! | what becomes of it along a parameter? | [`orbit`], [`regions`], [`sweep`] |
//! | where does it cross a section, and which frequencies are in it? | [`poincare`], [`power_spectrum`] |
//! | where can it rest, and is that stable? | [`equilibria`], [`eigenvalues`] |

pub mod attractor;
pub mod basin;
pub mod eigenvalues;
pub mod equilibria;
pub mod extrema;
pub mod fixed_step;
pub mod flow;
pub mod lyapunov;
pub mod method;
pub mod observe;
pub mod orbit;
pub mod period;
pub mod poincare;
pub mod power_spectrum;
pub mod regions;
pub mod sweep;
pub mod synchronisation;
pub mod twin;
