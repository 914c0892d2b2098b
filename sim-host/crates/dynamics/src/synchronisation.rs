//! Largest Lyapunov exponent by synchronisation, the paper's method, equations (15)-(19).
//!
//! A. Stefanski, Chaos, Solitons and Fractals 11 (2000) 2443. A response y' = f(y) + d (x - y) is
//! coupled to the drive x' = f(x). For a small distance e = y - x this is e' = (Df(x) - d) e. The
//! coupling pulls equally in all directions, so it commutes with Df and e(t) = exp(-d t) Phi(t)
//! e(0), where Phi is the drive's own tangent map: the distance grows at the rate of the largest
//! exponent less d. The least d at which it decays is the exponent (19). This holds across friction
//! events too, where Phi jumps.
//!
//! By the same splitting one step of the coupled pair is one step of the response alone, and then
//! y = x + (y - x) exp(-d h), which is exact for the coupling.

use crate::flow::{Flow, Unmeasured, VehicleFlow, check, steps};
use measures::exponent::{Exponent, WARM_UP};
use nalgebra::{SVector, Vector2, Vector4};
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{STEERING_ANGLE, STEERING_RATE};

/// Starts from which the search is repeated.
const STARTS: usize = 32;
/// A finer bisection would only look at rounding, 1/s.
const LEAST_TOLERANCE_PER_S: f64 = 1e-9;
/// Distance at which the response begins, and begins anew.
const DISTANCE: f64 = 1e-8;
/// It begins anew when it is nearer than this, or further than the other: still where e' = (Df - d)
/// e holds, and well above rounding.
const NEAR: f64 = 1e-11;
const FAR: f64 = 1e-5;

/// Where the least synchronising coupling is searched for, and how closely.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Search {
    /// Lower end of the interval, 1/s. A negative coupling drives the motions apart and finds
    /// negative exponents.
    pub from_per_s: f64,
    /// Upper end of the interval, 1/s.
    pub to_per_s: f64,
    /// Width at which the bisection ends, 1/s.
    pub tolerance_per_s: f64,
}

/// A search that cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "search for a coupling from {} to {} 1/s to a tolerance of {} 1/s: the ends must rise, the tolerance be from {} 1/s to the interval's width",
    .0.from_per_s, .0.to_per_s, .0.tolerance_per_s, LEAST_TOLERANCE_PER_S
)]
pub struct InvalidSearch(Search);

impl Search {
    /// The search itself, if it can be made.
    ///
    /// # Errors
    /// If the interval is empty, reversed or not finite, or the tolerance is too small or wider
    /// than the interval.
    pub fn validated(self) -> Result<Self, InvalidSearch> {
        let width = self.to_per_s - self.from_per_s;
        let possible = width.is_finite()
            && width > 0.0
            && (LEAST_TOLERANCE_PER_S..=width).contains(&self.tolerance_per_s);
        possible.then_some(self).ok_or(InvalidSearch(self))
    }

    /// Couplings that a bisection judges: both ends, and one for each halving.
    pub(crate) fn couplings_tried(&self) -> u32 {
        let width = self.to_per_s - self.from_per_s;
        2 + (width / self.tolerance_per_s).log2().ceil() as u32
    }
}

impl Default for Search {
    /// From -5 to 10 1/s, to 1e-3 1/s.
    fn default() -> Self {
        Self {
            from_per_s: -5.0,
            to_per_s: 10.0,
            tolerance_per_s: 1e-3,
        }
    }
}

/// The least synchronising coupling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// Mean over the starts, with its standard error.
    pub exponent: Exponent,
    /// Width of the interval that each start's search ended with, 1/s: beyond the standard error,
    /// the result is not known better.
    pub tolerance_per_s: f64,
}

impl Threshold {
    /// Standard error and tolerance together, 1/s.
    pub fn error_per_s(&self) -> f64 {
        self.exponent
            .standard_error_per_s
            .hypot(self.tolerance_per_s)
    }
}

/// Why there is no threshold.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoThreshold {
    /// The motion cannot be measured.
    #[error(transparent)]
    Unmeasured(#[from] Unmeasured),
    /// Not even the strongest coupling of the interval synchronises.
    #[error("untested: no coupling from {} to {} 1/s synchronises", .0.from_per_s, .0.to_per_s)]
    NoneSynchronises(Search),
    /// Even the weakest coupling of the interval synchronises.
    #[error("untested: every coupling from {} to {} 1/s synchronises", .0.from_per_s, .0.to_per_s)]
    AllSynchronise(Search),
}

/// Largest Lyapunov exponent of the motion from `start` over `time_s`: the least coupling at which
/// the response (17) follows the drive, by bisection, separately from 32 starts along the motion.
///
/// Each coupling is judged by whether the distance grows or decays on the whole over a
/// thirty-second of the time. The distance begins anew at 1e-8 whenever it leaves 1e-11 to 1e-5,
/// and what it had grown counts: so neither a burst nor rounding decides. The response begins on
/// the side of the drive on which it was at the end of the start before (which side does not depend
/// on the coupling), and for the first start after a tenth of the time that is not counted.
///
/// # Errors
/// If the motion diverges or is too short, or if the interval does not hold the threshold.
///
/// ```
/// use dynamics::synchronisation::{Search, largest};
/// use dynamics::flow::Flow;
/// use nalgebra::Vector1;
/// use shared_model::Real;
///
/// /// x' = -x: two trajectories approach each other at 1 1/s.
/// struct Decay;
///
/// impl Flow<1> for Decay {
///     fn step<T: Real>(&self, x: &Vector1<T>) -> Vector1<T> {
///         x * T::from_f64((-self.step_s()).exp())
///     }
///     fn step_s(&self) -> f64 {
///         1e-2
///     }
/// }
///
/// let threshold = largest(&Decay, &Vector1::new(0.1), 100.0, Search::default())?;
/// assert!((threshold.exponent.per_s + 1.0).abs() <= threshold.tolerance_per_s);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn largest<const N: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    time_s: f64,
    search: Search,
) -> Result<Threshold, NoThreshold> {
    least_coupling(flow, |_, _, y| flow.step(y), start, time_s, search)
}

/// The least coupling at which the response of equation (20), as printed, follows the drive. It is
/// **not** the largest Lyapunov exponent.
///
/// (20) feeds the response from the drive in two places: y3' takes x4 for y4, and y4' keeps the
/// drive's friction and aligning torque. Then e3' = -d e3 and e4' = -(b/J + d) e4 whatever the
/// motion does, and the sideslip angle and the yaw rate follow a steering angle that is given to
/// them. The threshold is the larger of zero and the conditional exponent of (beta, gamma), that of
/// the pair driven by the steering angle (L. M. Pecora, T. L. Carroll, Physical Review Letters 64
/// (1990) 821). It can be positive on a periodic motion: the steering, left out, is what holds that
/// motion together.
///
/// # Errors
/// As [`largest`].
pub fn literal(
    flow: &VehicleFlow,
    start: &Vector4<f64>,
    time_s: f64,
    search: Search,
) -> Result<Threshold, NoThreshold> {
    least_coupling(
        flow,
        |x, next, y| literal_response(flow, x, next, y),
        start,
        time_s,
        search,
    )
}

/// One step of (20)'s response without the terms in d: y3 and y4 in closed form, (y1, y2) by
/// Runge-Kutta of fourth order.
fn literal_response(
    flow: &VehicleFlow,
    x: &Vector4<f64>,
    next: &Vector4<f64>,
    y: &Vector4<f64>,
) -> Vector4<f64> {
    let h = flow.step_s();
    let e = y - x;
    // The drive's steering angle half-way, by Hermite's cubic through both ends and their slopes.
    let middle = 0.5 * (x[STEERING_ANGLE] + next[STEERING_ANGLE])
        + 0.125 * h * (x[STEERING_RATE] - next[STEERING_RATE]);
    let slope = |y: Vector2<f64>, steering_angle: f64| {
        let state = Vector4::new(y[0], y[1], steering_angle + e[2], 0.0);
        // Sideslip and yaw do not feel the steering's friction.
        let derivative = flow
            .model()
            .derivative(&state, flow.injection(), FrictionMode::Neutral);
        Vector2::new(derivative[0], derivative[1])
    };
    let y12 = Vector2::new(y[0], y[1]);
    let k1 = slope(y12, x[STEERING_ANGLE]);
    let k2 = slope(y12 + k1 * (0.5 * h), middle);
    let k3 = slope(y12 + k2 * (0.5 * h), middle);
    let k4 = slope(y12 + k3 * h, next[STEERING_ANGLE]);
    let y12 = y12 + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
    let decay = (-flow.steering_damping_per_s() * h).exp();
    Vector4::new(y12[0], y12[1], next[2] + e[2], next[3] + e[3] * decay)
}

/// The search over a response that makes one step without coupling from (drive, next drive,
/// response).
fn least_coupling<const N: usize>(
    flow: &impl Flow<N>,
    respond: impl Fn(&SVector<f64, N>, &SVector<f64, N>, &SVector<f64, N>) -> SVector<f64, N>,
    start: &SVector<f64, N>,
    time_s: f64,
    search: Search,
) -> Result<Threshold, NoThreshold> {
    let steps = steps(flow, time_s);
    let warm_up = (steps as f64 * WARM_UP).ceil() as usize;
    let each = (steps - warm_up.min(steps)) / STARTS;
    if each == 0 {
        let least_s = (STARTS as f64 / (1.0 - WARM_UP)).ceil() * flow.step_s();
        return Err(Unmeasured::TooShort { time_s, least_s }.into());
    }
    let mut done = 0;
    let mut drive_on = |from: SVector<f64, N>, steps: usize| {
        let mut drive = vec![from];
        for k in 0..steps {
            drive.push(flow.step(&drive[k]));
            check(flow, start, &drive[k + 1], done + k + 1)?;
        }
        done += steps;
        Ok::<_, Unmeasured>(drive)
    };
    let mut drive = drive_on(*start, warm_up)?;
    let side = SVector::repeat(1.0 / (N as f64).sqrt());
    let (_, mut side) = growth(&drive, &respond, 1.0, side);
    let length_s = each as f64 * flow.step_s();
    let mut pieces = Vec::with_capacity(STARTS);
    for _ in 0..STARTS {
        drive = drive_on(drive[drive.len() - 1], each)?;
        let mut end = side;
        let least = bisect(search, |coupling| {
            let (growth, side_at_end) =
                growth(&drive, &respond, (-coupling * flow.step_s()).exp(), side);
            end = side_at_end;
            growth < 0.0
        })?;
        side = end;
        pieces.push((least * length_s, length_s));
    }
    Ok(Threshold {
        exponent: Exponent::from_segments(&pieces),
        tolerance_per_s: search.tolerance_per_s,
    })
}

/// Growth of the logarithm of the response's distance from the drive, each step's distance being
/// multiplied by `pull`, and the side on which the response is at the end, as it was given for the
/// beginning: a vector of length one.
fn growth<const N: usize>(
    drive: &[SVector<f64, N>],
    respond: &impl Fn(&SVector<f64, N>, &SVector<f64, N>, &SVector<f64, N>) -> SVector<f64, N>,
    pull: f64,
    side: SVector<f64, N>,
) -> (f64, SVector<f64, N>) {
    let mut e = side * DISTANCE;
    let mut distance = DISTANCE;
    let mut grown = 0.0;
    for x in drive.windows(2) {
        e = (respond(&x[0], &x[1], &(x[0] + e)) - x[1]) * pull;
        distance = e.dot(&e).sqrt();
        if distance == 0.0 {
            return (f64::NEG_INFINITY, side);
        }
        if !(NEAR..FAR).contains(&distance) {
            grown += (distance / DISTANCE).ln();
            e *= DISTANCE / distance;
            distance = DISTANCE;
        }
    }
    (grown + (distance / DISTANCE).ln(), e / distance)
}

/// The coupling from which on the response follows: middle of the interval that bisection ends
/// with.
fn bisect(search: Search, mut follows: impl FnMut(f64) -> bool) -> Result<f64, NoThreshold> {
    let (mut below, mut above) = (search.from_per_s, search.to_per_s);
    if !follows(above) {
        return Err(NoThreshold::NoneSynchronises(search));
    }
    if follows(below) {
        return Err(NoThreshold::AllSynchronise(search));
    }
    while above - below > search.tolerance_per_s {
        let middle = 0.5 * (below + above);
        if middle <= below || middle >= above {
            // Rounding leaves nothing between them.
            break;
        }
        if follows(middle) {
            above = middle;
        } else {
            below = middle;
        }
    }
    Ok(0.5 * (below + above))
}
