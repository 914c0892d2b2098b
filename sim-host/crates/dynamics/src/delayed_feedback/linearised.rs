//! The orbit linearised at each control tick, and its multipliers under a feedback.

use super::feedback::{Feedback, LONGEST_TICKS};
use super::orbit::orbit_of;
use super::vehicle::{steps_per_tick, vehicle};
use crate::settled::VehicleOrbit;
use crate::sweep::Values;
use engine::dual::Dual;
use nalgebra::{Matrix4, Vector4};
use shared_model::vehicle::State;
use shared_model::{Real, Scenario, integrate};
use std::collections::VecDeque;

/// Periods after which the greatest multiplier is taken, and over which.
const SETTLING_PERIODS: usize = 60;
const MEASURED_PERIODS: usize = 120;

/// An orbit of one cycle, linearised at each control tick.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Its period, s.
    pub period_s: f64,
    /// A state on it.
    pub(super) start: [f64; 4],
    /// Its multiplier of greatest modulus without feedback, beside 1.
    pub free_multiplier: f64,
    /// A whole number of ticks makes the period: about the control rate's.
    tick_s: f64,
    ticks: Vec<Tick>,
}

/// Derivatives of the state after a tick, by the state before and by the torque; and the rate of the state before.
#[derive(Debug, Clone)]
pub(super) struct Tick {
    pub(super) by_state: Matrix4<f64>,
    pub(super) by_torque: Vector4<f64>,
    pub(super) rate: Vector4<f64>,
}

impl Linearised {
    /// The orbit of one cycle nearest to the scenario's trajectory, stable or not; `None` if Newton's method
    /// finds none, or its period has too many ticks ([`LONGEST_TICKS`]).
    ///
    /// ```
    /// let scenario = shared_model::Scenario::reconstruction();
    /// let orbit = dynamics::delayed_feedback::Linearised::of(&scenario).unwrap();
    /// assert!((1.68..1.70).contains(&orbit.period_s));
    /// assert!(orbit.free_multiplier < -1.0);
    /// ```
    pub fn of(scenario: &Scenario<f64>) -> Option<Self> {
        Self::at(scenario, &orbit_of(scenario)?)
    }

    pub(super) fn at(scenario: &Scenario<f64>, orbit: &VehicleOrbit) -> Option<Self> {
        let (period_s, start) = (orbit.period_s, *orbit.start());
        let count = (period_s * scenario.run.control_rate_hz).round();
        if count < 1.0 || count > LONGEST_TICKS as f64 {
            return None;
        }
        let tick_s = period_s / count;
        let free_multiplier = orbit.multipliers.first()?;
        Some(Self {
            period_s,
            start: start.into(),
            free_multiplier: free_multiplier.norm().copysign(free_multiplier.re),
            tick_s,
            ticks: ticks(scenario, start, tick_s, count as usize),
        })
    }

    /// Length of a tick, s.
    pub(super) fn tick_s(&self) -> f64 {
        self.tick_s
    }

    /// The ticks of a period.
    pub(super) fn ticks(&self) -> &[Tick] {
        &self.ticks
    }

    /// The greatest modulus of a multiplier beside 1 under a feedback, by power iteration: the vehicle's state
    /// and the delay line, along the orbit. To first order in a delay unlike the period.
    pub fn greatest_multiplier(&self, feedback: &Feedback) -> f64 {
        let mut perturbed = Perturbation::new(self, feedback);
        let mut log_growth = 0.0;
        for period in 0..SETTLING_PERIODS + MEASURED_PERIODS {
            interrupt::check();
            for tick in &self.ticks {
                perturbed.step(tick, feedback);
            }
            perturbed.remove_shift(self, feedback);
            let log_size = perturbed.normalise();
            match log_size {
                // All of it is gone: as with the dead beat of a scalar system.
                f64::NEG_INFINITY => return 0.0,
                size if !size.is_finite() => return f64::INFINITY,
                _ => {}
            }
            if period >= SETTLING_PERIODS {
                log_growth += log_size;
            }
        }
        (log_growth / MEASURED_PERIODS as f64).exp()
    }

    /// The gain of those tried with the least multiplier, that multiplier, and the range of those around it with
    /// multipliers less than 1.
    pub fn best_gain(&self, feedback: &Feedback, gains: &Values) -> Best {
        let at = |gain: f64| self.greatest_multiplier(&Feedback { gain, ..*feedback });
        let tried: Vec<(f64, f64)> = gains.iter().map(|gain| (gain, at(gain))).collect();
        let least = (0..tried.len())
            .min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))
            .unwrap_or(0);
        let holds = |k: &usize| tried[*k].1 < 1.0;
        let first = (0..=least).rev().take_while(holds).last();
        let last = (least..tried.len()).take_while(holds).last();
        Best {
            gain: tried[least].0,
            multiplier: tried[least].1,
            holding: first
                .zip(last)
                .map(|(first, last)| (tried[first].0, tried[last].0)),
        }
    }
}

/// The best of the gains tried.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Best {
    /// The gain with the least multiplier.
    pub gain: f64,
    /// Its greatest multiplier.
    pub multiplier: f64,
    /// The gains around it, of those tried, that hold the orbit.
    pub holding: Option<(f64, f64)>,
}

fn ticks(scenario: &Scenario<f64>, start: Vector4<f64>, tick_s: f64, count: usize) -> Vec<Tick> {
    let (model, torque_nm, injection) = vehicle(scenario);
    let dual_injection = injection.map(Dual::constant);
    let mut dual = model.map(&Dual::<5>::constant);
    let mut torque = Dual::constant(torque_nm);
    torque.tangent[4] = 1.0;
    dual.set_motor_torque_nm(torque);
    let steps = steps_per_tick(scenario);
    let step_s = Dual::constant(tick_s / f64::from(steps));
    let mut state = model.state(start);
    let mut ticks = Vec::with_capacity(count);
    for _ in 0..count {
        interrupt::check();
        let mode = model.mode_at(&state.x, injection);
        let rate = model.derivative(&state.x, injection, mode);
        let mut after = State {
            x: Vector4::from_fn(|i, _| {
                let mut seeded = Dual::constant(state.x[i]);
                seeded.tangent[i] = 1.0;
                seeded
            }),
            friction: state.friction,
        };
        for _ in 0..steps {
            integrate::step(&dual, &mut after, step_s, dual_injection);
        }
        ticks.push(Tick {
            by_state: Matrix4::from_fn(|i, k| after.x[i].tangent[k]),
            by_torque: Vector4::from_fn(|i, _| after.x[i].tangent[4]),
            rate,
        });
        state = after.map(Real::to_f64);
    }
    ticks
}

/// A perturbation of the orbit: of the state, and of the values in the delay line.
struct Perturbation {
    state: Vector4<f64>,
    /// Of the line's values, the newest last.
    line: VecDeque<f64>,
    delay_ticks: f64,
    /// Torques on their way to the motor, the next first.
    torques_nm: VecDeque<f64>,
}

impl Perturbation {
    fn new(orbit: &Linearised, feedback: &Feedback) -> Self {
        let delay_ticks = (feedback.delay_s / orbit.tick_s).max(1.0);
        let length = delay_ticks.ceil() as usize + 1;
        Self {
            // Along all components, and no symmetry of the orbit.
            state: Vector4::new(1.0, -0.7, 0.5, 0.3),
            line: std::iter::repeat_n(0.0, length).collect(),
            delay_ticks,
            torques_nm: std::iter::repeat_n(0.0, feedback.latency_ticks).collect(),
        }
    }

    /// The value that was the newest that number of ticks ago.
    fn before(&self, ticks: f64) -> f64 {
        let whole = ticks.floor();
        let at = |back: usize| {
            let place = self.line.len().checked_sub(1 + back);
            place.map_or(0.0, |place| self.line[place])
        };
        let later = at(whole as usize);
        later + (ticks - whole) * (at(whole as usize + 1) - later)
    }

    fn step(&mut self, tick: &Tick, feedback: &Feedback) {
        let signal = feedback.signal(&self.state);
        let delayed = self.before(self.delay_ticks - 1.0);
        self.torques_nm
            .push_back(feedback.gain * (delayed - signal));
        let torque_nm = self.torques_nm.pop_front().unwrap_or(0.0);
        self.line.pop_front();
        self.line
            .push_back((1.0 - feedback.memory) * signal + feedback.memory * delayed);
        self.state = tick.by_state * self.state + tick.by_torque * torque_nm;
    }

    /// Takes out the shift along the orbit, whose multiplier is 1: what is left crosses the section of the
    /// orbit's start at the same time.
    fn remove_shift(&mut self, orbit: &Linearised, feedback: &Feedback) {
        let rate = orbit.ticks[0].rate;
        let share = self.state.dot(&rate) / rate.norm_squared();
        self.state -= rate * share;
        let rates = orbit.ticks.iter().rev().cycle();
        for (value, tick) in self.line.iter_mut().rev().zip(rates) {
            *value -= share * feedback.signal(&tick.rate);
        }
    }

    /// Scales it to size 1; the logarithm of its size before, infinite where numbers have overflowed.
    fn normalise(&mut self) -> f64 {
        let values = self.state.iter().chain(&self.line);
        if !values.clone().all(|value| value.is_finite()) {
            return f64::INFINITY;
        }
        let size = values.fold(0.0, |size: f64, value| size.max(value.abs()));
        self.state /= size;
        let others = self.line.iter_mut().chain(&mut self.torques_nm);
        others.for_each(|value| *value /= size);
        size.ln()
    }
}
