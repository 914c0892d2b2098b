//! Branches of periodic orbits over one parameter, with their bifurcations.

use crate::arclength::{End, Function, Point, Problem, Settings, Step, correct, locate, walk};
use crate::failure::Failure;
use crate::orbit::{Orbit, Shooting};
use crate::system::System;
use crate::test_function::Bifurcation;
use nalgebra::DVector;

/// Factor of the tolerance at which a bifurcation is located a second time, for its error.
const LOOSER: f64 = 100.0;
/// Distance from the unit circle of the multipliers that prove a bifurcation located.
const ON_CIRCLE: f64 = 1e-3;
/// An orbit of less than this extent, as a share of that of the first one, is at its end at an
/// equilibrium.
pub(crate) const VANISHED: f64 = 0.02;
/// A period of more than this many first ones has no end.
const LONGEST_PERIOD: f64 = 50.0;
/// Orbits before a branch may be closed.
const LEAST_CLOSED: usize = 10;

/// A bifurcation on a branch.
#[derive(Debug, Clone)]
pub struct Special<M, const N: usize> {
    /// Its kind.
    pub kind: Bifurcation,
    /// The orbit there.
    pub orbit: Orbit<M, N>,
    /// Error of the parameter there: difference to the location at a looser tolerance, and width of the
    /// location.
    pub parameter_error: f64,
}

/// A branch: orbits in the order of arclength, those at its bifurcations among them.
#[derive(Debug, Clone)]
pub struct Branch<M, const N: usize> {
    /// The orbits.
    pub orbits: Vec<Orbit<M, N>>,
    /// The bifurcations.
    pub specials: Vec<Special<M, N>>,
    /// Why it ends.
    pub end: End,
}

type At<S, const N: usize> = Point<Orbit<<S as System<N>>::Mode, N>>;

/// The branch through the orbit near `guess`, along `tangent` at first. `visit` is called with every
/// orbit, and stops the branch by returning false.
///
/// # Errors
/// If there is no orbit near the guess.
pub fn follow<S: System<N>, const N: usize, const K: usize>(
    problem: &Shooting<'_, S, N, K>,
    guess: DVector<f64>,
    tangent: &DVector<f64>,
    settings: &Settings,
    mut visit: impl FnMut(&Orbit<S::Mode, N>) -> bool,
) -> Result<Branch<S::Mode, N>, Failure> {
    let mut branch = Branch {
        orbits: Vec::new(),
        specials: Vec::new(),
        end: End::Points,
    };
    let parameters = [problem.parameter_index()];
    branch.end = walk(
        problem.clone(),
        guess,
        tangent,
        &parameters,
        settings,
        |step| {
            let orbit = &step.to.solution;
            if !branch.orbits.is_empty() {
                for special in specials(&step) {
                    branch.orbits.push(special.orbit.clone());
                    branch.specials.push(special);
                }
            }
            branch.orbits.push(orbit.clone());
            if !visit(orbit) {
                return Some(End::Stopped);
            }
            let first = &branch.orbits[0];
            if orbit.size() < VANISHED * first.size() {
                return Some(End::Equilibrium);
            }
            if orbit.period_s > LONGEST_PERIOD * first.period_s {
                return Some(End::LongPeriod);
            }
            let largest = orbit.multipliers.first();
            if largest.is_some_and(|multiplier| multiplier.norm() > settings.greatest_multiplier) {
                return Some(End::TooUnstable);
            }
            is_closed(&branch.orbits, settings).then_some(End::Closed)
        },
    )?;
    Ok(branch)
}

/// An orbit is nearer to the first than the second one is.
fn is_closed<M: Copy + PartialEq, const N: usize>(
    orbits: &[Orbit<M, N>],
    settings: &Settings,
) -> bool {
    let [first, second, .., last] = orbits else {
        return false;
    };
    let span = settings.spans()[0];
    let distance = |a: &Orbit<M, N>, b: &Orbit<M, N>| {
        let parameter = (a.parameters[0] - b.parameters[0]).abs() / span;
        let period = (a.period_s / b.period_s - 1.0).abs();
        let (of_a, of_b) = (a.extent(), b.extent());
        let extent = (of_a.0 - of_b.0).amax().max((of_a.1 - of_b.1).amax()) / a.size();
        parameter.max(period).max(extent)
    };
    orbits.len() >= LEAST_CLOSED && distance(first, last) < 0.5 * distance(first, second)
}

fn specials<S: System<N>, const N: usize, const K: usize>(
    step: &Step<'_, Shooting<'_, S, N, K>>,
) -> Vec<Special<S::Mode, N>> {
    let has = |kind: &&Bifurcation| has_between(**kind, step);
    let located = |kind: &Bifurcation| special(*kind, step);
    let mut found: Vec<_> = Bifurcation::ALL
        .iter()
        .filter(has)
        .filter_map(located)
        .collect();
    let along = |special: &Special<S::Mode, N>| {
        let axis = step.from.tangent[step.problem.parameter_index()];
        special.orbit.parameters[0] * axis
    };
    found.sort_by(|a, b| along(a).total_cmp(&along(b)));
    found
}

fn has_between<S: System<N>, const N: usize, const K: usize>(
    kind: Bifurcation,
    step: &Step<'_, Shooting<'_, S, N, K>>,
) -> bool {
    let (from, to) = (step.from, step.to);
    let index = step.problem.parameter_index();
    let turns = (from.tangent[index] > 0.0) != (to.tangent[index] > 0.0);
    let changes = || (kind.test(&from.solution) > 0.0) != (kind.test(&to.solution) > 0.0);
    match kind {
        Bifurcation::Fold => turns,
        Bifurcation::BranchPoint => !turns && changes(),
        Bifurcation::PeriodDoubling | Bifurcation::NeimarkSacker => changes(),
        Bifurcation::Grazing => !from.solution.has_modes_of(&to.solution),
    }
}

/// The bifurcation in a step, located at two tolerances.
fn special<S: System<N>, const N: usize, const K: usize>(
    kind: Bifurcation,
    step: &Step<'_, Shooting<'_, S, N, K>>,
) -> Option<Special<S::Mode, N>> {
    let (problem, from) = (step.problem, step.from);
    let scales = problem.scales();
    let arclength = step.arclength();
    let index = problem.parameter_index();
    let test = |point: &At<S, N>| match kind {
        // Along the branch the parameter turns back.
        Bifurcation::Fold => point.tangent[index],
        kind => kind.test(&point.solution),
    };
    let keeps_modes = |point: &At<S, N>| point.solution.has_modes_of(&from.solution);
    let function = match kind {
        Bifurcation::Grazing => Function::Property(&keeps_modes),
        _ => Function::Smooth(&test),
    };
    let (point, width) = locate(problem, from, arclength, &function)?;
    if !is_genuine(kind, &point.solution) {
        return None;
    }
    let parameter = point.solution.parameters[0];
    let looser = problem.with_tolerance(LOOSER * problem.tolerance());
    let again = correct(&looser, from.unknowns.clone(), &from.tangent).ok();
    let again = again.and_then(|start| locate(&looser, &start, arclength, &function));
    let difference = again.map_or(f64::NAN, |(again, _)| {
        (again.unknowns[index] - parameter).abs()
    });
    let rate = from.tangent[index].abs() * scales[index];
    Some(Special {
        kind,
        parameter_error: difference + width * rate + 4.0 * f64::EPSILON * parameter.abs(),
        orbit: point.solution,
    })
}

/// A pair of real multipliers whose product is 1 is no bifurcation, nor is a jump over zero.
fn is_genuine<M, const N: usize>(kind: Bifurcation, orbit: &Orbit<M, N>) -> bool {
    let any = |is: &dyn Fn(&nalgebra::Complex<f64>) -> bool| orbit.multipliers.iter().any(is);
    match kind {
        Bifurcation::Fold | Bifurcation::Grazing => true,
        Bifurcation::BranchPoint => any(&|m| (m - 1.0).norm() < ON_CIRCLE),
        Bifurcation::PeriodDoubling => any(&|m| (m + 1.0).norm() < ON_CIRCLE),
        Bifurcation::NeimarkSacker => any(&|m| m.im != 0.0 && (m.norm() - 1.0).abs() < ON_CIRCLE),
    }
}

/// The orbit near `guess` at its parameters.
///
/// # Errors
/// If there is none.
pub fn orbit_at<S: System<N>, const N: usize, const K: usize>(
    problem: &Shooting<'_, S, N, K>,
    guess: DVector<f64>,
) -> Result<Orbit<S::Mode, N>, Failure> {
    let point = correct(problem, guess, &problem.parameter_axis(1.0))?;
    Ok(point.solution)
}
