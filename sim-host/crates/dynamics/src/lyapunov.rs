//! Lyapunov exponents by tangent dynamics.
//!
//! A tangent vector is carried along a motion by the linearised step (dual numbers through the
//! integrator itself, so with the right jumps at friction events; stick takes one dimension away),
//! and the mean rate of its growth is the largest exponent. [`largest`] takes any recorded motion:
//! the firmware's own telemetry will do. [`exponents`] runs freely along a [`Flow`] with as many
//! vectors as exponents are wanted, kept at right angles. The engine's motions have tangent vectors
//! of their own; their stretching becomes exponents here too.

use crate::flow::{Flow, Unmeasured, check, steps};
use engine::dual::Dual;
use engine::taylor::Trajectory;
pub use measures::exponent::{Exponent, largest};
use measures::exponent::{MIN_SEGMENTS, WARM_UP};
use nalgebra::{SMatrix, SVector};
use shared_model::vehicle::YAW_RATE;

/// Segments of equal time that a free-running motion is cut into.
pub(crate) const SEGMENTS: usize = 128;
/// A tangent vector is lost when orthogonalisation leaves less than this share of it: rounding
/// leaves 1e-16 of a vector that has no direction of its own, contraction within one step leaves
/// far more.
const LOST: f64 = 1e-12;
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
