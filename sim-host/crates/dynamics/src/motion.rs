//! The vehicle's motion on its own, without PWM and telemetry: what sweeps and analyses step.

use nalgebra::Vector4;
use shared_model::dither::{Application, Injection};
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Real, Scenario, integrate};

/// Angles (rad) and rates (rad/s) beyond this are no motion of a vehicle.
pub(crate) const BOUND: f64 = 1e3;

/// Whether a state vector is one of a vehicle at all: finite, and within any bounds that one could keep.
pub fn is_bounded<T: Real>(x: &Vector4<T>) -> bool {
    x.iter().all(|value| value.to_f64().abs() < BOUND)
}

/// The motion left all physical bounds: angles in rad and rates in rad/s below a thousand.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, serde::Serialize)]
#[error("the motion diverges at {time_s} s")]
pub struct Diverged {
    /// When, s.
    pub time_s: f64,
}

/// A motion of the averaged system. The dither, if there is one, is on from the start.
#[derive(Debug, Clone)]
pub struct Motion<T> {
    model: Model<T>,
    state: State<T>,
    step_s: T,
    injection: Injection<T>,
}

impl<T: Real> Motion<T> {
    /// The motion of a scenario from its start.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<T>) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
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
            self.step();
        }
        &self.state
    }

    /// Runs as many steps as fit into `time_s`, and shows `see` each state with its time from now, s.
    ///
    /// # Errors
    /// As soon as the motion leaves all physical bounds; `see` is not shown that state.
    pub fn observe(
        &mut self,
        time_s: f64,
        mut see: impl FnMut(f64, &State<T>),
    ) -> Result<(), Diverged> {
        let step_s = self.step_s.to_f64();
        let steps = (time_s / step_s).round() as u64;
        for k in 1..=steps {
            let time_s = k as f64 * step_s;
            if !is_bounded(&self.step().x) {
                return Err(Diverged { time_s });
            }
            see(time_s, &self.state);
        }
        Ok(())
    }

    /// The present state.
    pub fn state(&self) -> &State<T> {
        &self.state
    }

    /// Goes on from another state.
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
