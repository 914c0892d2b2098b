//! The arithmetic of the model.
//!
//! The model is generic over [`Real`], so that one source runs in f32 on the ECU, in f64 on the
//! host, and in any other arithmetic that implements the trait (dual numbers for tangents, numbers
//! that carry an error bound).
//!
//! The transcendental functions go through `libm` on purpose. The standard library's call the
//! platform's C library, whose last bits differ between machines; then firmware and host would not
//! agree bit for bit.

use core::ops::Neg;
use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign, Scalar};

/// A real number as the model needs it.
///
/// Comparisons (`PartialOrd`) use the value alone, also in arithmetics that carry more than a
/// value.
pub trait Real:
    Scalar
    + Copy
    + PartialOrd
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
    + Neg<Output = Self>
{
    /// The nearest number to `value`.
    fn from_f64(value: f64) -> Self;
    /// The nearest number to `value`.
    fn from_u32(value: u32) -> Self {
        Self::from_f64(f64::from(value))
    }
    /// The value as an f64; exact for f32 and f64.
    fn to_f64(self) -> f64;
    /// The value cut to a whole number, saturating at 0 and `u32::MAX`; NaN gives 0.
    fn to_u32(self) -> u32;
    /// Sine of an angle in rad.
    fn sin(self) -> Self;
    /// Cosine of an angle in rad.
    fn cos(self) -> Self;
    /// Arc tangent in rad.
    fn atan(self) -> Self;
    /// Arc sine in rad, for arguments in [-1, 1].
    fn asin(self) -> Self;
    /// Sine of an angle in [-pi, pi] rad as the dither oscillator computes it; its error is at most
    /// [`OSCILLATOR_SINE_ERROR`](crate::dither::OSCILLATOR_SINE_ERROR).
    fn oscillator_sin(self) -> Self;

    /// Zero.
    fn zero() -> Self {
        Self::from_f64(0.0)
    }
    /// One.
    fn one() -> Self {
        Self::from_f64(1.0)
    }
    /// Magnitude.
    fn abs(self) -> Self {
        if self < Self::zero() { -self } else { self }
    }
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool {
        self.to_f64().is_finite()
    }
    /// Bits in which the values of two numbers differ; 0 only if all bits are equal.
    fn differing_bits(self, other: Self) -> u64 {
        self.to_f64().to_bits() ^ other.to_f64().to_bits()
    }
}

impl Real for f32 {
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    // As is_finite: the default goes through f64.
    fn from_u32(value: u32) -> Self {
        value as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn to_u32(self) -> u32 {
        self as u32
    }
    fn sin(self) -> Self {
        libm::sinf(self)
    }
    fn cos(self) -> Self {
        libm::cosf(self)
    }
    fn atan(self) -> Self {
        libm::atanf(self)
    }
    fn asin(self) -> Self {
        libm::asinf(self)
    }
    fn oscillator_sin(self) -> Self {
        micromath::F32(self).sin().0
    }
    // One instruction.
    fn abs(self) -> Self {
        f32::abs(self)
    }
    // The default goes through f64, which the ECU would emulate in software.
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
    // As above.
    fn differing_bits(self, other: Self) -> u64 {
        u64::from(self.to_bits() ^ other.to_bits())
    }
}

impl Real for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn to_u32(self) -> u32 {
        self as u32
    }
    fn sin(self) -> Self {
        libm::sin(self)
    }
    fn cos(self) -> Self {
        libm::cos(self)
    }
    fn atan(self) -> Self {
        libm::atan(self)
    }
    fn asin(self) -> Self {
        libm::asin(self)
    }
    fn oscillator_sin(self) -> Self {
        libm::sin(self)
    }
}
