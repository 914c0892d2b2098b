//! Equivalence of firmware and host, on four levels.
//!
//! Two correct simulations of a chaotic system diverge, so a single tolerance over a whole run is
//! not a valid test.
//! 1. *Bits*: the host's f32 run equals the firmware's in every state word and every duty code.
//! 2. *One step*: from each of the firmware's states, the host's f64 step agrees within the
//!    rounding of f32.
//! 3. *Horizon*: free f32 and f64 runs diverge at the time predicted from the Lyapunov exponent; on
//!    a periodic orbit they do not.
//! 4. *Invariants*: exponent, period, bounds and Poincaré set agree within their statistical
//!    errors.

use dynamics::lyapunov::Exponent;
use dynamics::period::yaw_rate_maxima;
use dynamics::trace::Trace;
use engine::rounding::Rounded;
use qemu::telemetry::Recording;
use shared_model::open_loop::OpenLoop;
use shared_model::vehicle::{State, YAW_RATE};
use shared_model::{InvalidScenario, Real, Scenario};

/// Distance at which free runs have diverged, relative to the attractor's size.
pub const PARTED: f64 = 0.1;

/// Level 1: the number of words compared and of differences.
#[derive(Debug, Clone, PartialEq)]
pub struct Bits {
    /// State words, friction modes and duty codes compared.
    pub compared: usize,
    /// The number of differences; a missing word counts as a difference.
    pub differing: usize,
    /// The first difference.
    pub first: Option<String>,
}

/// Compares every state word, friction mode and duty code of two f32 runs. NaN equals NaN, because
/// its sign depends on the machine.
pub fn bits(firmware: &Trace, host: &Trace) -> Bits {
    let mut bits = Bits {
        compared: 0,
        differing: 0,
        first: None,
    };
    bits.state(0, &firmware.initial, &host.initial);
    for (k, (a, b)) in firmware.states.iter().zip(&host.states).enumerate() {
        bits.state(k + 1, a, b);
    }
    for (n, (a, b)) in firmware.duties.iter().zip(&host.duties).enumerate() {
        bits.word(a == b, || format!("duty code {n}: firmware {a}, host {b}"));
    }
    bits.length("states", firmware.states.len(), host.states.len());
    bits.length("duty codes", firmware.duties.len(), host.duties.len());
    bits
}

impl Bits {
    fn word(&mut self, equal: bool, difference: impl FnOnce() -> String) {
        self.compared += 1;
        if !equal {
            self.differing += 1;
            self.first.get_or_insert_with(difference);
        }
    }

    fn state(&mut self, step: usize, firmware: &State<f64>, host: &State<f64>) {
        for (i, (&a, &b)) in firmware.x.iter().zip(host.x.iter()).enumerate() {
            let (a, b) = ((a as f32).to_bits(), (b as f32).to_bits());
            let both_nan = f32::from_bits(a).is_nan() && f32::from_bits(b).is_nan();
            self.word(a == b || both_nan, || {
                format!("component {i} after step {step}: firmware {a:#010x}, host {b:#010x}")
            });
        }
        let (a, b) = (firmware.friction, host.friction);
        self.word(a == b, || {
            format!("friction mode after step {step}: firmware {a:?}, host {b:?}")
        });
    }

    fn length(&mut self, what: &str, firmware: usize, host: usize) {
        let missing = firmware.abs_diff(host);
        self.differing += missing;
        if missing > 0 {
            let difference = format!("{firmware} {what} of the firmware, {host} of the host");
            self.first.get_or_insert(difference);
        }
    }
}

/// Level 2: the defect of every step.
#[derive(Debug, Clone)]
pub struct OneStep {
    /// For each step, the time (s) and the ratio of defect to bound, the greatest of the four
    /// components.
    pub ratios: Vec<(f64, f64)>,
    /// Root mean square of the defects, each relative to the component's range in the run.
    pub relative_rms: f64,
}

impl OneStep {
    /// The greatest ratio of defect to bound.
    pub fn worst(&self) -> f64 {
        self.ratios
            .iter()
            .map(|&(_, ratio)| ratio)
            .fold(0.0, nan_max)
    }
}

/// As `f64::max`, but propagates NaN.
fn nan_max(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}

/// Computes one step in f64 from each of the firmware's states, with a bound on the rounding of the
/// same step in f32.
///
/// # Errors
/// If the scenario is invalid.
pub fn one_step(scenario: &Scenario<f64>, firmware: &Trace) -> Result<OneStep, InvalidScenario> {
    let mut ecu = OpenLoop::new(&scenario.map(&Rounded::from_f64))?;
    let sizes = sizes(firmware);
    let mut ratios = Vec::with_capacity(firmware.states.len());
    let mut squares = 0.0;
    for (k, (start, end)) in firmware.starts().zip(&firmware.states).enumerate() {
        ecu.control
            .set_state(start.map(|value| Rounded::exact(value as f32)));
        let step = ecu.step(|_| {});
        let mut worst = 0.0;
        for ((end, step), size) in end.x.iter().zip(step.x.iter()).zip(sizes) {
            let defect = (end - step.value).abs();
            let ratio = if defect == 0.0 {
                0.0
            } else {
                defect / step.error
            };
            worst = nan_max(worst, ratio);
            squares += (defect / size).powi(2);
        }
        ratios.push((firmware.time_s(k), worst));
    }
    Ok(OneStep {
        relative_rms: (squares / ratios.len() as f64).sqrt(),
        ratios,
    })
}

/// Range of each component over a run.
fn sizes(trace: &Trace) -> [f64; 4] {
    std::array::from_fn(|i| {
        let (low, high) = trace.range(i, 0);
        high - low
    })
}

/// Level 3: distance of two free runs over time (s), the greatest of the components relative to
/// their ranges.
pub fn divergence(a: &Trace, b: &Trace) -> Vec<(f64, f64)> {
    let sizes = sizes(a);
    let distance = |(k, (p, q)): (usize, (&State<f64>, &State<f64>))| {
        let apart = (0..4).map(|i| (p.x[i] - q.x[i]).abs() / sizes[i]);
        (a.time_s(k), apart.fold(0.0, nan_max))
    };
    a.states
        .iter()
        .zip(&b.states)
        .enumerate()
        .map(distance)
        .collect()
}

/// The time (s) at which runs diverge: the first at which the geometric mean of their distance over
/// a cycle of `cycle_s` exceeds [`PARTED`]. Within a cycle the distance varies by some e-folds,
/// which the exponent does not describe.
pub fn parted_at_s(divergence: &[(f64, f64)], cycle_s: f64) -> Option<f64> {
    let step_s = divergence.first()?.0;
    let cycle = (cycle_s / step_s).round().max(1.0) as usize;
    // Equal runs have distance 0, whose logarithm is not finite.
    let logarithm = |&(_, distance): &(f64, f64)| distance.max(f64::MIN_POSITIVE).ln();
    let limit = cycle as f64 * PARTED.ln();
    let mut sum = 0.0;
    for (k, point) in divergence.iter().enumerate() {
        if point.1.is_nan() {
            return Some(point.0);
        }
        sum += logarithm(point);
        if k >= cycle {
            sum -= logarithm(&divergence[k - cycle]);
            if sum > limit {
                return Some(point.0 - 0.5 * cycle_s);
            }
        }
    }
    None
}

/// Predicted time at which free f32 and f64 runs diverge: least, expected and greatest, s.
///
/// Each step adds an error of relative size e in a random direction, and errors grow with the
/// exponent L. After about 1/L seconds the sum has the size e/sqrt(2 L h) times exp(L t), where h
/// is the step. Over a time T the logarithm of the growth scatters by sqrt(D T), with D = (standard
/// error)^2 times the length of the trajectory of the exponent. The interval is that of
/// three standard deviations: it ends where the growth, faster or slower by three deviations,
/// reaches [`PARTED`].
pub fn horizon_s(exponent: &Exponent, relative_rms: f64, step_s: f64) -> [f64; 3] {
    let rate = exponent.per_s;
    let start = relative_rms / (2.0 * rate * step_s).sqrt();
    let growth = (PARTED / start).ln();
    let scatter = exponent.standard_error_per_s * exponent.duration_s.sqrt();
    // rate T + z scatter sqrt(T) = growth, a quadratic in sqrt(T).
    [3.0, 0.0, -3.0].map(|z: f64| {
        let half = z * scatter / (2.0 * rate);
        ((half * half + growth / rate).sqrt() - half).powi(2)
    })
}

/// Level 4: distance of the yaw rate's extremes in the firmware's run from those of equally long
/// segments of the host's long run, relative to the tolerance: four standard deviations of the
/// segments, plus 1e-4 of the range for rounding.
pub fn bounds_distance(firmware: &Trace, from: usize, host: &Trace, host_from: usize) -> f64 {
    let length = firmware.states.len() - from;
    let (low, high) = host.range(YAW_RATE, host_from);
    let gamma: Vec<f64> = host.component(YAW_RATE).skip(host_from).collect();
    let extremes = |pick: fn(f64, f64) -> f64, start: f64| -> Vec<f64> {
        let segments = gamma.chunks_exact(length);
        segments
            .map(|segment| segment.iter().copied().fold(start, pick))
            .collect()
    };
    let (own_low, own_high) = firmware.range(YAW_RATE, from);
    let lows = distance(own_low, &extremes(f64::min, f64::INFINITY), high - low);
    let highs = distance(own_high, &extremes(f64::max, f64::NEG_INFINITY), high - low);
    nan_max(lows, highs)
}

fn distance(value: f64, sample: &[f64], range: f64) -> f64 {
    let n = sample.len() as f64;
    let mean = sample.iter().sum::<f64>() / n;
    let variance = sample.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (value - mean).abs() / (4.0 * variance.sqrt() + 1e-4 * range)
}

/// Level 4: distance of the distributions of the yaw rate's maxima (two-sample Kolmogorov-Smirnov
/// statistic), and its critical value at a significance of 0.1 %. For chaotic trajectories, whose
/// maxima are almost independent.
pub fn poincare_distance(
    firmware: &Trace,
    from: usize,
    host: &Trace,
    host_from: usize,
) -> (f64, f64) {
    let heights = |trace, from| {
        let mut heights: Vec<f64> = yaw_rate_maxima(trace, from)
            .iter()
            .map(|&(_, h)| h)
            .collect();
        heights.sort_by(f64::total_cmp);
        heights
    };
    let (a, b) = (heights(firmware, from), heights(host, host_from));
    let below =
        |sample: &[f64], x: f64| sample.partition_point(|&h| h <= x) as f64 / sample.len() as f64;
    let apart = a
        .iter()
        .chain(&b)
        .map(|&x| (below(&a, x) - below(&b, x)).abs());
    let (n, m) = (a.len() as f64, b.len() as f64);
    (apart.fold(0.0, nan_max), 1.949 * ((n + m) / (n * m)).sqrt())
}

/// Level 4: the greatest distance of a maximum of the firmware's yaw rate from the nearest of the
/// host's, relative to the yaw rate's range. For periodic orbits, whose maxima are a few points.
pub fn poincare_points_distance(
    firmware: &Trace,
    from: usize,
    host: &Trace,
    host_from: usize,
) -> f64 {
    let (low, high) = host.range(YAW_RATE, host_from);
    let host = yaw_rate_maxima(host, host_from);
    let nearest = |height: f64| {
        let apart = host.iter().map(|&(_, h)| (h - height).abs());
        apart.fold(f64::INFINITY, f64::min)
    };
    let own = yaw_rate_maxima(firmware, from);
    own.iter()
        .map(|&(_, height)| nearest(height))
        .fold(0.0, nan_max)
        / (high - low)
}

/// The trajectory in a recording.
pub fn trace_of(recording: &Recording) -> Trace {
    let samples_per_step = usize::from(recording.header.samples_per_step);
    let states = recording
        .records
        .iter()
        .map(|record| record.state.map(Real::to_f64));
    Trace {
        step_s: 1.0 / f64::from(recording.header.step_rate_hz),
        initial: recording.header.initial.map(Real::to_f64),
        states: states.collect(),
        duties: recording.duties.clone(),
        samples_per_step,
        pwm_period: recording.header.pwm_period,
    }
}
