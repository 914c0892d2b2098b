//! Running error analysis: a value, and a bound on how far the same computation in f32 can be from
//! it.
//!
//! Each operation rounds its exact result by at most the unit roundoff u = 2^-24 of it. A
//! [`Rounded`] carries the value as f64 has it (whose own rounding, 2^-29 of that of f32, is left
//! out) and adds up what the operands' errors and the operation's rounding can amount to. The model
//! evaluated in it bounds the ECU's error step by step, from the model's own text. Reference: N. J.
//! Higham, Accuracy and Stability of Numerical Algorithms, section 3.3.

use shared_model::Real;
use shared_model::dither::OSCILLATOR_SINE_ERROR;
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// Unit roundoff of f32.
const UNIT: f64 = 1.0 / 16_777_216.0;

/// A value, and a bound on the error of the f32 computation. Comparisons look at the value alone.
#[derive(Debug, Clone, Copy)]
pub struct Rounded {
    /// The value.
    pub value: f64,
    /// The f32 computation is at most this far from it.
    pub error: f64,
}

impl Rounded {
    /// A number that f32 has exactly.
    pub fn exact(value: f32) -> Self {
        Self {
            value: value.into(),
            error: 0.0,
        }
    }

    /// The rounded result of an operation: its exact value, and how far the operands' errors can
    /// move it.
    fn of(value: f64, propagated: f64) -> Self {
        Self {
            value,
            error: propagated + UNIT * (value.abs() + propagated),
        }
    }

    /// As [`of`](Self::of) for a library function whose result is within one unit in the last
    /// place, twice the roundoff.
    fn of_function(value: f64, propagated: f64) -> Self {
        Self {
            value,
            error: propagated + 2.0 * UNIT * (value.abs() + propagated),
        }
    }
}

impl PartialEq for Rounded {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialOrd for Rounded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl Add for Rounded {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::of(self.value + other.value, self.error + other.error)
    }
}

impl Sub for Rounded {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::of(self.value - other.value, self.error + other.error)
    }
}

impl Mul for Rounded {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let propagated = self.value.abs() * other.error
            + other.value.abs() * self.error
            + self.error * other.error;
        Self::of(self.value * other.value, propagated)
    }
}

impl Div for Rounded {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        let least_divisor = other.value.abs() - other.error;
        let propagated = if least_divisor > 0.0 {
            (self.error + quotient.abs() * other.error) / least_divisor
        } else {
            f64::INFINITY
        };
        Self::of(quotient, propagated)
    }
}

impl Neg for Rounded {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            error: self.error,
        }
    }
}

impl AddAssign for Rounded {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Rounded {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MulAssign for Rounded {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl DivAssign for Rounded {
    fn div_assign(&mut self, other: Self) {
        *self = *self / other;
    }
}

impl Real for Rounded {
    fn from_f64(value: f64) -> Self {
        Self {
            value,
            error: (f64::from(value as f32) - value).abs(),
        }
    }
    fn to_f64(self) -> f64 {
        self.value
    }
    fn to_u32(self) -> u32 {
        self.value.to_u32()
    }
    fn sin(self) -> Self {
        Self::of_function(Real::sin(self.value), self.error)
    }
    fn cos(self) -> Self {
        Self::of_function(Real::cos(self.value), self.error)
    }
    fn atan(self) -> Self {
        Self::of_function(Real::atan(self.value), self.error)
    }
    fn asin(self) -> Self {
        // Steepest at the end of the error interval that lies nearer to 1.
        let value = Real::asin(self.value);
        let furthest = Real::asin((self.value.abs() + self.error).min(1.0));
        Self::of_function(value, furthest - value.abs())
    }
    fn oscillator_sin(self) -> Self {
        Self {
            value: Real::sin(self.value),
            error: self.error + OSCILLATOR_SINE_ERROR,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn f<T: Real>(x: T, y: T) -> T {
        let z = x * y - y / (x + T::from_f64(0.1));
        (z.sin() + (x * z).atan()) * T::from_f64(3.3) - y.cos()
    }

    #[test]
    fn bounds_hold_and_are_not_slack() {
        let mut worst: f64 = 0.0;
        for i in 0..2000_u16 {
            let (x, y) = (0.3 + f32::from(i) * 1e-3, 1.7 - f32::from(i) * 7e-4);
            let bounded = f(Rounded::exact(x), Rounded::exact(y));
            let defect = (f64::from(f(x, y)) - f(f64::from(x), f64::from(y))).abs();
            assert!(defect <= bounded.error, "{defect} over {bounded:?}");
            worst = worst.max(defect / bounded.error);
        }
        assert!(worst > 0.1, "a bound {worst} of which is used says nothing");
    }
}
