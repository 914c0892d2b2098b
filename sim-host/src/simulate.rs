//! The ECU's program run on the host, in any arithmetic.

use crate::motion::Motion;
use crate::trace::Trace;
use shared_model::open_loop::OpenLoop;
use shared_model::vehicle::State;
use shared_model::{InvalidScenario, Real, Scenario};

/// Runs a scenario to its end: in f32 as the firmware does, in f64 as the reference.
///
/// # Errors
/// If the scenario is not valid.
pub fn simulate<T: Real>(scenario: &Scenario<T>) -> Result<Trace, InvalidScenario> {
    Ok(record(&mut OpenLoop::new(scenario)?, scenario))
}

/// The program of a scenario whose dither is on from the start, after a transient of `transient_s`.
///
/// # Errors
/// If the scenario is not valid.
pub fn after_transient<T: Real>(
    scenario: &Scenario<T>,
    transient_s: f64,
) -> Result<OpenLoop<T>, InvalidScenario> {
    let mut scenario = *scenario;
    scenario.dither.start_time_s = T::zero();
    let mut ecu = OpenLoop::new(&scenario)?;
    let steps = (transient_s * scenario.model_rate_hz().to_f64()).round() as u64;
    for _ in 0..steps {
        ecu.step(|_| {});
    }
    Ok(ecu)
}

/// Records the motion of a scenario from the program's present state on, for the scenario's length.
pub fn record<T: Real>(ecu: &mut OpenLoop<T>, scenario: &Scenario<T>) -> Trace {
    let steps = scenario.steps() as usize;
    let samples_per_step = scenario.samples_per_step() as usize;
    let initial = ecu.control.state().map(Real::to_f64);
    let mut states = Vec::with_capacity(steps);
    let mut duties = Vec::with_capacity(steps * samples_per_step);
    for _ in 0..steps {
        let state = ecu.step(|duty| duties.push(duty.code()));
        states.push(state.map(Real::to_f64));
    }
    Trace {
        step_s: 1.0 / scenario.model_rate_hz().to_f64(),
        initial,
        states,
        duties,
        samples_per_step,
        pwm_period: ecu.pwm.neutral().period(),
    }
}

/// State after `time_s` of the scenario's motion without dither: a start on the attractor.
///
/// # Errors
/// If the scenario is not valid.
pub fn settle<T: Real>(scenario: &Scenario<T>, time_s: f64) -> Result<State<T>, InvalidScenario> {
    let mut scenario = *scenario;
    scenario.dither.waveform = shared_model::dither::Waveform::None;
    Ok(*Motion::new(&scenario)?.run(time_s))
}

/// The scenario started in the given state.
pub fn started_at<T: Real>(scenario: &Scenario<T>, state: &State<T>) -> Scenario<T> {
    let mut scenario = *scenario;
    let run = &mut scenario.run;
    run.sideslip_rad = state.x[0];
    run.yaw_rate_rad_per_s = state.x[1];
    run.steering_angle_rad = state.x[2];
    run.steering_rate_rad_per_s = state.x[3];
    scenario
}
