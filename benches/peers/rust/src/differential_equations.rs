//! differential-equations: dop853 on arrays; with friction dopri5, whose dense output is better
//! between steps: at a tolerance of 1e-12 on an oscillator it errs by 2e-10 there, dop853's (0.7.0)
//! by 5e-8.

use crate::export::Coefficients;
use crate::job::{self, Outcome};
use crate::model::{Mode, STEP_AFTER_EVENT_S};
use differential_equations::ode::{OrdinaryNumericalMethod, solve_ode};
use differential_equations::prelude::*;
use std::cell::Cell;

struct Lane<'a>(&'a Coefficients);

impl<const N: usize> ODE<f64, [f64; N]> for Lane<'_> {
    fn diff(&self, _t_s: f64, x: &[f64; N], out: &mut [f64; N]) {
        self.0.write_rates::<N>(x, out);
    }
}

/// A lane with friction.
struct LaneInMode<'a> {
    c: &'a Coefficients,
    mode: Cell<Mode>,
}

impl ODE<f64, [f64; 4]> for LaneInMode<'_> {
    fn diff(&self, _t_s: f64, x: &[f64; 4], out: &mut [f64; 4]) {
        *out = self.mode.get().rates(self.c, x);
    }
}

/// Changes the mode where the event function turns negative, and counts.
///
/// The root is found here, on the crate's dense output: the crate's own terminal events (0.7.0) end
/// at steering rates of up to 2e-4 rad/s instead of 0, by its own dense output, at a tolerance of
/// 1e-12.
struct ChangeMode<'a> {
    lane: &'a LaneInMode<'a>,
    count: u32,
}

impl Solout<f64, [f64; 4]> for ChangeMode<'_> {
    fn solout<I: Interpolation<f64, [f64; 4]> + ?Sized>(
        &mut self,
        t_s: f64,
        t_before_s: f64,
        x: &[f64; 4],
        x_before: &[f64; 4],
        interpolator: &mut I,
        _solution: &mut Solution<f64, [f64; 4]>,
    ) -> ControlFlag<f64, [f64; 4]> {
        let LaneInMode { c, mode } = self.lane;
        let event = |x: &[f64; 4]| mode.get().event(c, x);
        let after = event(x);
        if after >= 0.0 || t_s <= t_before_s {
            return ControlFlag::Continue;
        }
        let before = event(x_before).max(0.0);
        let mut at = |t_s| interpolator.interpolate(t_s).expect("within the step");
        let root_s = root(|t_s| event(&at(t_s)), (t_before_s, before), (t_s, after));
        let mut x = at(root_s);
        x[3] = 0.0;
        mode.set(mode.get().next(c, &x));
        self.count += 1;
        ControlFlag::ModifyState(root_s, x)
    }
}

/// Root of a function between two points, positive at the first or zero where a mode begins, and
/// negative at the second, by the Illinois method.
fn root(mut f: impl FnMut(f64) -> f64, mut low: (f64, f64), mut high: (f64, f64)) -> f64 {
    for _ in 0..30 {
        if low.1 > 0.0 {
            break;
        }
        // The root at the beginning is not the one that is looked for.
        let middle = 0.5 * (low.0 + high.0);
        match f(middle) {
            value if value > 0.0 => low = (middle, value),
            value => high = (middle, value),
        }
    }
    for _ in 0..50 {
        if low.1 == high.1 {
            break;
        }
        let x = high.0 - high.1 * (high.0 - low.0) / (high.1 - low.1);
        let value = f(x);
        if value.abs() < 1e-16 {
            return x;
        }
        if (value > 0.0) == (high.1 > 0.0) {
            low.1 *= 0.5;
        } else {
            low = high;
        }
        high = (x, value);
    }
    high.0
}

/// Keeps no step.
struct NoOutput;

impl<const N: usize> Solout<f64, [f64; N]> for NoOutput {
    fn solout<I: Interpolation<f64, [f64; N]> + ?Sized>(
        &mut self,
        _t_s: f64,
        _t_before_s: f64,
        _x: &[f64; N],
        _x_before: &[f64; N],
        _interpolator: &mut I,
        _solution: &mut Solution<f64, [f64; N]>,
    ) -> ControlFlag<f64, [f64; N]> {
        ControlFlag::Continue
    }
}

/// Runs a job.
pub fn run(job: &str, tolerance: f64, until_s: f64) -> Option<Outcome> {
    macro_rules! integrate {
        () => {
            |c, x, duration_s| {
                let mut solver = ExplicitRungeKutta::dop853()
                    .rtol(tolerance)
                    .atol(tolerance)
                    .max_steps(usize::MAX);
                solve_ode(&mut solver, &Lane(c), 0.0, duration_s, &x, &mut NoOutput)
                    .expect("integrated");
                *solver.y()
            }
        };
    }
    match job {
        "S" => Some(job::state(until_s, integrate!())),
        "L" => Some(job::exponent(until_s, integrate!())),
        "F" => Some(job::friction(until_s, |c, x, until_s| {
            let mode = Cell::new(Mode::at_rest(c, &x));
            let lane = LaneInMode { c, mode };
            let mut changes = ChangeMode {
                lane: &lane,
                count: 0,
            };
            let mut solver = ExplicitRungeKutta::dopri5()
                .rtol(tolerance)
                .atol(tolerance)
                .h0(STEP_AFTER_EVENT_S)
                .max_steps(usize::MAX);
            solve_ode(&mut solver, &lane, 0.0, until_s, &x, &mut changes).expect("integrated");
            (*solver.y(), changes.count)
        })),
        _ => None,
    }
}
