//! Eigenvalues of small matrices.

use nalgebra::{DMatrix, SMatrix, Schur};

/// Iterations of the decomposition, of which each eigenvalue takes two or three.
const MOST_ITERATIONS: usize = 1000;

/// An eigenvalue, 1/s where the matrix is that of a motion's rates.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Eigenvalue {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl std::fmt::Display for Eigenvalue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.im == 0.0 {
            write!(f, "{:.5}", self.re)
        } else {
            write!(f, "{:.5} {:+.5}i", self.re, self.im)
        }
    }
}

/// Eigenvalues of a matrix, the greatest real part first, of a pair the positive imaginary part
/// first; not a number, each of them, if the matrix's numbers are not finite.
///
/// By the real Schur decomposition. Good to some 1e-10 of the largest for the distinct ones of well
/// scaled matrices; near a double one to the square root of that.
pub fn eigenvalues<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Vec<Eigenvalue> {
    let matrix = DMatrix::from_column_slice(N, N, matrix.as_slice());
    let Some(schur) = Schur::try_new(matrix, f64::EPSILON, MOST_ITERATIONS) else {
        let (re, im) = (f64::NAN, f64::NAN);
        return vec![Eigenvalue { re, im }; N];
    };
    let values = schur.complex_eigenvalues();
    let mut values: Vec<_> = values
        .iter()
        .map(|value| Eigenvalue {
            re: value.re,
            im: value.im,
        })
        .collect();
    values.sort_by(|a, b| b.re.total_cmp(&a.re).then(b.im.total_cmp(&a.im)));
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix4;

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        // Blocks with eigenvalues -1 +- 2i and 3, -20, mixed by a similarity.
        let blocks = Matrix4::new(
            -1.0, 2.0, 0.0, 0.0, -2.0, -1.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, -20.0,
        );
        let mix = Matrix4::new(
            1.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0, -0.7, 0.0, 0.0, 0.0, 1.0,
        );
        let inverse = mix.try_inverse().expect("regular");
        let found = eigenvalues(&(mix * blocks * inverse));
        let wanted = [(3.0, 0.0), (-1.0, 2.0), (-1.0, -2.0), (-20.0, 0.0)];
        for (found, (re, im)) in found.iter().zip(wanted) {
            let apart = (found.re - re).hypot(found.im - im);
            assert!(apart < 1e-10, "{found}");
        }
        let of_none = eigenvalues(&Matrix4::from_element(f64::NAN));
        assert!(of_none.len() == 4 && of_none.iter().all(|e| e.re.is_nan()));
    }
}
