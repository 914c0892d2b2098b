//! Lyapunov exponents by tangent dynamics.
//!
//! A tangent vector is carried along a motion by the linearised step (dual numbers through the
//! integrator itself, so with the right jumps at friction events; stick takes one dimension away),
//! and the mean rate of its growth is the largest exponent. [`largest`] takes any recorded motion:
//! the firmware's own telemetry will do. [`exponents`] runs freely along a [`Flow`] with as many
//! vectors as exponents are wanted, kept at right angles. The engine's motions have tangent vectors
//! of their own; their stretching becomes exponents here too.

use crate::flow::{Flow, Unmeasured, check, steps};
use crate::period::yaw_rate_maxima;
use crate::trace::Trace;
use engine::dual::Dual;
use engine::taylor::Trajectory;
use nalgebra::{SMatrix, SVector, Vector4};
use shared_model::Scenario;
use shared_model::open_loop::OpenLoop;
use shared_model::vehicle::{State, YAW_RATE};

/// Fewest segments for a standard error.
const MIN_SEGMENTS: usize = 16;
/// Where the yaw rate has no maxima (at rest), segments of equal time.
const SEGMENTS_AT_REST: usize = 64;
/// Segments of equal time that a free-running motion is cut into.
pub(crate) const SEGMENTS: usize = 128;
/// A tangent vector is lost when orthogonalisation leaves less than this share of it: rounding
/// leaves 1e-16 of a vector that has no direction of its own, contraction within one step leaves
/// far more.
const LOST: f64 = 1e-12;
/// Correlation of neighbours up to which a sequence is prewhitened.
const GREATEST_CORRELATION: f64 = 0.97;
/// Time in which the tangent vector turns into the direction of fastest growth, as a share of the
/// motion.
pub(crate) const WARM_UP: f64 = 0.1;

/// A Lyapunov exponent with its statistical error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponent {
    /// Mean growth rate, 1/s.
    pub per_s: f64,
    /// Standard error, 1/s; it takes the correlation of successive segments of the motion into
    /// account.
    pub standard_error_per_s: f64,
    /// The least rate that the motion's length can tell from zero, 1/s: the most that the vector
    /// stretches beyond the mean within one cycle, and at least one e-fold, over the whole
    /// length.
    pub resolution_per_s: f64,
    /// Length of the motion that it is taken over, s.
    pub duration_s: f64,
}

impl Exponent {
    /// The exponent from the stretching (a logarithm) and the length (s) of successive segments.
    pub(crate) fn from_segments(segments: &[(f64, f64)]) -> Self {
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

/// Largest exponent of a motion that was found over `time_s`, given the maxima of its yaw rate
/// (time in s, and height). `None` if it is not finite.
///
/// The motion is cut at the maxima, as in [`largest`]; where they are too few, or the growth is not
/// known there, into segments of equal time.
pub(crate) fn largest_of<const K: usize>(
    found: &Trajectory<K>,
    maxima: &[(f64, f64)],
    time_s: f64,
) -> Option<Exponent> {
    let growth_at = |time_s: f64| {
        let turns = &found.turns[YAW_RATE];
        let turn = turns.binary_search_by(|turn| turn.0.total_cmp(&time_s));
        found.log_stretching_at_turns.get(turn.ok()?).copied()
    };
    let cut = |&(time_s, _): &(f64, f64)| Some((growth_at(time_s)?, time_s));
    let behind = maxima.iter().filter(|turn| turn.0 > WARM_UP * time_s);
    let cuts: Vec<_> = behind.filter_map(cut).collect();
    if cuts.len() <= MIN_SEGMENTS {
        let spectrum = Segments::of(found, time_s).spectrum();
        return spectrum.first().copied().flatten();
    }
    let segment = |ends: &[(f64, f64)]| (ends[1].0 - ends[0].0, ends[1].1 - ends[0].1);
    let segments: Vec<_> = cuts.windows(2).map(segment).collect();
    let exponent = Exponent::from_segments(&segments);
    exponent.per_s.is_finite().then_some(exponent)
}

/// Variance of the sum of a correlated sequence of mean zero: prewhitened by a first-order
/// autoregression, then with Bartlett weights. D. W. K. Andrews, J. C. Monahan, Econometrica 60 (1992)
/// 953. The greater of two, with as many lags as the root of the length and as its power 2/3: the first
/// misses the laminar phases of intermittent chaos, the second scatters more.
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

/// K exponents of a free-running motion, in descending order. `None` stands for minus infinity.
pub type Spectrum<const K: usize> = [Option<Exponent>; K];

/// Stretching of tangent vectors, as logarithms, over successive segments of equal time; minus
/// infinity stands for a length that has become zero.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Segments<const K: usize> {
    /// Of `K` lengths in each segment.
    pub log_stretching: Vec<[f64; K]>,
    /// Length of a segment, s.
    pub length_s: f64,
}

impl<const K: usize> Segments<K> {
    /// Of a motion that the engine has followed for `time_s`.
    pub fn of(found: &Trajectory<K>, time_s: f64) -> Self {
        Self {
            log_stretching: found.log_stretching.clone(),
            length_s: (1.0 - WARM_UP) * time_s / SEGMENTS as f64,
        }
    }

    /// The exponents.
    pub fn spectrum(&self) -> Spectrum<K> {
        std::array::from_fn(|k| {
            let segment = |log_stretching: &[f64; K]| (log_stretching[k], self.length_s);
            let segments: Vec<_> = self.log_stretching.iter().map(segment).collect();
            let finite = segments.iter().all(|&(growth, _)| growth.is_finite());
            finite.then(|| Exponent::from_segments(&segments))
        })
    }
}

/// The K largest Lyapunov exponents of the motion from `start` over `time_s`; K = 1 gives the
/// largest, K = N the spectrum.
///
/// K tangent vectors go along in dual numbers and are brought back to right angles and length one
/// behind every step (Gram-Schmidt, modified); the logarithms of the lengths that this takes away
/// add up to the exponents. G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15
/// (1980) 9 and 21; I. Shimada, T. Nagashima, Progress of Theoretical Physics 61 (1979) 1605. The
/// first tenth of the time is not counted: the vectors turn into their directions.
///
/// Where the steering sticks, the linearised step maps all vectors into the hyperplane of steering
/// rate zero and one of them has no length left. That is exact: the volume of the frame is zero
/// from then on, and the last exponent is minus infinity (`None`). The vector stays zero. The
/// others do not depend on it, so nothing is seeded anew and all time counts for them.
///
/// # Errors
/// If the motion diverges, or is too short.
///
/// ```
/// use dynamics::flow::Flow;
/// use nalgebra::{SVector, Vector1};
/// use shared_model::Real;
///
/// /// x' = 4 x (1 - x), whose exponent is ln 2 per step.
/// struct Logistic;
///
/// impl Flow<1> for Logistic {
///     fn step<T: Real>(&self, x: &SVector<T, 1>) -> SVector<T, 1> {
///         Vector1::new(T::from_f64(4.0) * x[0] * (T::one() - x[0]))
///     }
///
///     fn step_s(&self) -> f64 {
///         1.0
///     }
/// }
///
/// let [exponent] = dynamics::lyapunov::exponents(&Logistic, &Vector1::new(0.3), 20_000.0)?;
/// let exponent = exponent.unwrap();
/// assert!((exponent.per_s - 2_f64.ln()).abs() < 0.02);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn exponents<const N: usize, const K: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    time_s: f64,
) -> Result<Spectrum<K>, Unmeasured> {
    Ok(log_stretching(flow, start, time_s)?.spectrum())
}

/// What [`exponents`] are taken from.
pub(crate) fn log_stretching<const N: usize, const K: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    time_s: f64,
) -> Result<Segments<K>, Unmeasured> {
    let mut x = *start;
    // Linearly independent, and none along an axis, which may be invariant.
    let mut frame = SMatrix::<f64, N, K>::from_element(0.5) + SMatrix::<f64, N, K>::identity();
    orthonormalise(&mut frame);
    let mut done = 0;
    over_segments(flow, time_s, |steps| {
        let mut growth = [0.0; K];
        for _ in 0..steps {
            let dual = SVector::<Dual<K>, N>::from_fn(|i, _| {
                Dual::new(x[i], std::array::from_fn(|k| frame[(i, k)]))
            });
            let next = flow.step(&dual);
            x = next.map(|component| component.value);
            frame = SMatrix::from_fn(|i, k| next[i].tangent[k]);
            let lengths = orthonormalise(&mut frame);
            for (growth, length) in growth.iter_mut().zip(lengths) {
                *growth += length.ln();
            }
        }
        done += steps;
        check(flow, start, &x, done)?;
        Ok(growth)
    })
}

/// Brings the columns to right angles and length one; what their lengths were. A column without a
/// direction of its own becomes zero.
fn orthonormalise<const N: usize, const K: usize>(frame: &mut SMatrix<f64, N, K>) -> [f64; K] {
    let length = |v: &SVector<f64, N>| v.dot(v).sqrt();
    std::array::from_fn(|k| {
        let mut column: SVector<f64, N> = frame.column(k).into_owned();
        let before = length(&column);
        for earlier in 0..k {
            let direction = frame.column(earlier).into_owned();
            column -= direction * direction.dot(&column);
        }
        let after = length(&column);
        let lost = after <= LOST * before;
        frame.set_column(
            k,
            &if lost {
                SVector::zeros()
            } else {
                column / after
            },
        );
        if lost { 0.0 } else { after }
    })
}

/// The stretching of K vectors, as logarithms, after the warm-up. `growth` advances by the given
/// number of steps.
pub(crate) fn over_segments<const N: usize, const K: usize>(
    flow: &impl Flow<N>,
    time_s: f64,
    mut growth: impl FnMut(usize) -> Result<[f64; K], Unmeasured>,
) -> Result<Segments<K>, Unmeasured> {
    let steps = steps(flow, time_s);
    let warm_up = (steps as f64 * WARM_UP).ceil() as usize;
    let segment = (steps - warm_up.min(steps)) / SEGMENTS;
    if segment == 0 {
        let least_s = (SEGMENTS as f64 / (1.0 - WARM_UP)).ceil() * flow.step_s();
        return Err(Unmeasured::TooShort { time_s, least_s });
    }
    growth(warm_up)?;
    let log_stretching = (0..SEGMENTS)
        .map(|_| growth(segment))
        .collect::<Result<_, _>>()?;
    Ok(Segments {
        log_stretching,
        length_s: segment as f64 * flow.step_s(),
    })
}
