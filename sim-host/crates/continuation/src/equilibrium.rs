//! Equilibria over one parameter or two, and Hopf bifurcations with their criticality.

use crate::arclength::{End, Evaluation, Function, Point, Problem, Settings, Step, locate, walk};
use crate::failure::Failure;
use crate::system::{Equations, Parameters, System};
use crate::test_function::sums_of_pairs;
use crate::trajectory::seed;
use engine::dual::Dual;
use nalgebra::{Complex, DMatrix, DVector, SMatrix, SVector};

/// Real part, as a share of the imaginary one, of the pair that proves a Hopf bifurcation located.
const ON_AXIS: f64 = 1e-6;
/// Displacement of the differences for the second and third derivatives, in the scales.
const DISPLACEMENT: f64 = 1e-3;

/// An equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium<const N: usize> {
    /// The state.
    pub x: SVector<f64, N>,
    /// The parameters.
    pub parameters: Parameters<f64>,
    /// Derivative of the right-hand side by the state, 1/s.
    pub jacobian: SMatrix<f64, N, N>,
    /// Its eigenvalues by descending real part, 1/s.
    pub eigenvalues_per_s: Vec<Complex<f64>>,
}

impl<const N: usize> Equilibrium<N> {
    /// All eigenvalues have negative real parts.
    pub fn is_stable(&self) -> bool {
        self.eigenvalues_per_s
            .iter()
            .all(|eigenvalue| eigenvalue.re < 0.0)
    }

    /// The sums of all pairs of eigenvalues, multiplied: zero at a Hopf bifurcation.
    pub(crate) fn hopf_test(&self) -> f64 {
        let jacobian = DMatrix::from_fn(N, N, |i, k| self.jacobian[(i, k)]);
        sums_of_pairs(&jacobian).determinant()
    }

    /// The complex pair nearest to the imaginary axis.
    fn leading_pair(&self) -> Option<Complex<f64>> {
        let pairs = self
            .eigenvalues_per_s
            .iter()
            .filter(|eigenvalue| eigenvalue.im > 0.0);
        pairs
            .min_by(|a, b| a.re.abs().total_cmp(&b.re.abs()))
            .copied()
    }
}

/// The equations of an equilibrium in one mode. `K` is `N + 2`.
#[derive(Debug)]
pub struct Equilibria<'a, S: System<N>, const N: usize, const K: usize> {
    system: &'a S,
    mode: S::Mode,
    free: usize,
    parameters: Parameters<f64>,
    scales: DVector<f64>,
}

// Derived, it would need a system that can be cloned.
impl<S: System<N>, const N: usize, const K: usize> Clone for Equilibria<'_, S, N, K> {
    fn clone(&self) -> Self {
        Self {
            scales: self.scales.clone(),
            ..*self
        }
    }
}

impl<'a, S: System<N>, const N: usize, const K: usize> Equilibria<'a, S, N, K> {
    /// The equations with states of the sizes `sizes`; `spans` are the extents over which the parameters
    /// are of interest, as many as are unknown.
    pub fn new(
        system: &'a S,
        mode: S::Mode,
        sizes: &SVector<f64, N>,
        parameters: Parameters<f64>,
        spans: &[f64],
    ) -> Self {
        let scales = sizes.iter().chain(spans).copied();
        Self {
            system,
            mode,
            free: spans.len(),
            parameters,
            scales: DVector::from_iterator(N + spans.len(), scales),
        }
    }

    /// Unknowns at a state and parameters.
    pub fn unknowns(&self, x: &SVector<f64, N>, parameters: Parameters<f64>) -> DVector<f64> {
        let all = x
            .iter()
            .copied()
            .chain(parameters[..self.free].iter().copied());
        DVector::from_iterator(N + self.free, all)
    }

    /// The unit vector of the first parameter.
    pub fn parameter_axis(&self, sign: f64) -> DVector<f64> {
        let mut axis = DVector::zeros(self.scales.len());
        axis[N] = sign;
        axis
    }

    /// A matrix in the scales.
    fn scaled(&self, matrix: &SMatrix<f64, N, N>) -> DMatrix<Complex<f64>> {
        DMatrix::from_fn(N, N, |i, k| {
            Complex::new(matrix[(i, k)] * self.scales[k] / self.scales[i], 0.0)
        })
    }

    fn jacobian(&self, x: &SVector<f64, N>, parameters: Parameters<f64>) -> SMatrix<f64, N, N> {
        let rates = self.rates(x, parameters);
        SMatrix::from_fn(|i, k| rates[i].tangent[k])
    }

    fn rates(&self, x: &SVector<f64, N>, parameters: Parameters<f64>) -> SVector<Dual<K>, N> {
        let equations = self
            .system
            .equations(std::array::from_fn(|k| seed(parameters[k], N + k)));
        let x = SVector::from_fn(|i, _| seed(x[i], i));
        equations.derivative(&x, self.mode)
    }

    /// First Lyapunov coefficient of a Hopf bifurcation: negative where a stable orbit is born
    /// (Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, equation (3.20); the eigenvector has
    /// length 1 in the scales).
    pub fn first_lyapunov_coefficient(&self, at: &Equilibrium<N>) -> Option<f64> {
        let omega = at.leading_pair()?.im;
        let i_omega = Complex::new(0.0, omega);
        let jacobian = self.scaled(&at.jacobian);
        let identity = DMatrix::<Complex<f64>>::identity(N, N);
        let q = null_vector(&jacobian - &identity * i_omega)?;
        let p = null_vector(jacobian.transpose() + &identity * i_omega)?;
        let p = &p / p.dotc(&q).conj();
        // Differences of the Jacobian: with cubic forces they are exact.
        let displaced = |along: &[(&DVector<f64>, f64)]| {
            let mut x = at.x;
            for (vector, sign) in along {
                for i in 0..N {
                    x[i] += sign * DISPLACEMENT * vector[i] * self.scales[i];
                }
            }
            self.scaled(&self.jacobian(&x, at.parameters))
        };
        let second = |u: &DVector<f64>, v: &DVector<Complex<f64>>| {
            (displaced(&[(u, 1.0)]) - displaced(&[(u, -1.0)])) * v
                / Complex::from(2.0 * DISPLACEMENT)
        };
        let third = |u: &DVector<f64>, v: &DVector<f64>, w: &DVector<Complex<f64>>| {
            let sum = displaced(&[(u, 1.0), (v, 1.0)])
                - displaced(&[(u, 1.0), (v, -1.0)])
                - displaced(&[(u, -1.0), (v, 1.0)])
                + displaced(&[(u, -1.0), (v, -1.0)]);
            sum * w / Complex::from(4.0 * DISPLACEMENT * DISPLACEMENT)
        };
        let (a, b) = (q.map(|c| c.re), q.map(|c| c.im));
        let i = Complex::new(0.0, 1.0);
        let along_q = |v: &DVector<Complex<f64>>| second(&a, v) + second(&b, v) * i;
        let against_q = |v: &DVector<Complex<f64>>| second(&a, v) - second(&b, v) * i;
        let conjugate = q.map(|c| c.conj());
        let mean = jacobian.clone().lu().solve(&along_q(&conjugate))?;
        let twice = (&identity * (i_omega * 2.0) - &jacobian)
            .lu()
            .solve(&along_q(&q))?;
        // C(q, q, conj q) with q = a + i b is C(a, a, q) + C(b, b, q).
        let cubic = third(&a, &a, &q) + third(&b, &b, &q);
        let value = p.dotc(&cubic) - p.dotc(&along_q(&mean)) * 2.0 + p.dotc(&against_q(&twice));
        Some(value.re / (2.0 * omega))
    }

    /// Guess of the small orbit beside a Hopf bifurcation: displacement of the state, in its units, for an
    /// amplitude in the scales, and the period, s.
    pub fn orbit_guess(
        &self,
        at: &Equilibrium<N>,
        amplitude: f64,
    ) -> Option<(SVector<f64, N>, f64)> {
        let omega = at.leading_pair()?.im;
        let scaled = self.scaled(&at.jacobian);
        let q = null_vector(scaled - DMatrix::identity(N, N) * Complex::new(0.0, omega))?;
        let displacement = SVector::from_fn(|i, _| amplitude * q[i].re * self.scales[i]);
        Some((displacement, std::f64::consts::TAU / omega))
    }
}

/// The vector of length 1 that a singular matrix takes to zero, nearly.
fn null_vector(matrix: DMatrix<Complex<f64>>) -> Option<DVector<Complex<f64>>> {
    let svd = matrix.svd(false, true);
    let least = svd.singular_values.imin();
    let rows = svd.v_t?;
    Some(rows.row(least).adjoint())
}

impl<S: System<N>, const N: usize, const K: usize> Problem for Equilibria<'_, S, N, K> {
    type Solution = Equilibrium<N>;

    fn scales(&self) -> &DVector<f64> {
        &self.scales
    }

    fn evaluate(&self, unknowns: &DVector<f64>) -> Result<Evaluation<Self::Solution>, Failure> {
        let x = unknowns.fixed_rows::<N>(0).into_owned();
        let mut parameters = self.parameters;
        for k in 0..self.free {
            parameters[k] = unknowns[N + k];
        }
        let rates = self.rates(&x, parameters);
        let mut residual = DVector::zeros(N);
        let mut jacobian = DMatrix::zeros(N, N + self.free);
        for i in 0..N {
            residual[i] = rates[i].value / self.scales[i];
            for k in 0..N + self.free {
                jacobian[(i, k)] = rates[i].tangent[k] / self.scales[i];
            }
        }
        let by_state = SMatrix::<f64, N, N>::from_fn(|i, k| rates[i].tangent[k]);
        let matrix = DMatrix::from_fn(N, N, |i, k| by_state[(i, k)]);
        let mut eigenvalues: Vec<_> = matrix.complex_eigenvalues().iter().copied().collect();
        eigenvalues.sort_by(|a, b| b.re.total_cmp(&a.re).then(b.im.total_cmp(&a.im)));
        let solution = Equilibrium {
            x,
            parameters,
            jacobian: by_state,
            eigenvalues_per_s: eigenvalues,
        };
        Ok(Evaluation {
            residual,
            jacobian,
            solution,
        })
    }
}

/// A Hopf bifurcation.
#[derive(Debug, Clone, PartialEq)]
pub struct Hopf<const N: usize> {
    /// The equilibrium there.
    pub at: Equilibrium<N>,
    /// Angular frequency of the orbit that is born, rad/s.
    pub frequency_rad_per_s: f64,
    /// First Lyapunov coefficient; negative where the orbit is stable.
    pub first_lyapunov_coefficient: f64,
}

/// A branch of equilibria.
#[derive(Debug, Clone)]
pub struct EquilibriumBranch<const N: usize> {
    /// The equilibria, in the order of arclength.
    pub equilibria: Vec<Equilibrium<N>>,
    /// Its Hopf bifurcations.
    pub hopf: Vec<Hopf<N>>,
    /// Its folds.
    pub folds: Vec<Equilibrium<N>>,
    /// Why it ends.
    pub end: End,
}

/// The branch of equilibria through the one near `guess`, towards greater (`sign` 1) or smaller (-1)
/// values of the parameter at first.
///
/// # Errors
/// If there is no equilibrium near the guess.
pub fn follow<S: System<N>, const N: usize, const K: usize>(
    problem: &Equilibria<'_, S, N, K>,
    guess: DVector<f64>,
    sign: f64,
    settings: &Settings,
) -> Result<EquilibriumBranch<N>, Failure> {
    let mut branch = EquilibriumBranch {
        equilibria: Vec::new(),
        hopf: Vec::new(),
        folds: Vec::new(),
        end: End::Points,
    };
    let axis = problem.parameter_axis(sign);
    branch.end = walk(problem.clone(), guess, &axis, &[N], settings, |step| {
        if !branch.equilibria.is_empty() {
            branch.hopf.extend(hopf(&step));
            branch.folds.extend(fold(&step));
        }
        branch.equilibria.push(step.to.solution.clone());
        None
    })?;
    Ok(branch)
}

fn hopf<S: System<N>, const N: usize, const K: usize>(
    step: &Step<'_, Equilibria<'_, S, N, K>>,
) -> Option<Hopf<N>> {
    let test = |point: &Point<Equilibrium<N>>| point.solution.hopf_test();
    let (point, _) = located(step, &test)?;
    let at = point.solution;
    let pair = at.leading_pair()?;
    if pair.re.abs() > ON_AXIS * pair.im {
        // Two real eigenvalues with the sum zero.
        return None;
    }
    Some(Hopf {
        frequency_rad_per_s: pair.im,
        first_lyapunov_coefficient: step.problem.first_lyapunov_coefficient(&at)?,
        at,
    })
}

fn fold<S: System<N>, const N: usize, const K: usize>(
    step: &Step<'_, Equilibria<'_, S, N, K>>,
) -> Option<Equilibrium<N>> {
    let test = |point: &Point<Equilibrium<N>>| point.tangent[N];
    let (point, _) = located(step, &test)?;
    Some(point.solution)
}

/// The zero of a function in a step.
fn located<P: Problem>(
    step: &Step<'_, P>,
    test: &dyn Fn(&Point<P::Solution>) -> f64,
) -> Option<(Point<P::Solution>, f64)> {
    locate(
        step.problem,
        step.from,
        step.arclength(),
        &Function::Smooth(test),
    )
}
