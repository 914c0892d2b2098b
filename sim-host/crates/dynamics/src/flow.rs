//! What the Lyapunov exponents are measured on: anything that has a state vector and steps.

use engine::reference::why_unbounded;
use engine::{EarlyEnd, Reason, Stepper, is_bounded};
use interrupt;
use nalgebra::{SVector, Vector4};
use shared_model::dither::Injection;
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Real, Scenario, integrate};

/// A dynamic system in discrete steps: a map, or a differential equation with its integrator.
///
/// The vector is the whole state. Everything a system remembers beside it would escape the methods.
pub trait Flow<const N: usize> {
    /// The state one step on, in any arithmetic: in dual numbers the step linearises itself.
    fn step<T: Real>(&self, x: &SVector<T, N>) -> SVector<T, N>;

    /// Length of a step, s.
    fn step_s(&self) -> f64;

    /// Whether the state is one that the system may have; a motion that leaves these diverges.
    fn contains(&self, x: &SVector<f64, N>) -> bool {
        x.iter().all(|value| value.is_finite())
    }

    /// Why a motion from `start` is at a state that it may not have `time_s` later: it diverges, or
    /// the step is too long. Without a second integrator there is no telling.
    fn why_unbounded(&self, _start: &SVector<f64, N>, _time_s: f64) -> Reason {
        Reason::Diverges
    }
}

/// Why a motion has no exponent.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unmeasured {
    /// The motion, or its numerical solution, leaves all bounds. The time counts from the start
    /// given.
    #[error(transparent)]
    EndsEarly(#[from] EarlyEnd),
    /// The motion is too short for a standard error.
    #[error("{time_s} s is too short to measure an exponent: at least {least_s} s")]
    TooShort {
        /// Length that was asked for, s.
        time_s: f64,
        /// Least length, s.
        least_s: f64,
    },
}

/// Steps in `time_s`.
pub(crate) fn steps<const N: usize>(flow: &impl Flow<N>, time_s: f64) -> usize {
    (time_s / flow.step_s()).round() as usize
}

/// The state `time_s` on: a transient passes.
///
/// # Errors
/// If the motion diverges.
pub fn settle<const N: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    time_s: f64,
) -> Result<SVector<f64, N>, Unmeasured> {
    let mut x = *start;
    for k in 0..steps(flow, time_s) {
        x = flow.step(&x);
        check(flow, start, &x, k + 1)?;
    }
    Ok(x)
}

/// An error if the state that the motion from `start` has after `steps` steps is none of the
/// system's.
pub(crate) fn check<const N: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    x: &SVector<f64, N>,
    steps: usize,
) -> Result<(), Unmeasured> {
    if flow.contains(x) {
        return Ok(());
    }
    let time_s = steps as f64 * flow.step_s();
    let reason = flow.why_unbounded(start, time_s);
    Err(EarlyEnd { time_s, reason }.into())
}

/// The vehicle under its dither, averaged and on from the start, by the ECU's integrator.
///
/// [`integrate::step`] derives the friction mode from the state vector, so the vector is the whole
/// state: at a steering rate of exactly zero the torques decide whether the steering sticks.
#[derive(Debug, Clone)]
pub struct VehicleFlow {
    model: Model<f64>,
    injection: Injection<f64>,
    step_s: f64,
    steering_damping_per_s: f64,
    start: Vector4<f64>,
}

impl VehicleFlow {
    /// The flow of a scenario; it is checked here, once.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<f64>) -> Result<Self, InvalidScenario> {
        let motion = Stepper::new(scenario)?;
        let steering = &scenario.steering;
        Ok(Self {
            model: *motion.model(),
            injection: motion.injection(),
            step_s: motion.step_s(),
            steering_damping_per_s: steering.damping_nm_s_per_rad / steering.inertia_kg_m2,
            start: motion.state().x,
        })
    }

    /// The scenario's start.
    pub fn start(&self) -> Vector4<f64> {
        self.start
    }

    /// The right-hand side and its constants.
    pub fn model(&self) -> &Model<f64> {
        &self.model
    }

    /// What the dither does to the nonlinearities.
    pub fn injection(&self) -> Injection<f64> {
        self.injection
    }

    /// b_w/J_w, the rate at which the steering's viscous damping brakes it, 1/s.
    pub(crate) fn steering_damping_per_s(&self) -> f64 {
        self.steering_damping_per_s
    }
}

impl Flow<4> for VehicleFlow {
    fn step<T: Real>(&self, x: &Vector4<T>) -> Vector4<T> {
        interrupt::check();
        // The constants are carried over each time: some forty moves beside thousands of
        // operations.
        let model = self.model.map(&T::from_f64);
        let injection = self.injection.map(T::from_f64);
        let mut state = State {
            x: *x,
            friction: shared_model::friction::FrictionMode::Neutral,
        };
        integrate::step(&model, &mut state, T::from_f64(self.step_s), injection);
        state.x
    }

    fn step_s(&self) -> f64 {
        self.step_s
    }

    fn contains(&self, x: &Vector4<f64>) -> bool {
        is_bounded(x)
    }

    fn why_unbounded(&self, start: &Vector4<f64>, time_s: f64) -> Reason {
        let start = self.model.state(*start);
        why_unbounded(&self.model, self.injection, &start, time_s)
    }
}
