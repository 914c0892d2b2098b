//! diffsol: its explicit method, Tsitouras' 5(4), with its root finding.

use crate::export::Coefficients;
use crate::job::{self, Outcome};
use crate::model::{Mode, STEP_AFTER_EVENT_S};
use diffsol::{NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};
use std::cell::Cell;

/// The state after some seconds.
fn integrate<const N: usize>(
    c: &Coefficients,
    x: [f64; N],
    duration_s: f64,
    tolerance: f64,
) -> [f64; N] {
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .h0(1e-3)
        .rhs(|x, _p, _t_s, out| c.write_rates::<N>(x, out))
        .init(move |_p, _t_s, out| out.copy_from_slice(&x), N)
        .build()
        .expect("a problem");
    let mut solver = problem.tsit45().expect("a solver");
    solver.set_stop_time(duration_s).expect("ahead");
    while solver.step().expect("integrated") != OdeSolverStopReason::TstopReached {}
    let y = solver.state().y.clone();
    std::array::from_fn(|i| y[i])
}

/// The state after some seconds with friction, and the changes of mode.
fn integrate_friction(
    c: &Coefficients,
    start: [f64; 4],
    duration_s: f64,
    tolerance: f64,
) -> ([f64; 4], u32) {
    let four = |x: &[f64]| -> [f64; 4] { std::array::from_fn(|i| x[i]) };
    let mode = Cell::new(Mode::at_rest(c, &start));
    let problem = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol([tolerance])
        .h0(1e-3)
        .rhs(|x, _p, _t_s, out| out.copy_from_slice(&mode.get().rates(c, &four(x))))
        .init(move |_p, _t_s, out| out.copy_from_slice(&start), 4)
        .root(|x, _p, _t_s, out| out[0] = mode.get().event(c, &four(x)), 1)
        .build()
        .expect("a problem");
    let mut solver = problem.tsit45().expect("a solver");
    solver.set_stop_time(duration_s).expect("ahead");
    let mut changes = 0;
    loop {
        match solver.step().expect("integrated") {
            OdeSolverStopReason::InternalTimestep => {}
            OdeSolverStopReason::TstopReached => {
                let y = solver.state().y.clone();
                return (std::array::from_fn(|i| y[i]), changes);
            }
            OdeSolverStopReason::RootFound(t_s, _) => {
                solver.state_mut_back(t_s).expect("within the step");
                let state = solver.state_mut();
                state.y[3] = 0.0;
                let x = std::array::from_fn(|i| state.y[i]);
                mode.set(mode.get().next(c, &x));
                // The method's first stage is the last slope, which jumps here.
                for (i, rate) in mode.get().rates(c, &x).into_iter().enumerate() {
                    state.dy[i] = rate;
                }
                *state.h = STEP_AFTER_EVENT_S;
                changes += 1;
            }
        }
    }
}

/// Runs a job.
pub fn run(job: &str, tolerance: f64, until_s: f64) -> Option<Outcome> {
    match job {
        "S" => Some(job::state(until_s, |c, x, duration_s| {
            integrate(c, x, duration_s, tolerance)
        })),
        "L" => Some(job::exponent(until_s, |c, x, duration_s| {
            integrate(c, x, duration_s, tolerance)
        })),
        "F" => Some(job::friction(until_s, |c, x, duration_s| {
            integrate_friction(c, x, duration_s, tolerance)
        })),
        _ => None,
    }
}
