//! Eigenvalues of small matrices, from the characteristic polynomial.

use nalgebra::{SMatrix, SVector};

/// Iterations after which Durand-Kerner has always ended for polynomials of degree four or less.
const MAX_ITERATIONS: usize = 500;

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }

    fn minus(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }

    fn over(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        let conjugate = Self {
            re: other.re / square,
            im: -other.im / square,
        };
        self.times(conjugate)
    }

    /// Absolute value.
    pub fn abs(self) -> f64 {
        self.re.hypot(self.im)
    }
}

impl std::fmt::Display for Complex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.im == 0.0 {
            write!(f, "{:.5}", self.re)
        } else {
            write!(f, "{:.5} {:+.5}i", self.re, self.im)
        }
    }
}

/// Eigenvalues of a matrix, the greatest real part first, of a pair the positive imaginary part first.
///
/// The characteristic polynomial by Faddeev and LeVerrier, its roots by Durand and Kerner (I. O. Kerner, Numerische
/// Mathematik 8 (1966) 290). Good to some 1e-10 of the largest for the
/// distinct roots of well scaled matrices of up to four rows; near a double root to the square root of that.
pub fn eigenvalues<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Vec<Complex> {
    // lambda^N + c[N-1] lambda^(N-1) + ... + c[0].
    let mut coefficients = [0.0; N];
    let mut product = SMatrix::<f64, N, N>::zeros();
    let mut last = 1.0;
    for k in 1..=N {
        product = matrix * product + SMatrix::from_diagonal_element(last);
        last = -(matrix * product).trace() / k as f64;
        coefficients[N - k] = last;
    }
    let mut roots = roots(&coefficients);
    for root in &mut roots {
        if root.im.abs() < 1e-9 * (1.0 + root.abs()) {
            root.im = 0.0;
        }
    }
    roots.sort_by(|a, b| b.re.total_cmp(&a.re).then(b.im.total_cmp(&a.im)));
    // Rounding may tell a pair's real parts apart and so its order.
    for k in 1..N {
        if roots[k].im > 0.0 && (roots[k].im + roots[k - 1].im).abs() < 1e-6 {
            roots.swap(k, k - 1);
        }
    }
    roots
}

/// Roots of the monic polynomial with these coefficients, the constant one first.
fn roots<const N: usize>(coefficients: &[f64; N]) -> Vec<Complex> {
    let real = |re| Complex { re, im: 0.0 };
    let value = |z: Complex| {
        let horner = |sum: Complex, &c: &f64| Complex {
            re: sum.times(z).re + c,
            im: sum.times(z).im,
        };
        coefficients.iter().rev().fold(real(1.0), horner)
    };
    // Begin on a circle of the size of the roots: the N-th root of Cauchy's bound, which is of the size of their product.
    let radius = 1.0 + coefficients.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    let radius = radius.powf(1.0 / N as f64);
    let start = |k: usize| {
        let angle = 0.4 + std::f64::consts::TAU * k as f64 / N as f64;
        Complex {
            re: radius * angle.cos(),
            im: radius * angle.sin(),
        }
    };
    let mut roots: Vec<Complex> = (0..N).map(start).collect();
    for _ in 0..MAX_ITERATIONS {
        let mut change = 0.0_f64;
        for k in 0..N {
            let others = roots.iter().enumerate().filter(|&(j, _)| j != k);
            let product = others.fold(real(1.0), |p, (_, &r)| p.times(roots[k].minus(r)));
            let shift = value(roots[k]).over(product);
            roots[k] = roots[k].minus(shift);
            change = change.max(shift.abs() / (1.0 + roots[k].abs()));
        }
        if change < 1e-15 {
            break;
        }
    }
    roots
}

/// Solves a linear system by Gaussian elimination with partial pivoting; `None` if the matrix is singular.
pub fn solve<const N: usize>(
    mut a: SMatrix<f64, N, N>,
    mut b: SVector<f64, N>,
) -> Option<SVector<f64, N>> {
    for k in 0..N {
        let pivot = (k..N).max_by(|&i, &j| a[(i, k)].abs().total_cmp(&a[(j, k)].abs()))?;
        a.swap_rows(k, pivot);
        b.swap_rows(k, pivot);
        if a[(k, k)] == 0.0 || !a[(k, k)].is_finite() {
            return None;
        }
        for i in k + 1..N {
            let factor = a[(i, k)] / a[(k, k)];
            for j in k..N {
                a[(i, j)] -= factor * a[(k, j)];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            b[k] -= a[(k, j)] * b[j];
        }
        b[k] /= a[(k, k)];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        // Blocks with eigenvalues -1 +- 2i and 3, -20, mixed by a similarity.
        let blocks = Matrix4::new(
            -1.0, 2.0, 0.0, 0.0, -2.0, -1.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, -20.0,
        );
        let mix = Matrix4::new(
            1.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0, -0.7, 0.0, 0.0, 0.0, 1.0,
        );
        let mut inverse = Matrix4::zeros();
        for k in 0..4 {
            let mut unit = Vector4::zeros();
            unit[k] = 1.0;
            inverse.set_column(k, &solve(mix, unit).expect("regular"));
        }
        let found = eigenvalues(&(mix * blocks * inverse));
        let wanted = [(3.0, 0.0), (-1.0, 2.0), (-1.0, -2.0), (-20.0, 0.0)];
        for (found, (re, im)) in found.iter().zip(wanted) {
            let apart = found.minus(Complex { re, im }).abs();
            assert!(apart < 1e-10, "{found}");
        }
        assert!(solve(Matrix4::zeros(), Vector4::zeros()).is_none());
    }
}
