//! The jobs, for any integrator: a peer brings a function for one stretch of one lane.

use crate::export::{Coefficients, coefficients};
use crate::model::{RENORMALISATION_S, START, TANGENT_NORM, TANGENT_START};
use cpu_time::ProcessTime;
use serde::Serialize;

/// What a run of a job came to.
#[derive(Serialize)]
pub struct Outcome {
    /// CPU time of the process for all lanes, s.
    pub cpu_s: f64,
    /// State of every lane at the end.
    pub states: Vec<[f64; 4]>,
    /// Largest Lyapunov exponent of every lane, 1/s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub exponents_per_s: Vec<f64>,
    /// Changes of friction's mode in every lane.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mode_changes: Vec<u32>,
}

/// Runs every lane; each gives its last state, its exponent and its changes of mode, where it has
/// them.
fn run(mut lane: impl FnMut(&Coefficients) -> ([f64; 4], Option<f64>, Option<u32>)) -> Outcome {
    let lanes = coefficients();
    let start = ProcessTime::now();
    let results: Vec<_> = lanes.iter().map(&mut lane).collect();
    Outcome {
        cpu_s: start.elapsed().as_secs_f64(),
        states: results.iter().map(|r| r.0).collect(),
        exponents_per_s: results.iter().filter_map(|r| r.1).collect(),
        mode_changes: results.iter().filter_map(|r| r.2).collect(),
    }
}

/// Job S: the state alone. `integrate` takes a state over some seconds.
pub fn state(
    until_s: f64,
    integrate: impl Fn(&Coefficients, [f64; 4], f64) -> [f64; 4],
) -> Outcome {
    run(|c| (integrate(c, START, until_s), None, None))
}

/// Job L: with the tangent vector behind the state, renormalised after each stretch.
pub fn exponent(
    until_s: f64,
    integrate: impl Fn(&Coefficients, [f64; 8], f64) -> [f64; 8],
) -> Outcome {
    run(|c| {
        let mut x = [0.0; 8];
        x[..4].copy_from_slice(&START);
        x[4..].copy_from_slice(&TANGENT_START);
        let mut logarithm = 0.0;
        for _ in 0..(until_s / RENORMALISATION_S).round() as u32 {
            x = integrate(c, x, RENORMALISATION_S);
            let growth = x[4..].iter().map(|t| t * t).sum::<f64>().sqrt() / TANGENT_NORM;
            x[4..].iter_mut().for_each(|t| *t /= growth);
            logarithm += growth.ln();
        }
        let state = std::array::from_fn(|i| x[i]);
        (state, Some(logarithm / until_s), None)
    })
}

/// Job F: with friction. `integrate` takes the start over some seconds and counts the changes of
/// mode.
pub fn friction(
    until_s: f64,
    integrate: impl Fn(&Coefficients, [f64; 4], f64) -> ([f64; 4], u32),
) -> Outcome {
    run(|c| {
        let (x, changes) = integrate(c, START, until_s);
        (x, None, Some(changes))
    })
}
