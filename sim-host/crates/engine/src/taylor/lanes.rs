//! Numbers of many motions side by side: `V` vectors of one instruction set, each lane another
//! motion.
//!
//! Loops instead of closures and iterators here and in the steps: an instruction set reaches only
//! code that is inlined into the function compiled for it, and a closure need not be.

use pulp::Simd;
use std::ops::{Add, Mul, Neg, Sub};

/// One number of each motion. All arithmetic is lane by lane and correctly rounded, multiplication
/// with addition fused, so a lane's bits depend neither on its neighbours nor on the instruction
/// set.
///
/// Aligned to a line of the cache: the steps wait for loads, and one across two lines counts twice.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Lanes<S: Simd, const V: usize> {
    simd: S,
    vectors: [S::f64s; V],
}

/// Some of the lanes, a bit each.
pub(super) struct LaneSet(u32);

impl LaneSet {
    /// No lane.
    pub const NONE: Self = Self(0);
}

impl Iterator for LaneSet {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

impl<S: Simd, const V: usize> Lanes<S, V> {
    /// How many there are.
    pub const COUNT: usize = V * S::F64_LANES;

    /// The same number in all lanes.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        let vectors = [simd.splat_f64s(value); V];
        Self { simd, vectors }
    }

    /// Zero in all lanes.
    #[inline(always)]
    pub fn zero(self) -> Self {
        Self::splat(self.simd, 0.0)
    }

    /// One in all lanes.
    #[inline(always)]
    pub fn one(self) -> Self {
        Self::splat(self.simd, 1.0)
    }

    /// A function of each lane, one after the other.
    #[inline(always)]
    pub fn each(self, function: fn(f64) -> f64) -> Self {
        let mut result = self;
        for lane in result.as_mut_slice() {
            *lane = function(*lane);
        }
        result
    }

    /// The lanes as a slice.
    #[inline(always)]
    pub fn as_slice(&self) -> &[f64] {
        bytemuck::cast_slice(&self.vectors)
    }

    /// The lanes as a slice to write to.
    #[inline(always)]
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        bytemuck::cast_slice_mut(&mut self.vectors)
    }

    /// Lanes with a number of at most zero, in their order.
    #[inline(always)]
    pub(crate) fn at_most_zero(&self) -> LaneSet {
        let mut bits = 0;
        for lane in 0..Self::COUNT {
            bits |= u32::from(self.as_slice()[lane] <= 0.0) << lane;
        }
        LaneSet(bits)
    }

    /// `self * factor + sum`, rounded once.
    #[inline(always)]
    pub(crate) fn mul_add(self, factor: Self, sum: Self) -> Self {
        let mut result = sum;
        for v in 0..V {
            result.vectors[v] =
                self.simd
                    .mul_add_f64s(self.vectors[v], factor.vectors[v], sum.vectors[v]);
        }
        result
    }

    /// Times the same number in all lanes.
    #[inline(always)]
    pub fn scale(self, factor: f64) -> Self {
        let factor = self.simd.splat_f64s(factor);
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.mul_f64s(self.vectors[v], factor);
        }
        result
    }

    /// Absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.abs_f64s(self.vectors[v]);
        }
        result
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.sqrt_f64s(self.vectors[v]);
        }
        result
    }

    /// Quotient.
    #[inline(always)]
    pub fn over(self, divisor: Self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.div_f64s(self.vectors[v], divisor.vectors[v]);
        }
        result
    }

    /// The lesser of two numbers.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.min_f64s(self.vectors[v], other.vectors[v]);
        }
        result
    }

    /// The greater of two numbers.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.max_f64s(self.vectors[v], other.vectors[v]);
        }
        result
    }

    /// `yes` where this is less than `bound`, elsewhere `no`.
    #[inline(always)]
    pub(crate) fn select_less(self, bound: Self, yes: Self, no: Self) -> Self {
        let mut result = no;
        for v in 0..V {
            let simd = self.simd;
            let less = simd.less_than_f64s(self.vectors[v], bound.vectors[v]);
            result.vectors[v] = simd.select_f64s(less, yes.vectors[v], no.vectors[v]);
        }
        result
    }

    /// This is less than `bound` in every lane.
    #[inline(always)]
    pub(crate) fn all_less(self, bound: Self) -> bool {
        let mut all = true;
        for v in 0..V {
            let less = self.simd.less_than_f64s(self.vectors[v], bound.vectors[v]);
            all &= self.simd.first_true_m64s(self.simd.not_m64s(less)) >= S::F64_LANES;
        }
        all
    }
}

impl<S: Simd, const V: usize> Add for Lanes<S, V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.add_f64s(self.vectors[v], other.vectors[v]);
        }
        result
    }
}

impl<S: Simd, const V: usize> Sub for Lanes<S, V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.sub_f64s(self.vectors[v], other.vectors[v]);
        }
        result
    }
}

impl<S: Simd, const V: usize> Mul for Lanes<S, V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.mul_f64s(self.vectors[v], other.vectors[v]);
        }
        result
    }
}

impl<S: Simd, const V: usize> Neg for Lanes<S, V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut result = self;
        for v in 0..V {
            result.vectors[v] = self.simd.neg_f64s(self.vectors[v]);
        }
        result
    }
}
