//! placeholder until merged
use crate::Real;
/// placeholder
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule<T> {
    a: T,
}
impl<T: Real> Schedule<T> {
    /// p
    pub fn none() -> Self {
        Self { a: T::zero() }
    }
    /// p
    pub fn constant(a: f64) -> Self {
        Self { a: T::from_f64(a) }
    }
    /// p
    pub fn amplitude_v(&self, _speed_rpm: T) -> T {
        self.a
    }
}
