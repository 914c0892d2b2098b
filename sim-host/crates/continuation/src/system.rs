//! Systems of ordinary differential equations that are smooth in each of their modes.

use nalgebra::SVector;
use shared_model::Real;
use std::fmt::Debug;

/// Values of the two parameters that a continuation may vary; one that is not varied is constant.
pub type Parameters<T> = [T; 2];

/// A family of equations in two parameters.
pub trait System<const N: usize> {
    /// In each mode the right-hand side is smooth. A smooth system has the one mode `()`.
    type Mode: Copy + PartialEq + Debug;
    /// The equations in the arithmetic `T`.
    type Equations<T: Real>: Equations<T, N, Mode = Self::Mode>;

    /// The equations at these parameters. Parameters with derivatives give equations with
    /// derivatives.
    fn equations<T: Real>(&self, parameters: Parameters<T>) -> Self::Equations<T>;

    /// Longest step of an integrator, s, in which a margin has at most one extremum. A smooth system
    /// needs no bound.
    fn longest_step_s(&self) -> f64 {
        f64::INFINITY
    }
}

/// Equations at given parameters.
pub trait Equations<T: Real, const N: usize> {
    /// See [`System::Mode`].
    type Mode;

    /// The mode that a trajectory from `x` begins in.
    fn mode_at(&self, x: &SVector<T, N>) -> Self::Mode;

    /// Time derivative of the state.
    fn derivative(&self, x: &SVector<T, N>, mode: Self::Mode) -> SVector<T, N>;

    /// Margins of the mode: it lasts until one of them falls below zero. Infinite where nothing ends
    /// it.
    fn margins(&self, _x: &SVector<T, N>, _mode: Self::Mode) -> [T; 2] {
        [T::from_f64(f64::INFINITY); 2]
    }

    /// The mode that follows where margin number `_passed` of `mode` is zero. May put the state
    /// exactly onto the boundary.
    fn next_mode(&self, _x: &mut SVector<T, N>, mode: Self::Mode, _passed: usize) -> Self::Mode {
        mode
    }

    /// Whether the mode confines the state to a surface, as sticking does: a state beside the surface
    /// belongs to another mode.
    fn is_confined(&self, _mode: Self::Mode) -> bool {
        false
    }
}
