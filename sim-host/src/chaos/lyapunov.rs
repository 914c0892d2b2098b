//! Largest Lyapunov exponent by tangent dynamics.
//!
//! A tangent vector is carried along a motion by the linearised step (dual numbers through the ECU's own program, so with
//! the right jumps at friction events; stick takes one dimension away), and the mean rate of its growth is the exponent.
//! The motion may be any recorded one: the firmware's own telemetry will do.

use crate::chaos::period::yaw_rate_maxima;
use crate::engine::dual::Dual;
use crate::trace::Trace;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::controller::Ecu;
use shared_model::vehicle::State;

/// Fewest pieces for a standard error.
const MIN_PIECES: usize = 16;
/// Where the yaw rate has no maxima (at rest), pieces of equal time.
const PIECES_AT_REST: usize = 64;
/// Correlation of neighbours up to which a sequence is prewhitened.
const GREATEST_CORRELATION: f64 = 0.97;
/// Time in which the tangent vector turns into the direction of fastest growth, as a share of the motion.
const WARM_UP: f64 = 0.1;

/// A Lyapunov exponent with its statistical error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponent {
    /// Mean growth rate, 1/s.
    pub per_s: f64,
    /// Standard error, 1/s; see [`largest`].
    pub standard_error_per_s: f64,
    /// The least rate that the motion's length can tell from zero, 1/s: the most that the vector stretches beyond the mean
    /// within one cycle, and at least one e-fold, over the whole length.
    pub resolution_per_s: f64,
    /// Length of the motion that it is taken over, s.
    pub duration_s: f64,
}

impl Exponent {
    /// The exponent from growths (of the logarithm) and lengths (s) of successive pieces.
    fn from_pieces(pieces: &[(f64, f64)]) -> Self {
        let duration_s: f64 = pieces.iter().map(|&(_, length)| length).sum();
        let mean = pieces.iter().map(|&(growth, _)| growth).sum::<f64>() / duration_s;
        let excess: Vec<f64> = pieces
            .iter()
            .map(|&(growth, length)| growth - mean * length)
            .collect();
        Self {
            per_s: mean,
            standard_error_per_s: long_run_variance_sum(&excess).sqrt() / duration_s,
            resolution_per_s: excess.iter().fold(1.0, |most: f64, e| most.max(e.abs()))
                / duration_s,
            duration_s,
        }
    }

    /// What the exponent must exceed to count as positive: three standard errors, and the resolution.
    pub fn threshold_per_s(&self) -> f64 {
        (3.0 * self.standard_error_per_s).max(self.resolution_per_s)
    }

    /// Above the threshold: the motion is chaotic.
    pub fn is_positive(&self) -> bool {
        self.per_s > self.threshold_per_s()
    }
}

/// Variance of the sum of a correlated sequence of mean zero: prewhitened by a first-order autoregression, then with
/// Bartlett weights over as many lags as the root of the length. D. W. K. Andrews, J. C. Monahan, Econometrica 60 (1992) 953.
fn long_run_variance_sum(sequence: &[f64]) -> f64 {
    let covariance =
        |x: &[f64], lag: usize| -> f64 { x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum() };
    let variance = covariance(sequence, 0);
    if variance == 0.0 {
        return 0.0;
    }
    let rho =
        (covariance(sequence, 1) / variance).clamp(-GREATEST_CORRELATION, GREATEST_CORRELATION);
    let white: Vec<f64> = sequence.windows(2).map(|x| x[1] - rho * x[0]).collect();
    let lags = (white.len() as f64).sqrt() as usize;
    let weighted = (1..=lags).map(|lag| {
        let weight = 1.0 - lag as f64 / (lags + 1) as f64;
        2.0 * weight * covariance(&white, lag)
    });
    let sum = covariance(&white, 0) + weighted.sum::<f64>();
    sum.max(0.0) / (1.0 - rho).powi(2)
}

impl std::fmt::Display for Exponent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.3} ± {:.3} 1/s over {:.0} s",
            self.per_s, self.standard_error_per_s, self.duration_s
        )
    }
}

/// Largest exponent along the recorded motion of a scenario from the state with index `from` on. `None` if the motion is too
/// short for a standard error, or not finite.
///
/// The motion is cut at the maxima of the yaw rate, where a periodic motion is at the same phase again. Within a cycle the
/// vector stretches and shrinks, and what one piece has too much its neighbour has too little, so the standard error takes
/// the pieces' correlation into account.
pub fn largest(scenario: &Scenario<f64>, trace: &Trace, from: usize) -> Option<Exponent> {
    let growth = tangent_growth(scenario, trace)?;
    let warm = from + ((trace.states.len() - from) as f64 * WARM_UP) as usize;
    let ends = piece_ends(trace, warm);
    if ends.len() <= MIN_PIECES {
        return None;
    }
    let piece = |ends: &[usize]| {
        let length = (ends[1] - ends[0]) as f64 * trace.step_s;
        (growth[ends[1]] - growth[ends[0]], length)
    };
    let pieces: Vec<_> = ends.windows(2).map(piece).collect();
    let exponent = Exponent::from_pieces(&pieces);
    exponent.per_s.is_finite().then_some(exponent)
}

/// Logarithm of the tangent vector's length at each state.
fn tangent_growth(scenario: &Scenario<f64>, trace: &Trace) -> Option<Vec<f64>> {
    let mut ecu = Ecu::new(&scenario.map(&Dual::<1>::constant)).ok()?;
    let mut tangent = Vector4::repeat(0.5);
    let mut logarithm = 0.0;
    let mut growth = Vec::with_capacity(trace.states.len());
    for start in trace.starts() {
        ecu.control.set_state(State {
            x: start.x.zip_map(&tangent, |value, t| Dual::new(value, [t])),
            friction: start.friction,
        });
        tangent = ecu.step(|_| {}).x.map(|component| component.tangent[0]);
        let length = tangent.dot(&tangent).sqrt();
        tangent /= length;
        logarithm += length.ln();
        growth.push(logarithm);
    }
    Some(growth)
}

/// Indices of the states at which pieces end and begin.
fn piece_ends(trace: &Trace, from: usize) -> Vec<usize> {
    let maxima = yaw_rate_maxima(trace, from);
    if maxima.is_empty() {
        let piece = (trace.states.len() - from) / PIECES_AT_REST;
        return (from..trace.states.len()).step_by(piece.max(1)).collect();
    }
    let index = |&(time_s, _): &(f64, f64)| (time_s / trace.step_s).round() as usize - 1;
    maxima.iter().map(index).collect()
}
