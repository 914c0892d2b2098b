//! The largest Lyapunov exponent along recorded states, with its statistical error.
//!
//! A tangent vector is carried along by the linearised step: dual numbers through the integrator
//! itself, so with the right jumps at friction events; stick takes one dimension away. The mean
//! rate of its growth is the exponent. Any recorded motion will do, the telemetry of the firmware
//! too.

use crate::dual::Dual;
use crate::period::yaw_rate_maxima;
use crate::trace::Trace;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::open_loop::OpenLoop;
use shared_model::vehicle::State;

/// Fewest segments for a standard error.
pub const MIN_SEGMENTS: usize = 16;
/// Where the yaw rate has no maxima (at rest), segments of equal time.
const SEGMENTS_AT_REST: usize = 64;
/// Correlation of neighbours up to which a sequence is prewhitened.
const GREATEST_CORRELATION: f64 = 0.97;
/// Time in which the tangent vector turns into the direction of fastest growth, as a share of the
/// motion.
pub const WARM_UP: f64 = 0.1;

/// A Lyapunov exponent with its statistical error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponent {
    /// Mean growth rate, 1/s.
    pub per_s: f64,
    /// Standard error, 1/s; it takes the correlation of successive segments of the motion into
    /// account.
    pub standard_error_per_s: f64,
    /// The least rate that the motion's length can distinguish from zero, 1/s: the most that the
    /// vector stretches beyond the mean within one cycle, and at least one e-fold, over the whole
    /// length.
    pub resolution_per_s: f64,
    /// Length of the motion that it is taken over, s.
    pub duration_s: f64,
}

impl Exponent {
    /// The exponent from the stretching (a logarithm) and the length (s) of successive segments.
    pub fn from_segments(segments: &[(f64, f64)]) -> Self {
        let duration_s: f64 = segments.iter().map(|&(_, length)| length).sum();
        let mean = segments.iter().map(|&(growth, _)| growth).sum::<f64>() / duration_s;
        let excess: Vec<f64> = segments
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

    /// What the exponent must exceed to count as positive: three standard errors, and the
    /// resolution.
    pub fn threshold_per_s(&self) -> f64 {
        (3.0 * self.standard_error_per_s).max(self.resolution_per_s)
    }

    /// Above the threshold: the motion is chaotic.
    pub fn is_positive(&self) -> bool {
        self.per_s > self.threshold_per_s()
    }
}

/// Variance of the sum of a correlated sequence of mean zero: prewhitened by a first-order
/// autoregression, then with Bartlett weights. D. W. K. Andrews, J. C. Monahan, Econometrica 60
/// (1992) 953. The greater of two, with as many lags as the root of the length and as its power
/// 2/3: the first misses the laminar phases of intermittent chaos, the second scatters more.
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
    let with_lags = |power: f64| {
        let lags = (white.len() as f64).powf(power) as usize;
        let weighted = (1..=lags).map(|lag| {
            let weight = 1.0 - lag as f64 / (lags + 1) as f64;
            2.0 * weight * covariance(&white, lag)
        });
        covariance(&white, 0) + weighted.sum::<f64>()
    };
    let sum = with_lags(0.5).max(with_lags(2.0 / 3.0));
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

/// Largest exponent along the recorded motion of a scenario from the state with index `from` on.
/// `None` if the motion is too short for a standard error, or not finite.
///
/// The motion is cut at the maxima of the yaw rate, where a periodic motion is at the same phase
/// again. Within a cycle the vector stretches and shrinks, and what one segment has too much its
/// neighbour has too little, so the standard error takes the segments' correlation into account.
pub fn largest(scenario: &Scenario<f64>, trace: &Trace, from: usize) -> Option<Exponent> {
    let growth = tangent_growth(scenario, trace)?;
    let warm = from + ((trace.states.len() - from) as f64 * WARM_UP) as usize;
    let ends = piece_ends(trace, warm);
    if ends.len() <= MIN_SEGMENTS {
        return None;
    }
    let segment = |ends: &[usize]| {
        let length = (ends[1] - ends[0]) as f64 * trace.step_s;
        (growth[ends[1]] - growth[ends[0]], length)
    };
    let segments: Vec<_> = ends.windows(2).map(segment).collect();
    let exponent = Exponent::from_segments(&segments);
    exponent.per_s.is_finite().then_some(exponent)
}

/// Logarithm of the tangent vector's length at each state.
fn tangent_growth(scenario: &Scenario<f64>, trace: &Trace) -> Option<Vec<f64>> {
    let mut ecu = OpenLoop::new(&scenario.map(&Dual::<1>::constant)).ok()?;
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

/// Indices of the states at which segments end and begin.
fn piece_ends(trace: &Trace, from: usize) -> Vec<usize> {
    let maxima = yaw_rate_maxima(trace, from);
    if maxima.is_empty() {
        let segment = (trace.states.len() - from) / SEGMENTS_AT_REST;
        return (from..trace.states.len()).step_by(segment.max(1)).collect();
    }
    let index = |&(time_s, _): &(f64, f64)| (time_s / trace.step_s).round() as usize - 1;
    maxima.iter().map(index).collect()
}
