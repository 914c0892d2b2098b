//! What a feedback does at each wheel speed.

use super::feedback::{Feedback, Plan};
use super::impulse;
use super::linearised::{Best, Linearised};
use super::orbit::{branch_over_speed, orbit_on};
use super::simulation::{Held, simulate};
use super::to_rest;
use crate::sweep::{Parameter, RunControl, SweepError, Values, scenarios};
use shared_model::Scenario;

/// What a feedback does at one wheel speed.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Point {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Period of the orbit of one cycle, s.
    pub period_s: f64,
    /// Its multiplier of greatest modulus without feedback, beside 1.
    pub free_multiplier: f64,
    /// The best gain.
    pub best: Best,
    /// The trajectory from the scenario's start under the best gain.
    pub held: Held,
    /// The same under an impulse per cycle by the exact state, without noise and latency.
    pub under_impulses: Held,
    /// The same under feedback of the exact state to an equilibrium, without noise; captured is one that comes to rest.
    pub to_rest: Held,
}

/// Orbits, best gains and simulations over the wheel speed, each with the orbit's own period as delay. `plant` is
/// the vehicle that is simulated, which may be another than the scenario, whose orbits give delay and gain; `None`
/// at a speed where no orbit of one cycle is found. Speeds that were not begun before a request to stop are left
/// out.
///
/// # Errors
/// If a scenario is not valid.
pub fn over_speed(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    plan: &Plan,
    plant: &Scenario<f64>,
    control: RunControl,
) -> Result<Vec<Option<Point>>, SweepError> {
    let scenarios = scenarios(scenario, Parameter::Speed, speeds_rpm)?;
    let plant =
        |scenario: &Scenario<f64>| Parameter::Speed.set(plant, scenario.run.wheel_speed_rpm);
    let branch = interrupt::catch(|| branch_over_speed(&scenarios)).unwrap_or_default();
    let points = control.points(&scenarios, |scenario| {
        let orbit = Linearised::at(scenario, &orbit_on(&branch, scenario)?)?;
        let delayed = Feedback {
            delay_s: orbit.period_s,
            ..plan.feedback
        };
        let best = orbit.best_gain(&delayed, &plan.gains);
        let feedback = Feedback {
            gain: best.gain,
            delay_s: orbit.period_s + plan.delay_error_s,
            ..delayed
        };
        Some(Point {
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            period_s: orbit.period_s,
            free_multiplier: orbit.free_multiplier,
            best,
            held: simulate(&plant(scenario), &feedback, &plan.conditions),
            under_impulses: impulse::simulate(
                &plant(scenario),
                &orbit,
                plan.feedback.limit_nm,
                &plan.conditions,
            ),
            to_rest: to_rest::simulate(scenario, plan, &plant(scenario)),
        })
    });
    Ok(points.into_iter().flatten().collect())
}
