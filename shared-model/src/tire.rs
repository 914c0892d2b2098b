//! Tyres: cornering force against slip angle.
//!
//! The sign is the paper's: D > 0, so that the force has the sign of the slip angle and its cubic
//! term bounds it.

use crate::Real;
use crate::dither::{Injection, SineMean};
use crate::listed;
use crate::parameter::parameters;

parameters! {
    section "tire";
    /// The Magic Formula's coefficients for one axle, equations (6) and (7).
    pub struct MagicFormula {
        /// Stiffness factor B, 1/rad.
        stiffness_per_rad: 0.1..=100.0,
        /// Shape factor C.
        shape: 0.1..=10.0,
        /// Peak force D, N. Negative is the usual vehicle sign, with which the motion diverges here.
        peak_n: -1e6..=1e6,
        /// Curvature factor E.
        curvature: -100.0..=1.0,
    }
}

impl<T: Real> MagicFormula<T> {
    /// Cornering force at slip angle `alpha` (rad), N:
    /// F = D sin(C atan(B (1 - E) alpha + E atan(B alpha))), equations (6) and (7).
    ///
    /// ```
    /// let force = shared_model::tire::LOW_FRICTION_ROAD.0.force(0.1);
    /// assert!((force - 2571.878_738_f64).abs() < 1e-6);
    /// ```
    pub fn force(&self, alpha: T) -> T {
        let b_alpha = self.stiffness_per_rad * alpha;
        let argument = b_alpha * (T::one() - self.curvature) + self.curvature * b_alpha.atan();
        self.peak_n * (self.shape * argument.atan()).sin()
    }

    /// The cubic tyre with the same first and third derivative at zero slip, equations (8) and (9).
    ///
    /// k1 = B C D, k2 = D E C B^3/3 + D C B^3/3 + D (C B)^3/6.
    ///
    /// ```
    /// let front = shared_model::tire::LOW_FRICTION_ROAD.0.cubic();
    /// assert!((front.linear_n_per_rad - 45_286.398_f64).abs() < 1e-3);
    /// assert!((front.cubic_n_per_rad3 - 417_962.679_f64).abs() < 1e-3);
    /// ```
    pub fn cubic(&self) -> CubicTire<T> {
        let third = T::from_f64(1.0 / 3.0);
        let sixth = T::from_f64(1.0 / 6.0);
        let (b, c, d) = (self.stiffness_per_rad, self.shape, self.peak_n);
        let b_cubed = b * b * b;
        CubicTire {
            linear_n_per_rad: b * c * d,
            cubic_n_per_rad3: d * c * b_cubed * third * (self.curvature + T::one())
                + d * c * c * c * b_cubed * sixth,
        }
    }

    /// Cornering force with the dither ahead of it: its mean by quadrature of (23).
    // Out of line: it is long, and would keep the cubic tyre's few instructions from being put
    // where they are needed.
    #[inline(never)]
    fn dithered_force(&self, mean: &SineMean<T>, alpha: T, injection: Injection<T>) -> T {
        match injection {
            Injection::Off => self.force(alpha),
            Injection::Shift { offset } => self.force(alpha + offset),
            Injection::SquareMean { amplitude } => {
                T::from_f64(0.5) * (self.force(alpha + amplitude) + self.force(alpha - amplitude))
            }
            Injection::SineMean { amplitude } => mean.of(|a| self.force(a), alpha, amplitude),
        }
    }
}

/// Coefficients of Table 1: front and rear axle.
pub type Road = (MagicFormula<f64>, MagicFormula<f64>);

/// Set A of Table 1. The table calls it the high-friction road, but (D_f + D_r)/(m g) is 0.29: this
/// is the low-friction road that the paper's results are about.
pub const LOW_FRICTION_ROAD: Road = (
    MagicFormula {
        stiffness_per_rad: 11.275,
        shape: 1.56,
        peak_n: 2574.7,
        curvature: -1.999,
    },
    MagicFormula {
        stiffness_per_rad: 18.631,
        shape: 1.56,
        peak_n: 1749.7,
        curvature: -1.7908,
    },
);

/// Set B of Table 1, (D_f + D_r)/(m g) = 0.81. Its front tyre's cubic coefficient is negative: with
/// the cubic tyre the motion diverges.
pub const HIGH_FRICTION_ROAD: Road = (
    MagicFormula {
        stiffness_per_rad: 6.7651,
        shape: 1.3,
        peak_n: 6436.8,
        curvature: -1.999,
    },
    MagicFormula {
        stiffness_per_rad: 9.0051,
        shape: 1.3,
        peak_n: 5430.0,
        curvature: -1.7908,
    },
);

/// The cubic tyre, equations (8) and (9): F = k1 alpha - k2 alpha^3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CubicTire<T> {
    /// Cornering stiffness k1 (k3 at the rear), N/rad.
    pub linear_n_per_rad: T,
    /// Cubic coefficient k2 (k4 at the rear), N/rad^3.
    pub cubic_n_per_rad3: T,
}

impl<T: Real> CubicTire<T> {
    /// Cornering force at slip angle `alpha` (rad), N.
    ///
    /// ```
    /// use shared_model::tire::CubicTire;
    /// let tire = CubicTire { linear_n_per_rad: 10.0, cubic_n_per_rad3: 100.0 };
    /// assert_eq!(tire.force(0.5), -7.5);
    /// ```
    pub fn force(&self, alpha: T) -> T {
        alpha * (self.linear_n_per_rad - self.cubic_n_per_rad3 * alpha * alpha)
    }

    /// Cornering force with the dither ahead of it: its mean in closed form.
    #[inline(always)]
    fn dithered_force(&self, alpha: T, injection: Injection<T>) -> T {
        match injection {
            Injection::Shift { offset } => self.force(alpha + offset),
            _ => self.averaged(injection).force(alpha),
        }
    }

    /// The same coefficients in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> CubicTire<U> {
        CubicTire {
            linear_n_per_rad: f(self.linear_n_per_rad),
            cubic_n_per_rad3: f(self.cubic_n_per_rad3),
        }
    }

    /// The tyre that a slip angle meets on average under the mean of a dither; a held sample moves
    /// the slip angle instead.
    #[inline(always)]
    pub fn averaged(&self, injection: Injection<T>) -> Self {
        match injection {
            Injection::Off | Injection::Shift { .. } => *self,
            Injection::SquareMean { amplitude } => self.softened(amplitude * amplitude),
            Injection::SineMean { amplitude } => {
                self.softened(T::from_f64(0.5) * amplitude * amplitude)
            }
        }
    }

    /// The tyre that a dithered slip angle meets on average. The mean of the cube under a zero-mean
    /// dither of mean square W^2 (square) or W^2/2 (sine) adds 3 k2 alpha times that to the
    /// linear term, so the mean is a cubic tyre again: (21) gives k1 - 3 k2 W^2, (23) gives k1
    /// - 1.5 k2 W^2.
    ///
    /// ```
    /// use shared_model::tire::CubicTire;
    /// let tire = CubicTire { linear_n_per_rad: 10.0, cubic_n_per_rad3: 100.0 };
    /// // Dither of amplitude 0.1 rad: mean square 0.01 rad^2.
    /// assert_eq!(tire.softened(0.01).linear_n_per_rad, 7.0);
    /// ```
    pub fn softened(&self, mean_square_rad2: T) -> Self {
        let three = T::from_f64(3.0);
        Self {
            linear_n_per_rad: self.linear_n_per_rad
                - three * self.cubic_n_per_rad3 * mean_square_rad2,
            ..*self
        }
    }
}

listed! {
    /// Which tyre the model uses.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
    pub enum TireModel {
        /// Equations (8) and (9).
        Cubic => "cubic",
        /// Equations (6) and (7).
        MagicFormula => "magic_formula",
    }
}

/// Front or rear axle's tyres, ready to be evaluated.
#[derive(Debug, Clone, Copy)]
pub enum Tire<T> {
    /// Equations (8) and (9).
    Cubic(CubicTire<T>),
    /// Equations (6) and (7).
    MagicFormula(MagicFormula<T>, SineMean<T>),
}

impl<T: Real> Tire<T> {
    /// The tyre of the given model and coefficients.
    pub fn new(model: TireModel, coefficients: &MagicFormula<T>) -> Self {
        match model {
            TireModel::Cubic => Self::Cubic(coefficients.cubic()),
            TireModel::MagicFormula => Self::MagicFormula(*coefficients, SineMean::new()),
        }
    }

    /// The same tyre in another arithmetic.
    pub fn map<U: Real>(&self, f: &impl Fn(T) -> U) -> Tire<U> {
        match self {
            Self::Cubic(tire) => Tire::Cubic(tire.map(f)),
            Self::MagicFormula(tire, mean) => Tire::MagicFormula(tire.map(f), mean.map(f)),
        }
    }

    /// Cornering force (N) at slip angle `alpha` (rad), with the dither ahead of the nonlinearity:
    /// closed form for the cubic tyre, quadrature of (23) for the Magic Formula.
    #[inline(always)]
    pub fn force(&self, alpha: T, injection: Injection<T>) -> T {
        match self {
            Self::Cubic(tire) => tire.dithered_force(alpha, injection),
            Self::MagicFormula(tire, mean) => tire.dithered_force(mean, alpha, injection),
        }
    }
}
