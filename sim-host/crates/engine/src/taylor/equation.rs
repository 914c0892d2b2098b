//! The kinds of right-hand side.

use super::tires::{CubicTires, EitherTires, Tires};
use pulp::Simd;

/// A kind of right-hand side, and the shape of the code that suits it.
pub(super) trait Equation {
    /// Its tyres.
    type Tires<S: Simd, const V: usize>: Tires<S, V>;
    /// Whether its slip angles are always small.
    const SMALL_ANGLES: bool;
    /// Whether every order gets instructions of its own, without loops.
    const UNROLLED: bool;
}

/// Cubic tyres at small slip angles.
pub(super) struct Polynomial;

impl Equation for Polynomial {
    type Tires<S: Simd, const V: usize> = CubicTires<S, V>;
    const SMALL_ANGLES: bool = true;
    // It takes a third off the time.
    const UNROLLED: bool = true;
}

/// Exact slip angles, the Magic Formula, or both; alike for all motions of a flight. No polynomial,
/// but sines and arctangents have recurrences too.
pub(super) struct Analytic;

impl Equation for Analytic {
    type Tires<S: Simd, const V: usize> = EitherTires<S, V>;
    const SMALL_ANGLES: bool = false;
    const UNROLLED: bool = false;
}
