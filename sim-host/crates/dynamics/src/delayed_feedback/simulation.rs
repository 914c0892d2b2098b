//! A trajectory under a torque that is computed at each control tick.

use super::feedback::{Conditions, Feedback, LINE_VALUES};
use super::vehicle::{steps_per_tick, vehicle};
use crate::period::{RIPPLE_TOLERANCE, maxima_of_turns, period_of_maxima};
use engine::is_bounded;
use nalgebra::Vector4;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use shared_model::delayed_feedback::{DelayedFeedback, spacing_ticks};
use shared_model::vehicle::YAW_RATE;
use shared_model::{Scenario, integrate};
use std::collections::VecDeque;

/// Greatest torque of a trajectory that is held, N m; at most half of the limit.
const HELD_NM: f64 = 0.5;
/// Part of a simulation at its end from which the torque is taken, s.
const JUDGED_S: f64 = 60.0;
/// Seed of the sensor's noise.
const NOISE_SEED: u64 = 20_071;

/// A trajectory under feedback.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Held {
    /// Root mean square of the torque over the last minute, N m.
    pub torque_rms_nm: f64,
    /// Its greatest magnitude over the last minute, N m.
    pub torque_peak_nm: f64,
    /// Time from switching on until the torque stays below 0.5 N m and half of its limit, s; none if it does not, or
    /// the motion is not periodic.
    pub capture_s: Option<f64>,
    /// Maxima of the yaw rate in a cycle over the last minute; none if they do not repeat.
    pub maxima: Option<usize>,
    /// The delay at the end, s, if there is one.
    pub delay_s: Option<f64>,
    /// When the vehicle left all bounds, s; the rest is that up to there.
    pub diverges_at_s: Option<f64>,
    /// Least and greatest yaw rate over the last minute, rad/s; none if the vehicle left all bounds before.
    pub yaw_rates_rad_per_s: Option<(f64, f64)>,
}

/// The trajectory of a vehicle under its averaged dither. The feedback is computed at the control rate and
/// switched on after a while; its torque is held over a control tick.
pub fn simulate(plant: &Scenario<f64>, feedback: &Feedback, conditions: &Conditions) -> Held {
    let tick_s = 1.0 / plant.run.control_rate_hz;
    let spacing = spacing_ticks(plant.run.control_rate_hz as u32);
    let mut law = DelayedFeedback::<f64, LINE_VALUES>::new(feedback.law(), spacing);
    let mut noise = Noise::new(conditions.noise);
    let mut was_on = false;
    let mut torque_nm = |x: &Vector4<f64>, is_on: bool| {
        if is_on && !was_on {
            // The line is full; what it has adapted to in chaos is none of the orbit's.
            law.restart();
        }
        was_on = is_on;
        let signal = feedback.signal(x) + noise.next();
        law.run(signal, feedback.gain, feedback.delay_s / tick_s)
    };
    let delayed_by = (feedback.latency_ticks, feedback.limit_nm);
    let held = run(plant, conditions, delayed_by, &mut torque_nm);
    Held {
        delay_s: Some(feedback.delay_s + law.adapted_ticks() * tick_s),
        ..held
    }
}

/// The trajectory under the torque that `torque_nm` computes from the state at each control tick; it is applied after
/// the latency, in ticks, and where the second argument is true. `limit_nm` is its greatest.
pub(super) fn run(
    plant: &Scenario<f64>,
    conditions: &Conditions,
    (latency_ticks, limit_nm): (usize, f64),
    torque_nm: &mut impl FnMut(&Vector4<f64>, bool) -> f64,
) -> Held {
    let rate_hz = plant.run.control_rate_hz;
    let tick_s = 1.0 / rate_hz;
    let steps = steps_per_tick(plant);
    let step_s = tick_s / f64::from(steps);
    let (mut model, constant_nm, injection) = vehicle(plant);
    let mut state = model.initial_state(plant);
    let mut torques_nm: VecDeque<f64> = std::iter::repeat_n(0.0, latency_ticks).collect();
    let ticks = |time_s: f64| (time_s * rate_hz) as u64;
    let free = ticks(conditions.free_s);
    let all = free + ticks(conditions.time_s);
    let judged = all.saturating_sub(ticks(JUDGED_S));
    let held_nm = HELD_NM.min(0.5 * limit_nm);
    let (mut squares, mut peak_nm, mut last_great) = (0.0, 0.0_f64, free);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut diverges_at_s = None;
    let mut turns = Vec::new();
    let mut last = (state.x[YAW_RATE], 0.0);
    for tick in 0..all {
        interrupt::check();
        let is_on = tick >= free;
        let wanted_nm = torque_nm(&state.x, is_on);
        torques_nm.push_back(if is_on { wanted_nm } else { 0.0 });
        let torque_nm = torques_nm.pop_front().unwrap_or(0.0);
        model.set_motor_torque_nm(constant_nm + torque_nm);
        for _ in 0..steps {
            integrate::step(&model, &mut state, step_s, injection);
        }
        if !is_bounded(&state.x) {
            diverges_at_s = Some((tick + 1) as f64 * tick_s);
            break;
        }
        if torque_nm.abs() > held_nm {
            last_great = tick;
        }
        if tick >= judged {
            squares += torque_nm * torque_nm;
            peak_nm = peak_nm.max(torque_nm.abs());
            low = low.min(state.x[YAW_RATE]);
            high = high.max(state.x[YAW_RATE]);
        }
        let change = state.x[YAW_RATE] - last.0;
        if tick > judged && change * last.1 < 0.0 {
            turns.push((tick as f64 * tick_s, last.0));
        }
        last = (state.x[YAW_RATE], change);
    }
    let range = high - low;
    let maxima = maxima_of_turns(&turns, range);
    // A noisy torque moves the maxima a little.
    let maxima = period_of_maxima(&maxima, range, RIPPLE_TOLERANCE).maxima();
    let is_captured = diverges_at_s.is_none() && maxima.is_some() && last_great < judged;
    Held {
        torque_rms_nm: (squares / (all - judged).max(1) as f64).sqrt(),
        torque_peak_nm: peak_nm,
        capture_s: is_captured.then(|| (last_great - free) as f64 * tick_s),
        maxima,
        delay_s: None,
        diverges_at_s,
        yaw_rates_rad_per_s: (low <= high).then_some((low, high)),
    }
}

/// Normal noise, the same in every run.
struct Noise {
    distribution: Option<Normal<f64>>,
    generator: Pcg64,
}

impl Noise {
    fn new(deviation: f64) -> Self {
        Self {
            distribution: Normal::new(0.0, deviation).ok().filter(|_| deviation > 0.0),
            generator: Pcg64::seed_from_u64(NOISE_SEED),
        }
    }

    fn next(&mut self) -> f64 {
        let drawn = |distribution: &Normal<f64>| distribution.sample(&mut self.generator);
        self.distribution.as_ref().map_or(0.0, drawn)
    }
}
