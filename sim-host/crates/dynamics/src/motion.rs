//! The vehicle's motion on its own, without PWM and telemetry: what sweeps and analyses step.

use crate::engine::reference::why_unbounded;
use crate::interrupt;
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

/// A trajectory that ended before its time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct EarlyEnd {
    /// When, s.
    pub time_s: f64,
    /// Why.
    pub reason: Reason,
}

impl std::fmt::Display for EarlyEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { time_s, reason } = self;
        match reason {
            Reason::Diverges => write!(f, "the motion diverges at {time_s:.3} s"),
            Reason::StepTooLong => write!(
                f,
                "the step is too long: at {time_s:.3} s the fixed step leaves all bounds, within which the motion itself stays"
            ),
            Reason::Chattering | Reason::TooManySteps => {
                write!(f, "the integrator stops at {time_s:.3} s: {reason}")
            }
        }
    }
}

impl std::error::Error for EarlyEnd {}

impl EarlyEnd {
    /// The same, counted from an instant `earlier_s` before.
    pub fn later_by(self, earlier_s: f64) -> Self {
        Self {
            time_s: earlier_s + self.time_s,
            ..self
        }
    }
}

/// Why a trajectory ended before its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The solution itself leaves all physical bounds: angles in rad and rates in rad/s below a thousand.
    #[error("diverges")]
    Diverges,
    /// The numerical solution left the bounds, while the solution to a tolerance stays within them: the fixed step is unstable.
    #[error("step too long")]
    StepTooLong,
    /// Mode transitions of the friction follow each other without end: a sliding mode, which an integrator between events cannot pass.
    #[error("chattering friction")]
    Chattering,
    /// The tolerance asks for more steps per second of motion than a run may take.
    #[error("too many steps")]
    TooManySteps,
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

    /// Runs as many steps as fit into `time_s`, and shows `see` each state with its time from now, s.
    ///
    /// # Errors
    /// As soon as the state leaves all physical bounds; `see` is not shown that state. The reference integrator decides whether the
    /// motion itself does, or the step is too long.
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
