//! ode_solvers: dop853 on nalgebra vectors.

use crate::export::Coefficients;
use crate::job::{self, Outcome};
use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, SVector, System};

struct Lane<'a>(&'a Coefficients);

impl<const N: usize> System<f64, SVector<f64, N>> for Lane<'_> {
    fn system(&self, _t_s: f64, x: &SVector<f64, N>, out: &mut SVector<f64, N>) {
        self.0.write_rates::<N>(x.as_slice(), out.as_mut_slice());
    }
}

/// Runs a job, if it can be expressed.
pub fn run(job: &str, tolerance: f64, until_s: f64) -> Option<Outcome> {
    macro_rules! integrate {
        () => {
            |c, x, duration_s| {
                // The defaults, but as many steps as it takes, every step put out but none between,
                // and no test for stiffness: at its default, every 1000 steps, it gives up
                // on some lanes at tolerances from 1e-9 up.
                let mut solver = Dop853::from_param(
                    Lane(c),
                    0.0,
                    duration_s,
                    0.0,
                    x.into(),
                    tolerance,
                    tolerance,
                    0.9,
                    0.0,
                    0.333,
                    6.0,
                    duration_s,
                    0.0,
                    u32::MAX,
                    u32::MAX,
                    OutputType::Sparse,
                );
                solver.integrate().expect("integrated");
                (*solver.y_out().last().expect("a last step")).into()
            }
        };
    }
    match job {
        "S" => Some(job::state(until_s, integrate!())),
        "L" => Some(job::exponent(until_s, integrate!())),
        _ => None,
    }
}
