//! The ECU's program run on the host, in any arithmetic.

use crate::trace::Trace;
use engine::reference::{DECISIVE_MARGIN_S, DECISIVE_TOLERANCE, Reference};
use engine::{EarlyEnd, Reason, Stepper, is_bounded};
use interrupt;
use shared_model::dither::Injection;
use shared_model::open_loop::OpenLoop;
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Real, Scenario};

/// Why a transient has no end.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unsettled {
    /// The scenario is not valid.
    #[error(transparent)]
    Invalid(#[from] InvalidScenario),
    /// The motion, or its numerical solution, leaves all bounds.
    #[error(transparent)]
    EndsEarly(#[from] EarlyEnd),
}

/// Runs a scenario to its end: in f32 as the firmware does, in f64 as the reference.
///
/// # Errors
/// If the scenario is not valid.
pub fn simulate<T: Compiled>(scenario: &Scenario<T>) -> Result<Trace, InvalidScenario> {
    T::simulate(scenario)
}

/// An arithmetic for which this crate holds compiled code, so that callers do not compile the model
/// again.
pub trait Compiled: Real {
    /// Runs a scenario to its end.
    ///
    /// # Errors
    /// If the scenario is not valid.
    fn simulate(scenario: &Scenario<Self>) -> Result<Trace, InvalidScenario>;
}

impl Compiled for f32 {
    fn simulate(scenario: &Scenario<f32>) -> Result<Trace, InvalidScenario> {
        Ok(Trace::record(&mut OpenLoop::new(scenario)?, scenario))
    }
}

impl Compiled for f64 {
    fn simulate(scenario: &Scenario<f64>) -> Result<Trace, InvalidScenario> {
        Ok(Trace::record(&mut OpenLoop::new(scenario)?, scenario))
    }
}

/// The program of a scenario whose dither is on from the start, after a transient of `transient_s`.
///
/// # Errors
/// If the scenario is not valid, or the motion leaves all bounds.
pub fn after_transient(
    scenario: &Scenario<f64>,
    transient_s: f64,
) -> Result<OpenLoop<f64>, Unsettled> {
    let mut scenario = *scenario;
    scenario.dither.start_time_s = 0.0;
    let mut ecu = OpenLoop::new(&scenario)?;
    let steps = (transient_s * scenario.model_rate_hz()).round() as u64;
    for k in 1..=steps {
        interrupt::check();
        if !is_bounded(&ecu.step(|_| {}).x) {
            let time_s = k as f64 * scenario.step_s();
            let reason = why_unbounded(&scenario, time_s);
            return Err(EarlyEnd { time_s, reason }.into());
        }
    }
    Ok(ecu)
}

/// Why the program's motion from the scenario's start left all bounds within `time_s`: the solution
/// to a tolerance does too, under the same samples of the dither, or the step is too long.
pub fn why_unbounded(scenario: &Scenario<f64>, time_s: f64) -> Reason {
    let model = Model::new(scenario);
    let start = model.initial_state(scenario);
    let Ok(mut ecu) = OpenLoop::new(scenario) else {
        return Reason::Diverges;
    };
    let mut reference = Reference::from_state(&model, Injection::Off, &start, DECISIVE_TOLERANCE);
    let step_s = scenario.step_s();
    for k in 0..((time_s + DECISIVE_MARGIN_S) / step_s) as u64 {
        let sample = loop {
            let sample = ecu.pwm.run();
            if sample.control_due {
                break sample;
            }
        };
        if k >= u64::from(scenario.dither_start_step()) {
            reference.set_injection(scenario.dither.injection(sample.dither));
        }
        if let Err(end) = reference.run(step_s) {
            return match end.reason {
                Reason::Diverges => Reason::Diverges,
                _ => Reason::StepTooLong,
            };
        }
    }
    Reason::StepTooLong
}

/// When and why a scenario's recorded motion left all bounds, if it did.
pub fn early_end(scenario: &Scenario<f64>, trace: &Trace) -> Option<EarlyEnd> {
    let time_s = trace.leaves_bounds_at_s()?;
    let reason = why_unbounded(&started_at(scenario, &trace.initial), time_s);
    Some(EarlyEnd { time_s, reason })
}

/// Records the motion of a scenario from the program's present state on, for the scenario's length.
pub fn record(ecu: &mut OpenLoop<f64>, scenario: &Scenario<f64>) -> Trace {
    Trace::record(ecu, scenario)
}

/// State after `time_s` of the scenario's motion without dither: a start on the attractor.
///
/// # Errors
/// If the scenario is not valid, or the motion leaves all bounds.
pub fn settle(scenario: &Scenario<f64>, time_s: f64) -> Result<State<f64>, Unsettled> {
    let mut scenario = *scenario;
    scenario.dither.waveform = shared_model::dither::Waveform::None;
    let mut motion = Stepper::new(&scenario)?;
    motion.observe(time_s, |_, _| {})?;
    Ok(*motion.state())
}

/// The scenario started in the given state.
pub fn started_at(scenario: &Scenario<f64>, state: &State<f64>) -> Scenario<f64> {
    let mut scenario = *scenario;
    let run = &mut scenario.run;
    run.sideslip_rad = state.x[0];
    run.yaw_rate_rad_per_s = state.x[1];
    run.steering_angle_rad = state.x[2];
    run.steering_rate_rad_per_s = state.x[3];
    scenario
}
