//! A recorded motion: states at a fixed step, and the duty codes of the PWM.

use crate::early_end::is_bounded;
use nalgebra::Vector4;
use shared_model::open_loop::OpenLoop;
use shared_model::vehicle::State;
use shared_model::{Real, Scenario};

/// A motion sampled at every model step.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Time between two states, s.
    pub step_s: f64,
    /// State at time 0.
    pub initial: State<f64>,
    /// State after each step: that with index k is at time (k + 1) times the step.
    pub states: Vec<State<f64>>,
    /// Duty code of each PWM period.
    pub duties: Vec<u16>,
    /// PWM periods in a step.
    pub samples_per_step: usize,
    /// Counts of the PWM timer in a period: the duty code of full duty.
    pub pwm_period: u16,
}

impl Trace {
    /// Runs a scenario's program from its present state on, for the length of the scenario, and
    /// records it.
    pub fn record<T: Real>(ecu: &mut OpenLoop<T>, scenario: &Scenario<T>) -> Self {
        let steps = scenario.steps() as usize;
        let samples_per_step = scenario.samples_per_step() as usize;
        let initial = ecu.control.state().map(Real::to_f64);
        let mut states = Vec::with_capacity(steps);
        let mut duties = Vec::with_capacity(steps * samples_per_step);
        for _ in 0..steps {
            interrupt::check();
            let state = ecu.step(|duty| duties.push(duty.code()));
            states.push(state.map(Real::to_f64));
        }
        Self {
            step_s: 1.0 / scenario.model_rate_hz().to_f64(),
            initial,
            states,
            duties,
            samples_per_step,
            pwm_period: ecu.pwm.neutral().period(),
        }
    }

    /// Time of the state with index `k`, s.
    pub fn time_s(&self, k: usize) -> f64 {
        (k + 1) as f64 * self.step_s
    }

    /// Index of the first state that is later than `time_s`.
    pub fn index_after(&self, time_s: f64) -> usize {
        ((time_s / self.step_s).round() as usize).min(self.states.len())
    }

    /// Time of PWM period `n`'s start, s.
    pub fn pwm_time_s(&self, n: usize) -> f64 {
        n as f64 * self.step_s / self.samples_per_step as f64
    }

    /// The state at the start of each step.
    pub fn starts(&self) -> impl Iterator<Item = &State<f64>> {
        std::iter::once(&self.initial)
            .chain(&self.states)
            .take(self.states.len())
    }

    /// One component of the states, with `shared_model::vehicle`'s indices.
    pub fn component(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        self.states.iter().map(move |state| state.x[index])
    }

    /// Least and greatest value of a component from state index `from` on.
    pub fn range(&self, index: usize, from: usize) -> (f64, f64) {
        let empty = (f64::INFINITY, f64::NEG_INFINITY);
        self.component(index)
            .skip(from)
            .fold(empty, |(low, high), value| {
                (low.min(value), high.max(value))
            })
    }

    /// Time at which the numerical solution leaves all physical bounds, if it does, s;
    /// the reference integrator of the host's programs finds out why.
    pub fn leaves_bounds_at_s(&self) -> Option<f64> {
        let first = self.states.iter().position(|state| !is_bounded(&state.x))?;
        Some(self.time_s(first))
    }

    /// The slow motion under a fast ripple: each state replaced by the mean of those within half of
    /// `window_s` of it. The first and last states, whose window is not whole, are left out, so
    /// the trace begins half a window later.
    pub fn smoothed(&self, window_s: f64) -> Self {
        let half = (0.5 * window_s / self.step_s).round() as usize;
        let mean = |window: &[State<f64>]| {
            let sum: Vector4<f64> = window.iter().map(|state| state.x).sum();
            State {
                x: sum / window.len() as f64,
                friction: window[half].friction,
            }
        };
        Self {
            states: self.states.windows(2 * half + 1).map(mean).collect(),
            ..self.clone()
        }
    }
}
