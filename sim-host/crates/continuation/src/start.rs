//! Guesses for periodic orbits: near returns of a trajectory.

use crate::failure::Failure;
use crate::orbit::Guess;
use crate::system::{Equations, Parameters, System};
use crate::trajectory::{Trajectory, integrate};
use nalgebra::SVector;

/// Extent, as a share of its size, of a trajectory at rest.
const AT_REST: f64 = 1e-4;
/// Corrections for a crossing; each squares the error.
const MOST_CORRECTIONS: usize = 4;

/// A near return.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearReturn<const N: usize> {
    /// The orbit that it is near to.
    pub guess: Guess<N>,
    /// Number of crossings of the section, one per cycle.
    pub cycles: usize,
    /// Distance between start and return, as a share of the trajectory's extent.
    pub distance: f64,
}

/// A trajectory that is searched for returns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search<const N: usize> {
    /// Its start.
    pub start: SVector<f64, N>,
    /// Initial transient to discard, s. Its states are kept in memory, so that a long one is better left to
    /// another integrator.
    pub transient_s: f64,
    /// Length that is searched, s.
    pub observed_s: f64,
    /// The component that rises once per cycle.
    pub component: usize,
    /// Most cycles of an orbit.
    pub most_cycles: usize,
    /// Integration tolerance.
    pub tolerance: f64,
}

/// The nearest return after each number of cycles, ascending. A cycle is from one rise of a component through
/// the middle of its range to the next.
///
/// # Errors
/// If the trajectory diverges or rests.
pub fn near_returns<S: System<N>, const N: usize>(
    system: &S,
    parameters: Parameters<f64>,
    search: &Search<N>,
) -> Result<Vec<NearReturn<N>>, Failure> {
    let Search {
        component,
        observed_s,
        most_cycles,
        tolerance,
        ..
    } = *search;
    let settled = integrate(
        system,
        parameters,
        &search.start,
        search.transient_s,
        tolerance,
    )?;
    let observed = integrate(system, parameters, settled.end(), observed_s, tolerance)?;
    let (low, high) = observed.extent();
    let extent = high - low;
    let size = low.abs().sup(&high.abs()).add_scalar(f64::MIN_POSITIVE);
    if extent.component_div(&size).amax() < AT_REST {
        return Err(Failure::AtRest);
    }
    let level = 0.5 * (low[component] + high[component]);
    let crossings = rises(system, parameters, &observed, component, level, tolerance);
    let found = returns(&crossings, &extent, parameters, most_cycles);
    match found.is_empty() {
        true => Err(Failure::NoReturn {
            longest_s: observed_s,
        }),
        false => Ok(found),
    }
}

/// The nearest return among crossings of a section (time in s, state) after each number of cycles, by
/// distances as shares of `extent`.
pub fn returns<const N: usize>(
    crossings: &[(f64, SVector<f64, N>)],
    extent: &SVector<f64, N>,
    parameters: Parameters<f64>,
    most_cycles: usize,
) -> Vec<NearReturn<N>> {
    let least = 1e-3 * extent.amax();
    let size = extent.map(|extent| extent.max(least));
    let nearest = |cycles: usize| {
        let pairs = crossings.iter().zip(&crossings[cycles..]);
        let returns = pairs.map(|(from, to)| NearReturn {
            guess: Guess {
                start: from.1,
                period_s: to.0 - from.0,
                parameters,
            },
            cycles,
            distance: (to.1 - from.1).component_div(&size).amax(),
        });
        returns.min_by(|a, b| a.distance.total_cmp(&b.distance))
    };
    let most = most_cycles.min(crossings.len().saturating_sub(1));
    (1..=most).filter_map(nearest).collect()
}

/// Where a trajectory's component rises through a level, unless its mode confines it there: time, s, and
/// state.
pub fn rises<S: System<N>, const N: usize>(
    system: &S,
    parameters: Parameters<f64>,
    trajectory: &Trajectory<S::Mode, N>,
    component: usize,
    level: f64,
    tolerance: f64,
) -> Vec<(f64, SVector<f64, N>)> {
    let equations = system.equations(parameters);
    let times_s = trajectory.times_s();
    let rise = |k: usize| {
        let [before, after] = [trajectory.states[k], trajectory.states[k + 1]];
        let leg = &trajectory.legs[k];
        let rises = before[component] < level && after[component] >= level;
        if !rises || equations.is_confined(leg.mode) {
            return None;
        }
        // By Newton's method from the start of the step.
        let (mut time_s, mut x) = (0.0, before);
        for _ in 0..MOST_CORRECTIONS {
            let rates = equations.derivative(&x, leg.mode);
            let next_s = time_s + (level - x[component]) / rates[component];
            if !(0.0..=leg.step_s).contains(&next_s) {
                break;
            }
            let there = integrate(system, parameters, &before, next_s, tolerance).ok()?;
            (time_s, x) = (next_s, *there.end());
        }
        Some((times_s[k] + time_s, x))
    };
    (0..trajectory.legs.len()).filter_map(rise).collect()
}
