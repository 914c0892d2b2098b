//! Functions of an orbit that are zero at its bifurcations.

use crate::orbit::Orbit;
use nalgebra::DMatrix;

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

    /// The function that is zero at the bifurcation, a determinant; NaN where none is.
    pub fn test<M, const N: usize>(self, orbit: &Orbit<M, N>) -> f64 {
        let across = &orbit.across;
        let identity = |size| DMatrix::<f64>::identity(size, size);
        match self {
            Self::Fold | Self::BranchPoint => (across - identity(N - 1)).determinant(),
            Self::PeriodDoubling => (across + identity(N - 1)).determinant(),
            Self::NeimarkSacker => {
                let products = products_of_pairs(across);
                let size = products.nrows();
                (products - identity(size)).determinant()
            }
            Self::Grazing => f64::NAN,
        }
    }
}

/// The pairs of indices below `size`, ascending.
fn pairs(size: usize) -> Vec<(usize, usize)> {
    (0..size)
        .flat_map(|high| (0..high).map(move |low| (low, high)))
        .collect()
}

/// The matrix of 2 x 2 minors, whose eigenvalues are the products of pairs of eigenvalues.
fn products_of_pairs(a: &DMatrix<f64>) -> DMatrix<f64> {
    let pairs = pairs(a.nrows());
    DMatrix::from_fn(pairs.len(), pairs.len(), |row, column| {
        let ((p, q), (r, s)) = (pairs[row], pairs[column]);
        a[(p, r)] * a[(q, s)] - a[(p, s)] * a[(q, r)]
    })
}

/// The matrix whose eigenvalues are the sums of pairs of eigenvalues: the derivative of the minors of
/// 1 + t A at t = 0.
pub(crate) fn sums_of_pairs(a: &DMatrix<f64>) -> DMatrix<f64> {
    let pairs = pairs(a.nrows());
    let one = |i: usize, k: usize| f64::from(u8::from(i == k));
    DMatrix::from_fn(pairs.len(), pairs.len(), |row, column| {
        let ((p, q), (r, s)) = (pairs[row], pairs[column]);
        let direct = one(p, r) * a[(q, s)] + a[(p, r)] * one(q, s);
        direct - one(p, s) * a[(q, r)] - a[(p, s)] * one(q, r)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_of_pairs_are_products_and_sums() {
        // Eigenvalues 2, 3 and 5 in another basis.
        let diagonal = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![2.0, 3.0, 5.0]));
        let basis = DMatrix::from_row_slice(3, 3, &[1.0, 0.5, -0.2, 0.3, 1.0, 0.4, -0.1, 0.2, 1.0]);
        let inverse = basis.clone().try_inverse().unwrap();
        let a = &basis * diagonal * inverse;
        for (matrix, wanted) in [
            (products_of_pairs(&a), [6.0, 10.0, 15.0]),
            (sums_of_pairs(&a), [5.0, 7.0, 8.0]),
        ] {
            for value in wanted {
                let shifted = &matrix - DMatrix::<f64>::identity(3, 3) * value;
                assert!(shifted.determinant().abs() < 1e-11, "{value}");
            }
        }
    }
}
