//! Dual numbers: a value and its derivatives along N tangent vectors.
//!
//! The model evaluated in them is its own linearisation. Through a step that is split at a friction
//! event the derivative of the event's time goes along, so the result is the linearised flow with
//! the right jump (saltation) at the event.

use shared_model::Real;
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value with N derivatives. Comparisons look at the value alone.
#[derive(Debug, Clone, Copy)]
pub struct Dual<const N: usize> {
    /// The value.
    pub value: f64,
    /// Its derivatives.
    pub tangent: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// A value with the given derivatives.
    pub fn new(value: f64, tangent: [f64; N]) -> Self {
        Self { value, tangent }
    }

    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self::new(value, [0.0; N])
    }

    /// A function's value here, given it and its derivative.
    fn chain(self, value: f64, derivative: f64) -> Self {
        Self::new(value, self.tangent.map(|t| derivative * t))
    }

    /// `a self + b other` in the tangents, with the given value.
    fn combine(self, a: f64, other: Self, b: f64, value: f64) -> Self {
        let tangent = std::array::from_fn(|i| a * self.tangent[i] + b * other.tangent[i]);
        Self::new(value, tangent)
    }
}

impl<const N: usize> PartialEq for Dual<N> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const N: usize> PartialOrd for Dual<N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.combine(1.0, other, 1.0, self.value + other.value)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.combine(1.0, other, -1.0, self.value - other.value)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.combine(other.value, other, self.value, self.value * other.value)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        self.combine(1.0 / other.value, other, -quotient / other.value, quotient)
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> AddAssign for Dual<N> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> SubAssign for Dual<N> {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<const N: usize> MulAssign for Dual<N> {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl<const N: usize> DivAssign for Dual<N> {
    fn div_assign(&mut self, other: Self) {
        *self = *self / other;
    }
}

impl<const N: usize> Real for Dual<N> {
    fn from_f64(value: f64) -> Self {
        Self::constant(value)
    }
    fn to_f64(self) -> f64 {
        self.value
    }
    fn to_u32(self) -> u32 {
        self.value.to_u32()
    }
    fn sin(self) -> Self {
        self.chain(Real::sin(self.value), Real::cos(self.value))
    }
    fn cos(self) -> Self {
        self.chain(Real::cos(self.value), -Real::sin(self.value))
    }
    fn atan(self) -> Self {
        self.chain(
            Real::atan(self.value),
            1.0 / (1.0 + self.value * self.value),
        )
    }
    fn asin(self) -> Self {
        self.chain(
            Real::asin(self.value),
            1.0 / (1.0 - self.value * self.value).sqrt(),
        )
    }
    fn oscillator_sin(self) -> Self {
        self.sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f(x, y) with every operation in it, against central differences.
    fn f<T: Real>(x: T, y: T) -> T {
        let mut z = x * y - y / x;
        z += x.sin() * y.cos();
        z -= (x * y).atan();
        z *= T::from_f64(0.5);
        z /= T::one() + y * y;
        -z + (T::from_f64(0.3) * x).asin()
    }

    #[test]
    fn derivatives_match_central_differences() {
        let (x, y, h) = (0.7, -1.3, 1e-5);
        let dual = f(Dual::new(x, [1.0, 0.0]), Dual::new(y, [0.0, 1.0]));
        let by_x = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let by_y = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        assert_eq!(dual.value, f(x, y));
        assert!((dual.tangent[0] - by_x).abs() < 1e-9);
        assert!((dual.tangent[1] - by_y).abs() < 1e-9);
    }
}
