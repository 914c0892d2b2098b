//! Periodic orbits by shooting, and their multipliers.
//!
//! The unknowns are the states at the start of each segment, the period, and one or two parameters.
//! Each segment must end where the next one starts, the last where the first does; the phase is fixed
//! by a plane across the flow (E. J. Doedel, Lecture Notes on Numerical Analysis of Nonlinear
//! Equations, 2007, section 2).

use crate::arclength::{Evaluation, Point, Problem};
use crate::failure::Failure;
use crate::system::{Equations, Parameters, System};
use crate::trajectory::{Trajectory, differentiate, integrate, seed};
use engine::dual::Dual;
use nalgebra::{Complex, DMatrix, DVector, SMatrix, SVector};

/// Extent of an orbit, as a share of the scales, below which it is an equilibrium.
const AT_REST: f64 = 1e-5;

/// A periodic orbit.
#[derive(Debug, Clone)]
pub struct Orbit<M, const N: usize> {
    /// Period, s.
    pub period_s: f64,
    /// The parameters.
    pub parameters: Parameters<f64>,
    /// One period, in segments.
    pub segments: Vec<Trajectory<M, N>>,
    /// Derivative of the state after a period by the state before.
    pub monodromy: SMatrix<f64, N, N>,
    /// Time derivative of the state at the start.
    pub flow: SVector<f64, N>,
    /// The monodromy matrix across the flow: its eigenvalues are the other multipliers.
    pub across: DMatrix<f64>,
    /// Multipliers but for the one along the flow, by descending magnitude.
    pub multipliers: Vec<Complex<f64>>,
    /// Error of the multiplier along the flow, which is 1.
    pub trivial_error: f64,
}

impl<M: Copy + PartialEq, const N: usize> Orbit<M, N> {
    /// The state at the start.
    pub fn start(&self) -> &SVector<f64, N> {
        &self.segments[0].states[0]
    }

    /// The orbit as a guess.
    pub fn guess(&self) -> Guess<N> {
        Guess {
            start: *self.start(),
            period_s: self.period_s,
            parameters: self.parameters,
        }
    }

    /// Every multiplier but the one along the flow is within the unit circle.
    pub fn is_stable(&self) -> bool {
        self.multipliers
            .iter()
            .all(|multiplier| multiplier.norm() < 1.0)
    }

    /// The modes of one period, in their order.
    pub fn modes(&self) -> Vec<M> {
        let mut modes: Vec<M> = Vec::new();
        for mode in self.segments.iter().flat_map(Trajectory::modes) {
            if modes.last() != Some(&mode) {
                modes.push(mode);
            }
        }
        if modes.len() > 1 && modes.first() == modes.last() {
            modes.pop();
        }
        modes
    }

    /// Both orbits pass the same modes in the same order.
    pub fn has_modes_of(&self, other: &Self) -> bool {
        let (own, other) = (self.modes(), other.modes());
        let shifted = |by: usize| (0..own.len()).all(|k| own[(k + by) % own.len()] == other[k]);
        own.len() == other.len() && (0..own.len().max(1)).any(shifted)
    }

    /// Least and greatest value of each component, at the ends of steps.
    pub fn extent(&self) -> (SVector<f64, N>, SVector<f64, N>) {
        let extents = self.segments.iter().map(Trajectory::extent);
        let merged = extents.reduce(|(low, high), other| (low.inf(&other.0), high.sup(&other.1)));
        merged.unwrap_or((*self.start(), *self.start()))
    }

    /// Greatest extent of a component.
    pub fn size(&self) -> f64 {
        let (low, high) = self.extent();
        (high - low).amax()
    }
}

/// A guess for a periodic orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guess<const N: usize> {
    /// A state on it.
    pub start: SVector<f64, N>,
    /// Its period, s.
    pub period_s: f64,
    /// The parameters.
    pub parameters: Parameters<f64>,
}

/// The equations of a periodic orbit. `K` is `N + 2`: tangents by each component and parameter.
#[derive(Debug)]
pub struct Shooting<'a, S: System<N>, const N: usize, const K: usize> {
    system: &'a S,
    /// Integration tolerance.
    tolerance: f64,
    segments: usize,
    /// Number of parameters that are unknown, 1 or 2; the other one is fixed.
    free: usize,
    parameters: Parameters<f64>,
    /// The plane that fixes the phase.
    origin: SVector<f64, N>,
    normal: SVector<f64, N>,
    scales: DVector<f64>,
}

// Derived, it would need a system that can be cloned.
impl<S: System<N>, const N: usize, const K: usize> Clone for Shooting<'_, S, N, K> {
    fn clone(&self) -> Self {
        Self {
            scales: self.scales.clone(),
            ..*self
        }
    }
}

impl<'a, S: System<N>, const N: usize, const K: usize> Shooting<'a, S, N, K> {
    const TANGENTS: () = assert!(K == N + 2, "K must be N + 2");

    /// The equations near an orbit. `spans` are the extents over which the parameters are of interest: one
    /// for a branch, two for a curve in both parameters.
    ///
    /// # Errors
    /// If the trajectory diverges, or rests.
    pub fn new(
        system: &'a S,
        guess: &Guess<N>,
        spans: &[f64],
        segments: usize,
        tolerance: f64,
    ) -> Result<Self, Failure> {
        let () = Self::TANGENTS;
        let Guess {
            start,
            period_s,
            parameters,
        } = *guess;
        let trajectory = integrate(system, parameters, &start, period_s, tolerance)?;
        let (low, high) = trajectory.extent();
        let extent = high - low;
        let size = low.abs().sup(&high.abs()).add_scalar(f64::MIN_POSITIVE);
        if extent.component_div(&size).amax() < AT_REST {
            return Err(Failure::AtRest);
        }
        let extent = sizes(&extent);
        let equations = system.equations(parameters);
        let normal = equations.derivative(&start, equations.mode_at(&start));
        let states = (0..segments).flat_map(|_| extent.iter().copied());
        let others = std::iter::once(period_s).chain(spans.iter().copied());
        let free = spans.len();
        let scales = DVector::from_iterator(segments * N + 1 + free, states.chain(others));
        Ok(Self {
            system,
            tolerance,
            segments,
            free,
            parameters,
            origin: start,
            normal,
            scales,
        })
    }

    /// The system.
    pub fn system(&self) -> &'a S {
        self.system
    }

    /// The equations near another orbit, with as many unknown parameters as there are `spans`.
    ///
    /// # Errors
    /// If the orbit rests.
    pub fn at_orbit(&self, orbit: &Orbit<S::Mode, N>, spans: &[f64]) -> Result<Self, Failure> {
        Self::new(
            self.system,
            &orbit.guess(),
            spans,
            self.segments,
            self.tolerance,
        )
    }

    /// The same equations to another tolerance.
    pub fn with_tolerance(&self, tolerance: f64) -> Self {
        Self {
            tolerance,
            ..self.clone()
        }
    }

    /// The integration tolerance.
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Measures states by the extents of an orbit, and times by its period.
    fn set_scales(&mut self, orbit: &Orbit<S::Mode, N>) {
        let (low, high) = orbit.extent();
        let extent = sizes(&(high - low));
        for segment in 0..self.segments {
            self.scales
                .fixed_rows_mut::<N>(segment * N)
                .copy_from(&extent);
        }
        self.scales[self.segments * N] = orbit.period_s;
    }

    /// Unknowns for a guess: the states along one trajectory from `start`.
    ///
    /// # Errors
    /// If the trajectory diverges.
    pub fn guess(
        &self,
        start: &SVector<f64, N>,
        period_s: f64,
        parameters: Parameters<f64>,
    ) -> Result<DVector<f64>, Failure> {
        let mut states = vec![*start];
        let part_s = period_s / self.segments as f64;
        for _ in 1..self.segments {
            let last = states[states.len() - 1];
            let part = integrate(self.system, parameters, &last, part_s, self.tolerance)?;
            states.push(*part.end());
        }
        Ok(self.unknowns(&states, period_s, parameters))
    }

    /// The unknowns of these states at the starts of the segments.
    pub fn unknowns(
        &self,
        states: &[SVector<f64, N>],
        period_s: f64,
        parameters: Parameters<f64>,
    ) -> DVector<f64> {
        let states = states.iter().flat_map(|state| state.iter().copied());
        let others = std::iter::once(period_s).chain(parameters[..self.free].iter().copied());
        DVector::from_vec(states.chain(others).collect())
    }

    /// The unit vector along a displacement of the start.
    pub fn state_axis(&self, displacement: &SVector<f64, N>) -> DVector<f64> {
        let mut axis = DVector::zeros(self.scales.len());
        axis.fixed_rows_mut::<N>(0).copy_from(displacement);
        axis.component_div(&self.scales).normalize()
    }

    /// The unit vector of the first unknown parameter.
    pub fn parameter_axis(&self, sign: f64) -> DVector<f64> {
        let mut axis = DVector::zeros(self.scales.len());
        axis[self.segments * N + 1] = sign;
        axis
    }

    /// Index of the first parameter among the unknowns.
    pub fn parameter_index(&self) -> usize {
        self.segments * N + 1
    }

    fn parameters_of(&self, unknowns: &DVector<f64>) -> Parameters<f64> {
        let mut parameters = self.parameters;
        for k in 0..self.free {
            parameters[k] = unknowns[self.segments * N + 1 + k];
        }
        parameters
    }

    fn state(&self, unknowns: &DVector<f64>, segment: usize) -> SVector<f64, N> {
        unknowns.fixed_rows::<N>(segment * N).into_owned()
    }

    /// The covector whose product with a displacement in the scales is that along the flow.
    fn weighed(&self, flow: &SVector<f64, N>) -> SVector<f64, N> {
        let scale = self.scales.fixed_rows::<N>(0);
        flow.component_div(&scale).normalize().component_div(&scale)
    }

    /// The same displacement of an orbit, with the shift along the flow that keeps it in the plane across.
    fn across(&self, displacement: &SVector<f64, N>, flow: &SVector<f64, N>) -> SVector<f64, N> {
        let normal = self.weighed(flow);
        displacement - flow * (normal.dot(displacement) / normal.dot(flow))
    }

    fn dual_parameters(&self, parameters: Parameters<f64>) -> Parameters<Dual<K>> {
        std::array::from_fn(|k| seed(parameters[k], N + k))
    }

    fn seeds(
        &self,
        start: &SVector<f64, N>,
        parameters: Parameters<f64>,
    ) -> (Parameters<Dual<K>>, SVector<Dual<K>, N>) {
        let seeds = SVector::from_fn(|i, _| seed(start[i], i));
        (self.dual_parameters(parameters), seeds)
    }

    /// What a branch of twice the period begins with at a doubling: guess and tangent.
    pub fn doubled(
        &self,
        orbit: &Orbit<S::Mode, N>,
        arclength: f64,
    ) -> Result<(Self, DVector<f64>, DVector<f64>), Failure> {
        let vector = null_vector(&(orbit.monodromy + SMatrix::identity()));
        let vector = self.across(&vector, &orbit.flow);
        let mut problem = self.clone();
        let period_index = self.segments * N;
        problem.scales[period_index] *= 2.0;
        let base = problem.guess(orbit.start(), 2.0 * orbit.period_s, orbit.parameters)?;
        let mut tangent = DVector::zeros(self.scales.len());
        tangent.fixed_rows_mut::<N>(0).copy_from(&vector);
        let tangent = tangent.component_div(&problem.scales).normalize();
        let guess = base + tangent.component_mul(&problem.scales) * arclength;
        Ok((problem, guess, tangent))
    }
}

impl<S: System<N>, const N: usize, const K: usize> Problem for Shooting<'_, S, N, K> {
    type Solution = Orbit<S::Mode, N>;

    fn scales(&self) -> &DVector<f64> {
        &self.scales
    }

    fn evaluate(&self, unknowns: &DVector<f64>) -> Result<Evaluation<Self::Solution>, Failure> {
        let (count, size) = (self.segments, self.scales.len());
        let period_s = unknowns[count * N];
        let parameters = self.parameters_of(unknowns);
        let part_s = period_s / count as f64;
        if !(part_s > 0.0 && part_s.is_finite()) {
            return Err(Failure::NotConverged {
                correction: f64::INFINITY,
            });
        }
        let equations = self.system.equations(parameters);
        let dual = self.system.equations(self.dual_parameters(parameters));
        let mut residual = DVector::zeros(count * N + 1);
        let mut jacobian = DMatrix::zeros(count * N + 1, size);
        let mut monodromy = SMatrix::<f64, N, N>::identity();
        let mut segments = Vec::with_capacity(count);
        for segment in 0..count {
            let start = self.state(unknowns, segment);
            let next = (segment + 1) % count;
            let trajectory = integrate(self.system, parameters, &start, part_s, self.tolerance)?;
            let (_, seeds) = self.seeds(&start, parameters);
            let end = differentiate(&dual, &trajectory, trajectory.legs.len(), seeds)?;
            let mode = trajectory.legs[trajectory.legs.len() - 1].mode;
            let rates = equations.derivative(trajectory.end(), mode);
            let target = self.state(unknowns, next);
            let by_start = SMatrix::<f64, N, N>::from_fn(|i, k| end[i].tangent[k]);
            for i in 0..N {
                let (row, scale) = (segment * N + i, self.scales[i]);
                residual[row] = (trajectory.end()[i] - target[i]) / scale;
                for k in 0..N {
                    jacobian[(row, segment * N + k)] += by_start[(i, k)] / scale;
                }
                jacobian[(row, next * N + i)] -= 1.0 / scale;
                jacobian[(row, count * N)] = rates[i] / count as f64 / scale;
                for k in 0..self.free {
                    jacobian[(row, count * N + 1 + k)] = end[i].tangent[N + k] / scale;
                }
            }
            monodromy = by_start * monodromy;
            segments.push(trajectory);
        }
        let start = self.state(unknowns, 0);
        let normal = self.weighed(&self.normal);
        residual[count * N] = normal.dot(&(start - self.origin));
        for i in 0..N {
            jacobian[(count * N, i)] = normal[i];
        }
        let flow = equations.derivative(&start, equations.mode_at(&start));
        let (across, trivial_error) = across_the_flow(&monodromy, &flow);
        let solution = Orbit {
            period_s,
            parameters,
            segments,
            monodromy,
            flow,
            multipliers: by_magnitude(&across),
            across,
            trivial_error,
        };
        Ok(Evaluation {
            residual,
            jacobian,
            solution,
        })
    }

    /// At another phase: where the flow is fastest and no mode confines the state. Only of a single
    /// segment; of several, the start stays.
    fn rebased(
        &self,
        point: &Point<Self::Solution>,
    ) -> Result<(Self, DVector<f64>, DVector<f64>), Failure> {
        let Point {
            unknowns,
            tangent,
            solution: orbit,
            ..
        } = point;
        let equations = self.system.equations(orbit.parameters);
        let mut problem = self.clone();
        problem.set_scales(orbit);
        let scale = problem.scales.fixed_rows::<N>(0).into_owned();
        let own = tangent.component_mul(&self.scales);
        if self.segments > 1 {
            problem.origin = self.state(unknowns, 0);
            problem.normal = orbit.flow;
            let turned = own.component_div(&problem.scales).normalize();
            return Ok((problem, unknowns.clone(), turned));
        }
        let trajectory = &orbit.segments[0];
        let speed = |k: usize| {
            let (mode, x) = (trajectory.legs[k].mode, &trajectory.states[k]);
            let confined = equations.is_confined(mode);
            let fast = equations.derivative(x, mode).component_div(&scale).amax();
            if confined || (k > 0 && trajectory.legs[k - 1].passes.is_some()) {
                -1.0
            } else {
                fast
            }
        };
        let best = (0..trajectory.legs.len()).max_by(|&a, &b| speed(a).total_cmp(&speed(b)));
        let best = best.unwrap_or(0);
        let start = trajectory.states[best];
        let normal = equations.derivative(&start, trajectory.legs[best].mode);
        let (_, seeds) = self.seeds(&trajectory.states[0], orbit.parameters);
        let dual = self
            .system
            .equations(self.dual_parameters(orbit.parameters));
        let moved = differentiate(&dual, trajectory, best, seeds)?;
        let along = SVector::<f64, N>::from_fn(|i, _| {
            let by_state: f64 = (0..N).map(|k| moved[i].tangent[k] * own[k]).sum();
            let by_parameters: f64 = (0..self.free)
                .map(|k| moved[i].tangent[N + k] * own[N + 1 + k])
                .sum();
            by_state + by_parameters
        });
        let along = problem.across(&along, &normal);
        let mut unknowns = unknowns.clone();
        unknowns.fixed_rows_mut::<N>(0).copy_from(&start);
        let mut turned = own;
        turned.fixed_rows_mut::<N>(0).copy_from(&along);
        let turned = turned.component_div(&problem.scales).normalize();
        (problem.origin, problem.normal) = (start, normal);
        Ok((problem, unknowns, turned))
    }
}

/// Extents, of which none is nearly zero.
fn sizes<const N: usize>(extent: &SVector<f64, N>) -> SVector<f64, N> {
    let least = extent.amax() * 1e-3;
    extent.map(|extent| extent.max(least))
}

/// The direction that a singular matrix takes to zero, nearly.
fn null_vector<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SVector<f64, N> {
    let matrix = DMatrix::from_fn(N, N, |i, k| matrix[(i, k)]);
    let svd = matrix.svd(false, true);
    let least = svd.singular_values.imin();
    let rows = svd.v_t.unwrap_or_else(|| DMatrix::identity(N, N));
    SVector::from_fn(|i, _| rows[(least, i)])
}

/// The monodromy matrix across the flow, and the error of the multiplier along it.
///
/// In a basis that begins with the flow the monodromy matrix has a first column of a one and zeros: the
/// rest of it has the other multipliers.
fn across_the_flow<const N: usize>(
    monodromy: &SMatrix<f64, N, N>,
    flow: &SVector<f64, N>,
) -> (DMatrix<f64>, f64) {
    let error = (monodromy * flow - flow).norm() / flow.norm();
    let basis = DMatrix::from_fn(N, N + 1, |i, k| match k {
        0 => flow[i] / flow.norm(),
        _ => f64::from(u8::from(i + 1 == k)),
    });
    // Gram and Schmidt by QR of the flow and the unit vectors.
    let basis = basis.qr().q();
    let matrix = DMatrix::from_fn(N, N, |i, k| monodromy[(i, k)]);
    let turned = basis.transpose() * matrix * &basis;
    (turned.view((1, 1), (N - 1, N - 1)).into_owned(), error)
}

/// Eigenvalues by descending magnitude.
fn by_magnitude(matrix: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let mut all: Vec<_> = matrix.complex_eigenvalues().iter().copied().collect();
    all.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
    all
}
