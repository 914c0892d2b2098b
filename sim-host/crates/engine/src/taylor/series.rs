//! Sums of products that give a coefficient of a series from those of others.

use super::lanes::Lanes;
use pulp::Simd;
use shared_model::Real;

/// Order of the expansion.
pub const ORDER: usize = 12;

/// Coefficients 0 to `ORDER` of one quantity.
pub(super) type Series<S, const V: usize> = [Lanes<S, V>; ORDER + 1];

/// Coefficients of one lane.
#[inline(always)]
pub(super) fn of_lane<S: Simd, const V: usize>(
    series: &Series<S, V>,
    lane: usize,
) -> [f64; ORDER + 1] {
    let mut coefficients = [0.0; ORDER + 1];
    for k in 0..ORDER + 1 {
        coefficients[k] = series[k].as_slice()[lane];
    }
    coefficients
}

/// Coefficient `n` of the product of two series. The terms that were known last are added last: the
/// processor has added the others by then.
#[inline(always)]
pub(super) fn product<S: Simd, const V: usize>(
    a: &Series<S, V>,
    b: &Series<S, V>,
    n: usize,
) -> Lanes<S, V> {
    if n == 0 {
        return a[0] * b[0];
    }
    a[n].mul_add(b[0], a[0].mul_add(b[n], inner_product(a, b, n)))
}

/// The same without the terms that have a coefficient of order `n`.
#[inline(always)]
pub(super) fn inner_product<S: Simd, const V: usize>(
    a: &Series<S, V>,
    b: &Series<S, V>,
    n: usize,
) -> Lanes<S, V> {
    let mut sum = a[0].zero();
    for j in 1..n {
        sum = a[j].mul_add(b[n - j], sum);
    }
    sum
}

/// Coefficient `n` of the square of a series, without the term that has its coefficient of order
/// `n`.
#[inline(always)]
pub(super) fn inner_square<S: Simd, const V: usize>(a: &Series<S, V>, n: usize) -> Lanes<S, V> {
    let mut sum = a[0].zero();
    for j in 1..n.div_ceil(2) {
        sum = a[j].mul_add(a[n - j], sum);
    }
    sum = sum + sum;
    if n.is_multiple_of(2) {
        sum = a[n / 2].mul_add(a[n / 2], sum);
    }
    sum
}

/// Coefficient `n` of the integral of the product of `rate`'s and `factor`: `rate` has coefficient
/// j of a series times j.
#[inline(always)]
fn integral<S: Simd, const V: usize>(
    rate: &Series<S, V>,
    factor: &Series<S, V>,
    n: usize,
) -> Lanes<S, V> {
    let sum = rate[n].mul_add(factor[0], inner_product(rate, factor, n));
    sum.scale(1.0 / n as f64)
}

/// Value at `t` of a series.
#[inline(always)]
pub(super) fn value<S: Simd, const V: usize>(series: &Series<S, V>, t: Lanes<S, V>) -> Lanes<S, V> {
    let mut sum = series[ORDER];
    for k in (0..ORDER).rev() {
        sum = sum.mul_add(t, series[k]);
    }
    sum
}

/// Series of the arctangent of a quantity.
#[derive(Debug, Clone, Copy)]
pub(super) struct Atan<S: Simd, const V: usize> {
    /// The quantity's coefficient j, times j but for the constant one.
    rate: Series<S, V>,
    argument: Series<S, V>,
    /// 1 + u^2.
    denominator: Series<S, V>,
    /// The derivative 1/(1 + u^2).
    pub slope: Series<S, V>,
    /// The arctangent.
    pub value: Series<S, V>,
}

impl<S: Simd, const V: usize> Atan<S, V> {
    /// Of zero.
    pub fn new(simd: S) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        Self {
            rate: zero,
            argument: zero,
            denominator: zero,
            slope: zero,
            value: zero,
        }
    }

    /// Works out coefficient `n`, given that of the quantity.
    #[inline(always)]
    pub fn push(&mut self, n: usize, argument: Lanes<S, V>) {
        self.argument[n] = argument;
        let begin = self.argument[0];
        if n == 0 {
            self.denominator[0] = begin.mul_add(begin, begin.one());
            self.slope[0] = begin.one().over(self.denominator[0]);
            self.value[0] = begin.each(Real::atan);
            return;
        }
        self.rate[n] = argument.scale(n as f64);
        let square = (begin + begin).mul_add(argument, inner_square(&self.argument, n));
        self.denominator[n] = square;
        let known = inner_product(&self.denominator, &self.slope, n);
        self.slope[n] = -(square.mul_add(self.slope[0], known) * self.slope[0]);
        self.value[n] = integral(&self.rate, &self.slope, n);
    }
}

/// Series of sine and cosine of a quantity.
#[derive(Debug, Clone, Copy)]
pub(super) struct SinCos<S: Simd, const V: usize> {
    /// The quantity's coefficient j, times j.
    rate: Series<S, V>,
    /// The sine.
    pub sin: Series<S, V>,
    /// The cosine.
    pub cos: Series<S, V>,
}

impl<S: Simd, const V: usize> SinCos<S, V> {
    /// Room for them.
    pub fn new(simd: S) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        Self {
            rate: zero,
            sin: zero,
            cos: zero,
        }
    }

    /// Works out coefficient `n`, given that of the quantity.
    #[inline(always)]
    pub fn push(&mut self, n: usize, argument: Lanes<S, V>) {
        if n == 0 {
            self.sin[0] = argument.each(Real::sin);
            self.cos[0] = argument.each(Real::cos);
            return;
        }
        self.rate[n] = argument.scale(n as f64);
        self.sin[n] = integral(&self.rate, &self.cos, n);
        self.cos[n] = -integral(&self.rate, &self.sin, n);
    }
}
