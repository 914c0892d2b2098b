//! The motion that the page shows: the ECU's program in open loop in f32, step by step as on the
//! target; or the delayed feedback.

use crate::feedback;
use measures::trace::Trace;
use serde::Serialize;
use shared_model::Scenario;
use shared_model::open_loop::OpenLoop;
use shared_model::policy::Suppression;
use shared_model::servo::Pwm;

/// Most model steps and PWM samples of a run: the browser keeps them all.
const MOST_STEPS: f64 = 1e6;
const MOST_SAMPLES: f64 = 4e6;

/// A motion.
pub struct Motion {
    /// State after each step.
    pub states: Vec<[f32; 4]>,
    /// Duty code of each PWM period.
    pub duties: Vec<u16>,
    /// What the numbers stand for.
    pub facts: Facts,
}

/// What a motion's numbers stand for.
#[derive(Serialize)]
pub struct Facts {
    /// Time between two states, s.
    pub step_s: f64,
    /// PWM periods in a step.
    pub samples_per_step: usize,
    /// Counts of the PWM timer in a period.
    pub pwm_period: u16,
    /// Voltage of a count, V.
    pub volts_per_count: f32,
    /// Time at which the state leaves all bounds, s.
    pub leaves_bounds_at_s: Option<f64>,
}

impl Motion {
    /// The states with the given indices of a recorded motion, and all of its duties.
    pub fn of(scenario: &Scenario<f32>, trace: Trace, from: usize) -> Self {
        let pwm = Pwm::new(&scenario.servo, scenario.run.pwm_rate_hz);
        let states = trace.states[from..].iter();
        Self {
            // They were f32 before they were recorded.
            states: states
                .map(|state| state.x.map(|x| x as f32).into())
                .collect(),
            facts: Facts {
                step_s: trace.step_s,
                samples_per_step: trace.samples_per_step,
                pwm_period: trace.pwm_period,
                volts_per_count: pwm.volts_per_count(),
                leaves_bounds_at_s: trace.leaves_bounds_at_s(),
            },
            duties: trace.duties,
        }
    }
}

/// Runs a scenario to its end.
///
/// # Errors
/// If it is not valid, or longer than the page has room for.
pub fn run(scenario: &Scenario<f32>) -> Result<Motion, String> {
    let trace = record(scenario)?;
    Ok(Motion::of(scenario, trace, 0))
}

/// Records a run of a scenario.
///
/// # Errors
/// If it is not valid, or longer than the page has room for.
pub fn record(scenario: &Scenario<f32>) -> Result<Trace, String> {
    check(scenario)?;
    if feedback::is_chosen(scenario) {
        return Ok(feedback::record(scenario));
    }
    let mut program = OpenLoop::new(scenario).map_err(|error| error.to_string())?;
    Ok(Trace::record(&mut program, scenario))
}

/// Checks that the page can run a scenario.
///
/// # Errors
/// With the suppressions that it has, or the greatest length of a run.
pub fn check(scenario: &Scenario<f32>) -> Result<(), String> {
    if scenario.controller.suppression == Suppression::Both {
        return Err(String::from(
            "controller.suppression = both: the page has dither or delayed_feedback",
        ));
    }
    let run = &scenario.run;
    let by_steps_s = MOST_STEPS / f64::from(scenario.model_rate_hz());
    let longest_s = by_steps_s.min(MOST_SAMPLES / f64::from(run.pwm_rate_hz));
    if f64::from(run.duration_s) <= longest_s {
        return Ok(());
    }
    Err(format!(
        "run.duration_s = {}: the page has room for {longest_s} s at these rates",
        run.duration_s
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_and_duties_are_those_of_the_program() {
        let mut scenario = Scenario::reconstruction();
        scenario.run.duration_s = 0.5;
        let motion = run(&scenario).unwrap();
        let mut program = OpenLoop::new(&scenario).unwrap();
        let mut duties = Vec::new();
        for words in &motion.states {
            let state = program.step(|duty| duties.push(duty.code()));
            let expected: [f32; 4] = state.x.into();
            assert_eq!(words.map(f32::to_bits), expected.map(f32::to_bits));
        }
        assert_eq!(motion.states.len(), 500);
        assert_eq!(motion.duties, duties);
    }

    #[test]
    fn a_run_without_room_is_refused() {
        let mut scenario = Scenario::reconstruction();
        scenario.run.duration_s = 401.0;
        let message = "run.duration_s = 401: the page has room for 400 s at these rates";
        assert_eq!(run(&scenario).err().as_deref(), Some(message));
        scenario.controller.suppression = Suppression::Both;
        assert!(run(&scenario).is_err_and(|error| error.contains("both")));
    }
}
