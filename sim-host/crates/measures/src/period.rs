//! Period of a motion, counted in local maxima of the yaw rate: what the paper's bifurcation
//! diagrams show.

use crate::trace::Trace;
use shared_model::vehicle::YAW_RATE;

/// Highest period that is distinguished from chaos.
const MAX_PERIOD: usize = 16;
/// Repetitions of the cycle that must be seen.
const MIN_REPETITIONS: usize = 3;
/// Maxima count as equal when they differ by at most this share of the yaw rate's range.
pub const TOLERANCE: f64 = 2e-3;
/// The same under the true dither signal, whose ripple the maxima ride on.
pub const RIPPLE_TOLERANCE: f64 = 1e-2;
/// Height over its surroundings at which a maximum counts, as a share of the yaw rate's range.
pub const PROMINENCE: f64 = 1e-2;
/// A yaw rate that varies by less than this is at rest, rad/s.
pub const AT_REST_RAD_PER_S: f64 = 1e-6;

/// What a motion's maxima say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Period {
    /// No motion.
    Equilibrium,
    /// The maxima repeat after `maxima` of them, to `residual` of the yaw rate's range; the cycle
    /// takes `time_s`.
    Periodic {
        /// Maxima in a cycle: period-n.
        maxima: usize,
        /// Greatest difference of maxima one cycle apart, over the yaw rate's range.
        residual: f64,
        /// Mean time of a cycle, s.
        time_s: f64,
        /// Greatest deviation of a cycle's time from the mean, s.
        time_spread_s: f64,
    },
    /// No repetition up to period 16; `residual` is the least one found.
    Aperiodic {
        /// Least over the periods tried of the greatest difference, over the yaw rate's range.
        residual: f64,
    },
    /// Fewer maxima than a judgement needs.
    TooShort {
        /// Maxima seen.
        maxima: usize,
    },
}

impl Period {
    /// The number of maxima in a cycle, if there is a cycle.
    pub fn maxima(&self) -> Option<usize> {
        match self {
            Self::Periodic { maxima, .. } => Some(*maxima),
            _ => None,
        }
    }
}

impl std::fmt::Display for Period {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Equilibrium => f.write_str("equilibrium"),
            Self::Periodic { maxima, time_s, .. } => {
                write!(f, "period-{maxima} (cycle {time_s:.4} s)")
            }
            Self::Aperiodic { .. } => write!(f, "no period up to {MAX_PERIOD}"),
            Self::TooShort { maxima } => write!(f, "too short: {maxima} maxima"),
        }
    }
}

/// Time (s) and height (rad/s) of each local maximum of the yaw rate from state index `from` on,
/// each from the parabola through its three highest samples. A maximum counts if the yaw rate rises
/// to it and falls from it by a hundredth of its range: a ripple makes none.
pub fn yaw_rate_maxima(trace: &Trace, from: usize) -> Vec<(f64, f64)> {
    let gamma: Vec<f64> = trace.component(YAW_RATE).skip(from).collect();
    let (low, high) = trace.range(YAW_RATE, from);
    let interpolate = |k: usize| {
        let (left, top, right) = (gamma[k - 1], gamma[k], gamma[k + 1]);
        let offset = 0.5 * (left - right) / (left - 2.0 * top + right);
        let height = top - 0.25 * (left - right) * offset;
        (trace.time_s(from + k) + offset * trace.step_s, height)
    };
    let peaks = prominent_maxima(&gamma, PROMINENCE * (high - low));
    peaks.into_iter().map(interpolate).collect()
}

/// Mean time between maxima of the yaw rate, s, if there are two.
pub fn mean_cycle_s(trace: &Trace) -> Option<f64> {
    let maxima = yaw_rate_maxima(trace, 0);
    let (first, last) = (maxima.first()?.0, maxima.last()?.0);
    (maxima.len() > 1).then(|| (last - first) / (maxima.len() - 1) as f64)
}

/// Indices of the maxima to which `values` rise by at least `prominence`, and from which they fall
/// by as much.
pub fn prominent_maxima(values: &[f64], prominence: f64) -> Vec<usize> {
    let mut maxima = Vec::new();
    let mut rising = false;
    // The furthest point in the present direction.
    let mut extreme = 0;
    for (k, &value) in values.iter().enumerate() {
        let beyond = if rising {
            value > values[extreme]
        } else {
            value < values[extreme]
        };
        if beyond {
            extreme = k;
        } else if (value - values[extreme]).abs() > prominence {
            if rising {
                maxima.push(extreme);
            }
            rising = !rising;
            extreme = k;
        }
    }
    maxima
}

/// Time (s) and height of the maxima among a quantity's turning points that stand out by a
/// hundredth of its range.
pub fn maxima_of_turns(turns: &[(f64, f64)], range: f64) -> Vec<(f64, f64)> {
    let heights: Vec<f64> = turns.iter().map(|&(_, height)| height).collect();
    let maxima = prominent_maxima(&heights, PROMINENCE * range);
    maxima.into_iter().map(|k| turns[k]).collect()
}

/// Period of the motion from state index `from` on; maxima count as equal within `tolerance` of the
/// yaw rate's range.
pub fn period(trace: &Trace, from: usize, tolerance: f64) -> Period {
    let (low, high) = trace.range(YAW_RATE, from);
    period_of_maxima(&yaw_rate_maxima(trace, from), high - low, tolerance)
}

/// Period of a motion given its yaw rate's maxima (time in s, height in rad/s) and range (rad/s);
/// as [`period`].
pub fn period_of_maxima(maxima: &[(f64, f64)], range: f64, tolerance: f64) -> Period {
    if range < AT_REST_RAD_PER_S {
        return Period::Equilibrium;
    }
    if maxima.len() < MIN_REPETITIONS + 1 {
        return Period::TooShort {
            maxima: maxima.len(),
        };
    }
    let mut least = f64::INFINITY;
    for n in 1..=MAX_PERIOD.min(maxima.len() / (MIN_REPETITIONS + 1)) {
        let residual = residual(maxima, n) / range;
        if residual <= tolerance {
            let (time_s, time_spread_s) = cycle_time(maxima, n);
            return Period::Periodic {
                maxima: n,
                residual,
                time_s,
                time_spread_s,
            };
        }
        least = least.min(residual);
    }
    Period::Aperiodic { residual: least }
}

fn residual(maxima: &[(f64, f64)], n: usize) -> f64 {
    let pairs = maxima.iter().zip(&maxima[n..]);
    pairs.map(|(a, b)| (a.1 - b.1).abs()).fold(0.0, f64::max)
}

fn cycle_time(maxima: &[(f64, f64)], n: usize) -> (f64, f64) {
    let times: Vec<f64> = maxima
        .iter()
        .zip(&maxima[n..])
        .map(|(a, b)| b.0 - a.0)
        .collect();
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    let spread = times.iter().map(|t| (t - mean).abs()).fold(0.0, f64::max);
    (mean, spread)
}
