//! Trajectories through modes, and their derivatives by the initial state and the parameters.
//!
//! Each smooth piece is integrated by Gragg's modified midpoint rule, extrapolated to order 12
//! (Bulirsch and Stoer; E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations
//! I, section II.9), to a tolerance. The end of a mode is located by Newton's method on trial steps.
//!
//! The steps are chosen once, in f64. The derivative repeats them in dual numbers, so it is that of
//! the numerical solution; where a mode ends its tangent vectors jump by the saltation matrix (M. di
//! Bernardo et al., Piecewise-smooth Dynamical Systems, section 2.5).

use crate::failure::Failure;
use crate::system::{Equations, Parameters, System};
use engine::dual::Dual;
use nalgebra::SVector;
use shared_model::Real;

/// Columns of the extrapolation: order 12.
const COLUMNS: usize = 6;
/// Greatest growth of a step from one to the next.
const GREATEST_GROWTH: f64 = 4.0;
/// Share of the optimal step that is taken.
const SAFETY: f64 = 0.85;
/// Steps that a trajectory may take: at once, and per second. The paper's take some fifty per second.
const STEPS_AT_ONCE: f64 = 1e5;
const STEPS_PER_S: f64 = 1e4;
/// Size of a state, in multiples of its size so far, beyond which it diverges.
const DIVERGED: f64 = 1e6;
/// Trial steps for the end of a mode; bisection alone needs 60.
const MOST_TRIALS: usize = 80;
/// Samples of a margin's cubic within a step.
const SAMPLES: usize = 16;

/// A step within one mode.
#[derive(Debug, Clone, Copy)]
pub struct Leg<M> {
    /// The mode.
    pub mode: M,
    /// Length, s.
    pub step_s: f64,
    /// The margin that ends the mode at the end of the step.
    pub passes: Option<usize>,
}

/// A trajectory: its steps and the states between them.
#[derive(Debug, Clone)]
pub struct Trajectory<M, const N: usize> {
    /// The steps.
    pub legs: Vec<Leg<M>>,
    /// The states: before each step, and the last one.
    pub states: Vec<SVector<f64, N>>,
}

impl<M: Copy + PartialEq, const N: usize> Trajectory<M, N> {
    /// The state at the end.
    pub fn end(&self) -> &SVector<f64, N> {
        &self.states[self.states.len() - 1]
    }

    /// The modes in the order in which they occur; one of length zero is left out.
    pub fn modes(&self) -> Vec<M> {
        let mut modes: Vec<M> = Vec::new();
        for leg in self.legs.iter().filter(|leg| leg.step_s > 0.0) {
            if modes.last() != Some(&leg.mode) {
                modes.push(leg.mode);
            }
        }
        modes
    }

    /// Time of each state, s.
    pub fn times_s(&self) -> Vec<f64> {
        let mut time_s = 0.0;
        let steps = self.legs.iter().map(|leg| {
            time_s += leg.step_s;
            time_s
        });
        std::iter::once(0.0)
            .chain(steps.collect::<Vec<_>>())
            .collect()
    }

    /// Least and greatest value of each component, at the ends of steps.
    pub fn extent(&self) -> (SVector<f64, N>, SVector<f64, N>) {
        let mut low = self.states[0];
        let mut high = low;
        for state in &self.states {
            low = low.inf(state);
            high = high.sup(state);
        }
        (low, high)
    }
}

/// A quantity and its rate of change along the trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The quantity.
    pub value: f64,
    /// Its rate, per second.
    pub rate_per_s: f64,
}

/// The integrator of a system at one pair of parameters.
struct Integrator<'a, S: System<N>, const N: usize> {
    system: &'a S,
    equations: S::Equations<f64>,
    /// For the margins' rates.
    tangent: S::Equations<Dual<1>>,
    tolerance: f64,
}

/// The trajectory from `start` over `duration_s`; each step is accurate to `tolerance`, relative to
/// the greatest size of each component so far.
///
/// # Errors
/// If it diverges or takes too many steps.
pub fn integrate<S: System<N>, const N: usize>(
    system: &S,
    parameters: Parameters<f64>,
    start: &SVector<f64, N>,
    duration_s: f64,
    tolerance: f64,
) -> Result<Trajectory<S::Mode, N>, Failure> {
    let integrator = Integrator {
        system,
        equations: system.equations(parameters),
        tangent: system.equations(parameters.map(Dual::constant)),
        tolerance,
    };
    integrator.run(start, duration_s)
}

impl<S: System<N>, const N: usize> Integrator<'_, S, N> {
    fn run(
        &self,
        start: &SVector<f64, N>,
        duration_s: f64,
    ) -> Result<Trajectory<S::Mode, N>, Failure> {
        let longest_s = self.system.longest_step_s();
        let mut mode = self.equations.mode_at(start);
        let mut x = *start;
        let mut sizes = x.abs().add_scalar(f64::MIN_POSITIVE);
        let mut step_s = longest_s.min(duration_s);
        let mut time_s = 0.0;
        let mut trajectory = Trajectory {
            legs: Vec::new(),
            states: vec![x],
        };
        while time_s < duration_s {
            interrupt::check();
            let left_s = duration_s - time_s;
            // What rounding would leave is no step.
            let is_last = left_s <= step_s * (1.0 + 1e-9);
            let (taken_s, end, next_s) = self.smooth_step(&x, mode, step_s.min(left_s), &sizes);
            let is_last = is_last && taken_s == step_s.min(left_s);
            step_s = next_s.min(longest_s);
            let end_of_mode = self.end_of_mode(&x, &end, mode, taken_s);
            let (taken_s, mut end, passes) = match end_of_mode {
                Some((instant_s, margin)) => {
                    let (end, _) = extrapolate(&self.equations, &x, mode, instant_s);
                    (instant_s, end, Some(margin))
                }
                None => (taken_s, end, None),
            };
            trajectory.legs.push(Leg {
                mode,
                step_s: taken_s,
                passes,
            });
            if let Some(margin) = passes {
                mode = self.equations.next_mode(&mut end, mode, margin);
            }
            x = end;
            trajectory.states.push(x);
            time_s = if is_last && passes.is_none() {
                duration_s
            } else {
                time_s + taken_s
            };
            let size = x.amax();
            if !size.is_finite() || size > DIVERGED * (1.0 + start.amax()) {
                return Err(Failure::Diverges { time_s });
            }
            sizes = sizes.sup(&x.abs());
            let steps = trajectory.legs.len();
            if steps as f64 > STEPS_AT_ONCE + STEPS_PER_S * time_s {
                return Err(Failure::TooManySteps { time_s, steps });
            }
        }
        Ok(trajectory)
    }

    /// The longest step of at most `step_s` within the tolerance, the state after it, and a length
    /// for the next step.
    fn smooth_step(
        &self,
        x: &SVector<f64, N>,
        mode: S::Mode,
        mut step_s: f64,
        sizes: &SVector<f64, N>,
    ) -> (f64, SVector<f64, N>, f64) {
        let order = (2 * COLUMNS - 1) as f64;
        let shortest_s = step_s * 1e-9;
        loop {
            let (end, error) = extrapolate(&self.equations, x, mode, step_s);
            let scale = sizes.sup(&end.abs());
            let error = error.component_div(&scale).amax() / self.tolerance;
            let is_bad = error.is_nan() || error > 1.0;
            let factor = if is_bad && !error.is_finite() {
                0.1
            } else {
                (SAFETY * error.max(1e-12).powf(-1.0 / order)).clamp(0.1, GREATEST_GROWTH)
            };
            if !is_bad || step_s <= shortest_s {
                return (step_s, end, step_s * factor);
            }
            step_s *= factor.min(0.7);
        }
    }

    fn margins(&self, x: &SVector<f64, N>, mode: S::Mode) -> [Sample; 2] {
        let rates = self.equations.derivative(x, mode);
        let along = SVector::from_fn(|i, _| Dual::new(x[i], [rates[i]]));
        let margin = |margin: Dual<1>| Sample {
            value: margin.value,
            rate_per_s: margin.tangent[0],
        };
        self.tangent.margins(&along, mode).map(margin)
    }

    /// When within a step the mode ends, s from its start, and by which margin.
    fn end_of_mode(
        &self,
        x: &SVector<f64, N>,
        end: &SVector<f64, N>,
        mode: S::Mode,
        step_s: f64,
    ) -> Option<(f64, usize)> {
        let before = self.margins(x, mode);
        if before.iter().all(|margin| margin.value == f64::INFINITY) {
            return None;
        }
        let after = self.margins(end, mode);
        let ends = (0..2).filter_map(|k| {
            let instant_s = self.end_of_margin(x, mode, k, step_s, before[k], after[k])?;
            Some((instant_s, k))
        });
        ends.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn end_of_margin(
        &self,
        x: &SVector<f64, N>,
        mode: S::Mode,
        margin: usize,
        step_s: f64,
        before: Sample,
        after: Sample,
    ) -> Option<f64> {
        if before.value == f64::INFINITY {
            return None;
        }
        let at = |share: f64| hermite(before, after, step_s, share);
        let exact = |instant_s: f64| {
            let (state, _) = extrapolate(&self.equations, x, mode, instant_s);
            self.margins(&state, mode)[margin]
        };
        let mut high_s = step_s;
        if after.value >= 0.0 {
            // A dip within the step, if the cubic has one.
            let shares = (1..SAMPLES).map(|k| k as f64 / SAMPLES as f64);
            let lowest = shares.min_by(|a, b| at(*a).total_cmp(&at(*b)))?;
            let is_dip = at(lowest) < 0.1 * before.value.min(after.value)
                && before.rate_per_s < 0.0
                && after.rate_per_s > 0.0;
            if !is_dip || exact(lowest * step_s).value >= 0.0 {
                return None;
            }
            high_s = lowest * step_s;
        } else if before.value <= 0.0 && before.rate_per_s < 0.0 {
            return Some(0.0);
        }
        Some(root(before, step_s, high_s, at, exact))
    }
}

/// The instant at which a margin falls below zero, between the start of a step and `high_s`.
fn root(
    before: Sample,
    step_s: f64,
    mut high_s: f64,
    at: impl Fn(f64) -> f64,
    exact: impl Fn(f64) -> Sample,
) -> f64 {
    // A margin that begins at zero has left it first.
    let mut low_s = 0.0;
    if before.value <= 0.0 {
        let shares = (1..SAMPLES)
            .rev()
            .map(|k| k as f64 / SAMPLES as f64 * high_s / step_s);
        low_s = shares
            .into_iter()
            .find(|share| at(*share) > 0.0)
            .map_or(0.0, |share| share * step_s);
    }
    let mut instant_s = {
        let (mut low, mut high) = (low_s, high_s);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if at(middle / step_s) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    };
    for _ in 0..MOST_TRIALS {
        let here = exact(instant_s);
        if here.value >= 0.0 {
            low_s = instant_s;
        } else {
            high_s = instant_s;
        }
        let newton_s = instant_s - here.value / here.rate_per_s;
        let next_s = if newton_s > low_s && newton_s < high_s {
            newton_s
        } else if here.value == 0.0 || newton_s == instant_s {
            return instant_s;
        } else {
            0.5 * (low_s + high_s)
        };
        if (next_s - instant_s).abs() <= 4.0 * f64::EPSILON * step_s {
            return next_s;
        }
        instant_s = next_s;
    }
    instant_s
}

/// The cubic with the values and rates at both ends of a step, at a share of it.
pub fn hermite(before: Sample, after: Sample, step_s: f64, share: f64) -> f64 {
    let rest = 1.0 - share;
    before.value * rest * rest * (1.0 + 2.0 * share)
        + before.rate_per_s * step_s * rest * rest * share
        + after.value * share * share * (1.0 + 2.0 * rest)
        - after.rate_per_s * step_s * share * share * rest
}

/// The state after a step by the extrapolated midpoint rule, and its error.
fn extrapolate<T: Real, E: Equations<T, N>, const N: usize>(
    equations: &E,
    x: &SVector<T, N>,
    mode: E::Mode,
    step_s: f64,
) -> (SVector<T, N>, SVector<T, N>)
where
    E::Mode: Copy,
{
    let first = equations.derivative(x, mode);
    let advanced = |from: &SVector<T, N>, rates: &SVector<T, N>, time_s: f64| {
        let time_s = T::from_f64(time_s);
        SVector::<T, N>::from_fn(|i, _| from[i] + rates[i] * time_s)
    };
    let mut row = [*x; COLUMNS];
    let mut error = *x;
    for column in 0..COLUMNS {
        let count = 2 * (column + 1);
        let part_s = step_s / count as f64;
        let mut before = *x;
        let mut now = advanced(x, &first, part_s);
        for _ in 1..count {
            let next = advanced(&before, &equations.derivative(&now, mode), 2.0 * part_s);
            before = now;
            now = next;
        }
        // Aitken and Neville: the row below, from the one above.
        for (k, above) in row[..column].iter_mut().enumerate() {
            let ratio = (column + 1) as f64 / (column - k) as f64;
            let weight = T::from_f64(1.0 / (ratio * ratio - 1.0));
            let (last, at_this) = (*above, now);
            *above = at_this;
            now = SVector::from_fn(|i, _| at_this[i] + (at_this[i] - last[i]) * weight);
            error = SVector::from_fn(|i, _| now[i] - at_this[i]);
        }
        row[column] = now;
    }
    (row[COLUMNS - 1], error)
}

/// A number that is the independent variable in that place.
pub(crate) fn seed<const K: usize>(value: f64, place: usize) -> Dual<K> {
    Dual::new(
        value,
        std::array::from_fn(|k| f64::from(u8::from(k == place))),
    )
}

/// The end of a trajectory with derivatives: repeats its first `legs` steps with a `start` and
/// `equations` in dual numbers, at fixed times.
///
/// # Errors
/// If the trajectory touches the boundary of a mode without crossing it.
pub fn differentiate<E: Equations<Dual<K>, N>, const N: usize, const K: usize>(
    equations: &E,
    trajectory: &Trajectory<E::Mode, N>,
    legs: usize,
    start: SVector<Dual<K>, N>,
) -> Result<SVector<Dual<K>, N>, Failure>
where
    E::Mode: Copy,
{
    let mut x = start;
    let mut time_s = 0.0;
    for (k, leg) in trajectory.legs[..legs].iter().enumerate() {
        interrupt::check();
        if leg.step_s > 0.0 {
            x = extrapolate(equations, &x, leg.mode, leg.step_s).0;
        }
        time_s += leg.step_s;
        let Some(passed) = leg.passes else { continue };
        let next = trajectory.legs.get(k + 1).map(|leg| leg.mode);
        x = saltation(equations, x, leg.mode, passed, next).ok_or(Failure::Grazes { time_s })?;
    }
    Ok(x)
}

/// The tangent vectors after a mode's end: those at the boundary, less what the next mode has moved
/// until the fixed time.
fn saltation<E: Equations<Dual<K>, N>, const N: usize, const K: usize>(
    equations: &E,
    mut x: SVector<Dual<K>, N>,
    mode: E::Mode,
    passed: usize,
    next: Option<E::Mode>,
) -> Option<SVector<Dual<K>, N>>
where
    E::Mode: Copy,
{
    let before = equations.derivative(&x, mode).map(|rate| rate.value);
    let margin = equations.margins(&x, mode)[passed];
    let mut along = [0.0; K];
    let rate_per_s = {
        // Along the flow, in the first tangent: those of the parameters are others.
        let moving = SVector::from_fn(|i, _| {
            along[0] = before[i];
            Dual::new(x[i].value, along)
        });
        equations.margins(&moving, mode)[passed].tangent[0]
    };
    let delays_s = margin.tangent.map(|tangent| -tangent / rate_per_s);
    if !delays_s.iter().all(|delay_s| delay_s.is_finite()) {
        return None;
    }
    let shift = |x: &mut SVector<Dual<K>, N>, rates: &SVector<f64, N>, sign: f64| {
        for i in 0..N {
            for (tangent, delay_s) in x[i].tangent.iter_mut().zip(delays_s) {
                *tangent += sign * rates[i] * delay_s;
            }
        }
    };
    shift(&mut x, &before, 1.0);
    let chosen = equations.next_mode(&mut x, mode, passed);
    let after = equations
        .derivative(&x, next.unwrap_or(chosen))
        .map(|rate| rate.value);
    shift(&mut x, &after, -1.0);
    Some(x)
}
