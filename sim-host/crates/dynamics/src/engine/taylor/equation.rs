//! The kinds of right-hand side.

use super::flight::{self, Flight};
use super::motion::Span;
use super::queue::Queue;
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

    /// Follows motions of the queue, up to `most` at once, in as many vectors side by side as suit the equation.
    fn fly<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<flight::Result<K>>;
}

/// Cubic tyres at small slip angles.
pub(super) struct Polynomial;

impl Equation for Polynomial {
    type Tires<S: Simd, const V: usize> = CubicTires<S, V>;
    const SMALL_ANGLES: bool = true;
    // It takes a third off the time.
    const UNROLLED: bool = true;

    // Two vectors: enough to hide the latency of a multiplication.
    #[inline(always)]
    fn fly<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<flight::Result<K>> {
        Flight::<S, 2, K, Self>::new(simd, queue, span, most).run()
    }
}

/// Exact slip angles, the Magic Formula, or both; alike for all motions of a flight. No polynomial, but sines and arctangents have
/// recurrences too.
pub(super) struct Analytic;

impl Equation for Analytic {
    type Tires<S: Simd, const V: usize> = EitherTires<S, V>;
    const SMALL_ANGLES: bool = false;
    const UNROLLED: bool = false;

    // One vector: the recurrences are long enough to hide their latencies.
    #[inline(always)]
    fn fly<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<flight::Result<K>> {
        Flight::<S, 1, K, Self>::new(simd, queue, span, most).run()
    }
}
