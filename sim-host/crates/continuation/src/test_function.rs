//! Functions of an orbit that are zero at its bifurcations.

use crate::orbit::Orbit;
use nalgebra::Complex;

/// A bifurcation of a periodic orbit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bifurcation {
    /// Two orbits meet and vanish: a multiplier is 1, and the branch turns back.
    Fold,
    /// Branches cross: a multiplier is 1, and the branch does not turn back.
    BranchPoint,
    /// An orbit of twice the period: a multiplier is -1.
    PeriodDoubling,
    /// A torus: a pair of multipliers is on the unit circle.
    NeimarkSacker,
    /// The orbit touches the boundary of a mode: a mode appears in it or vanishes.
    Grazing,
}

impl Bifurcation {
    /// All kinds.
    pub const ALL: [Self; 5] = [
        Self::Fold,
        Self::BranchPoint,
        Self::PeriodDoubling,
        Self::NeimarkSacker,
        Self::Grazing,
    ];

    /// Name in the terms of the field.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fold => "fold",
            Self::BranchPoint => "branch point",
            Self::PeriodDoubling => "period doubling",
            Self::NeimarkSacker => "Neimark-Sacker",
            Self::Grazing => "grazing",
        }
    }

    /// The function that is zero at the bifurcation; NaN where none is.
    pub fn test<M, const N: usize>(self, orbit: &Orbit<M, N>) -> f64 {
        let multipliers = &orbit.multipliers;
        let one = Complex::new(1.0, 0.0);
        let product: Complex<f64> = match self {
            Self::Fold | Self::BranchPoint => multipliers.iter().map(|m| m - one).product(),
            Self::PeriodDoubling => multipliers.iter().map(|m| m + one).product(),
            Self::NeimarkSacker => {
                let pairs = (0..multipliers.len()).flat_map(|i| (0..i).map(move |k| (i, k)));
                pairs
                    .map(|(i, k)| multipliers[i] * multipliers[k] - one)
                    .product()
            }
            Self::Grazing => return f64::NAN,
        };
        product.re
    }
}
