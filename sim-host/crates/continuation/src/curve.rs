//! Curves of bifurcations in two parameters: the equations of a solution, and its test function.

use crate::arclength::{End, Evaluation, Point, Problem, Settings, walk};
use crate::branch::VANISHED;
use crate::codimension_two::{self, CodimensionTwo, Condition, interpolated};
use crate::equilibrium::{Equilibria, Equilibrium};
use crate::failure::Failure;
use crate::orbit::{Orbit, Shooting};
use crate::system::System;
use crate::test_function::Bifurcation;
use nalgebra::DVector;
use std::rc::Rc;

/// Displacement of the differences of a test function, in the scales.
const DISPLACEMENT: f64 = 1e-6;

/// The equations of a problem in two parameters, and a function of its solutions that is to be zero.
struct Zero<P: Problem> {
    inner: P,
    test: Test<P::Solution>,
}

/// A test function, shared by the problems along a curve.
type Test<S> = Rc<dyn Fn(&S) -> f64>;

impl<P: Problem> Clone for Zero<P> {
    fn clone(&self) -> Self {
        Self {
            inner: self.inner.clone(),
            test: Rc::clone(&self.test),
        }
    }
}

impl<P: Problem> Problem for Zero<P> {
    type Solution = P::Solution;

    fn scales(&self) -> &DVector<f64> {
        self.inner.scales()
    }

    /// The test function's derivatives are differences: an error in them costs a correction, and none of
    /// the result's accuracy.
    fn evaluate(&self, unknowns: &DVector<f64>) -> Result<Evaluation<Self::Solution>, Failure> {
        let inner = self.inner.evaluate(unknowns)?;
        let value = (self.test)(&inner.solution);
        let scales = self.inner.scales();
        let rows = inner.residual.len();
        let mut jacobian = inner.jacobian.insert_row(rows, 0.0);
        for k in 0..unknowns.len() {
            let mut displaced = unknowns.clone();
            displaced[k] += DISPLACEMENT * scales[k];
            let other = (self.test)(&self.inner.evaluate(&displaced)?.solution);
            jacobian[(rows, k)] = (other - value) / (DISPLACEMENT * scales[k]);
        }
        Ok(Evaluation {
            residual: inner.residual.push(value),
            jacobian,
            solution: inner.solution,
        })
    }

    fn rebased(
        &self,
        point: &Point<Self::Solution>,
    ) -> Result<(Self, DVector<f64>, DVector<f64>), Failure> {
        let (inner, unknowns, tangent) = self.inner.rebased(point)?;
        Ok((
            Self {
                inner,
                test: Rc::clone(&self.test),
            },
            unknowns,
            tangent,
        ))
    }
}

/// A curve of bifurcations: its solutions in order, and why it ends.
#[derive(Debug, Clone)]
pub struct Curve<T> {
    /// The solutions.
    pub points: Vec<T>,
    /// Points of codimension two on it.
    pub codimension_two: Vec<CodimensionTwo>,
    /// Why it ends.
    pub end: End,
}

/// The curve of orbits at a bifurcation of that kind, from one of them, towards greater (`sign` 1) or
/// smaller (-1) values of the second parameter. The ranges are those of both parameters.
///
/// # Errors
/// If there is none near the orbit, or the kind has no test function: a grazing.
pub fn of_orbits<S: System<N>, const N: usize, const K: usize>(
    problem: &Shooting<'_, S, N, K>,
    kind: Bifurcation,
    orbit: &Orbit<S::Mode, N>,
    sign: f64,
    settings: &Settings,
) -> Result<Curve<Orbit<S::Mode, N>>, Failure> {
    let inner = problem.at_orbit(orbit, &settings.spans())?;
    let guess = inner.guess(orbit.start(), orbit.period_s, orbit.parameters)?;
    let first = inner.parameter_index();
    let mut axis = DVector::zeros(guess.len());
    axis[first + 1] = sign;
    let test = Rc::new(move |orbit: &Orbit<S::Mode, N>| kind.test(orbit));
    let mut curve = Curve {
        points: Vec::new(),
        codimension_two: Vec::new(),
        end: End::Points,
    };
    let size = orbit.size();
    curve.end = walk(
        Zero { inner, test },
        guess,
        &axis,
        &[first, first + 1],
        settings,
        |step| {
            let (before, orbit) = (&step.from.solution, &step.to.solution);
            let tests = [before, orbit].map(|orbit| codimension_two::of_orbit(kind, orbit));
            curve.codimension_two.extend(codimension_two::between(
                (&tests[0], before.parameters),
                (&tests[1], orbit.parameters),
            ));
            let along = [first, first + 1]
                .map(|k| step.from.tangent[k] * step.to.tangent[k])
                .iter()
                .sum::<f64>();
            let at_once = [
                (Condition::Cusp, along < 0.0),
                (Condition::Grazing, !orbit.has_modes_of(before)),
            ];
            let middle = interpolated(before.parameters, orbit.parameters, 0.5);
            let held = at_once.into_iter().filter(|(_, holds)| *holds);
            curve
                .codimension_two
                .extend(held.map(|(condition, _)| CodimensionTwo {
                    condition,
                    parameters: middle,
                }));
            curve.points.push(orbit.clone());
            (orbit.size() < VANISHED * size).then_some(End::Equilibrium)
        },
    )?;
    Ok(curve)
}

/// The curve of Hopf bifurcations from one of them, towards greater (`sign` 1) or smaller (-1) values of
/// the second parameter.
///
/// # Errors
/// If there is none near it.
pub fn of_hopf<S: System<N>, const N: usize, const K: usize>(
    system: &S,
    mode: S::Mode,
    sizes: &nalgebra::SVector<f64, N>,
    at: &Equilibrium<N>,
    sign: f64,
    settings: &Settings,
) -> Result<Curve<Equilibrium<N>>, Failure> {
    let inner = Equilibria::<S, N, K>::new(system, mode, sizes, at.parameters, &settings.spans());
    // The coefficient is that of the system at the equilibrium's own parameters.
    let equations = inner.clone();
    let guess = inner.unknowns(&at.x, at.parameters);
    let mut axis = DVector::zeros(guess.len());
    axis[N + 1] = sign;
    // Per second to the number of pairs; the size of the first one's makes it a number near 1.
    let pairs = (N * (N - 1) / 2) as i32;
    let size = at.jacobian.amax().powi(pairs);
    let test = Rc::new(move |equilibrium: &Equilibrium<N>| equilibrium.hopf_test() / size);
    let mut curve = Curve {
        points: Vec::new(),
        codimension_two: Vec::new(),
        end: End::Points,
    };
    curve.end = walk(
        Zero { inner, test },
        guess,
        &axis,
        &[N, N + 1],
        settings,
        |step| {
            let (before, at) = (&step.from.solution, &step.to.solution);
            let tests = [before, at]
                .map(|at| codimension_two::of_hopf(at, equations.first_lyapunov_coefficient(at)));
            curve.codimension_two.extend(codimension_two::between(
                (&tests[0], before.parameters),
                (&tests[1], at.parameters),
            ));
            curve.points.push(at.clone());
            None
        },
    )?;
    Ok(curve)
}
