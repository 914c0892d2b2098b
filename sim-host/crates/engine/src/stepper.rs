//! Fixed-step integration of the averaged vehicle model, without PWM and telemetry.

use crate::reference::why_unbounded;
use measures::{EarlyEnd, is_bounded};
use shared_model::dither::{Application, Injection};
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Real, Scenario, integrate};

/// A trajectory of the averaged system at a fixed step. The dither, if there is one, is on from the
/// start.
#[derive(Debug, Clone)]
pub struct Stepper<T> {
    model: Model<T>,
    state: State<T>,
    step_s: T,
    injection: Injection<T>,
}

impl<T: Real> Stepper<T> {
    /// The trajectory of a scenario from its initial state.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<T>) -> Result<Self, InvalidScenario> {
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
        averaged.validate()?;
        let model = Model::new(&averaged);
        Ok(Self {
            state: model.initial_state(&averaged),
            step_s: averaged.step_s(),
            injection: averaged.dither.injection(T::zero()),
            model,
        })
    }

    /// One step.
    pub fn step(&mut self) -> &State<T> {
        integrate::step(&self.model, &mut self.state, self.step_s, self.injection);
        &self.state
    }

    /// As many steps as fit into `time_s`.
    pub fn run(&mut self, time_s: f64) -> &State<T> {
        let steps = (time_s / self.step_s.to_f64()).round() as u64;
        for _ in 0..steps {
            interrupt::check();
            self.step();
        }
        &self.state
    }

    /// Runs as many steps as fit into `time_s`, and shows `see` each state with its time from now,
    /// s.
    ///
    /// # Errors
    /// As soon as the state leaves all physical bounds; `see` is not shown that state. The
    /// reference integrator decides whether the motion itself does, or the step is too long.
    pub fn observe(
        &mut self,
        time_s: f64,
        mut see: impl FnMut(f64, &State<T>),
    ) -> Result<(), EarlyEnd> {
        let step_s = self.step_s.to_f64();
        let steps = (time_s / step_s).round() as u64;
        let start = self.state;
        for k in 1..=steps {
            interrupt::check();
            let time_s = k as f64 * step_s;
            if !is_bounded(&self.step().x) {
                let model = self.model.map(&Real::to_f64);
                let injection = self.injection.map(Real::to_f64);
                let start = start.map(Real::to_f64);
                let reason = why_unbounded(&model, injection, &start, time_s);
                return Err(EarlyEnd { time_s, reason });
            }
            see(time_s, &self.state);
        }
        Ok(())
    }

    /// The present state.
    pub fn state(&self) -> &State<T> {
        &self.state
    }

    /// Continues from another state.
    pub fn set_state(&mut self, state: State<T>) {
        self.state = state;
    }

    /// The right-hand side and its constants.
    pub fn model(&self) -> &Model<T> {
        &self.model
    }

    /// What the dither does to the nonlinearities.
    pub fn injection(&self) -> Injection<T> {
        self.injection
    }

    /// Length of a step, s.
    pub fn step_s(&self) -> T {
        self.step_s
    }
}
