//! Which gains and delays hold the orbit at one speed.

use super::feedback::{Feedback, Plan};
use super::linearised::Linearised;
use super::simulation::{Held, simulate};
use crate::sweep::{RunControl, Values};
use shared_model::Scenario;

/// One gain and one error of the delay at a wheel speed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Cell {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// The gain.
    pub gain: f64,
    /// Error of the delay, s.
    pub delay_error_s: f64,
    /// Greatest modulus of a multiplier of the orbit, to first order in the error.
    pub multiplier: f64,
    /// The simulation.
    pub held: Held,
}

/// Multiplier and simulation at each gain of the plan and each error of the delay, at the scenario's speed; none if
/// there is no orbit of one cycle. Cells that were not begun before a request to stop are left out.
pub fn region(
    scenario: &Scenario<f64>,
    plan: &Plan,
    errors_s: &Values,
    plant: &Scenario<f64>,
    control: RunControl,
) -> Option<Vec<Cell>> {
    let orbit = Linearised::of(scenario)?;
    let of_gain = |gain| errors_s.iter().map(move |error_s| (gain, error_s));
    let places: Vec<(f64, f64)> = plan.gains.iter().flat_map(of_gain).collect();
    let cells = control.points(&places, |&(gain, delay_error_s)| {
        let feedback = Feedback {
            gain,
            delay_s: orbit.period_s + delay_error_s,
            ..plan.feedback
        };
        Cell {
            wheel_speed_rpm: scenario.run.wheel_speed_rpm,
            gain,
            delay_error_s,
            multiplier: orbit.greatest_multiplier(&feedback),
            held: simulate(plant, &feedback, &plan.conditions),
        }
    });
    Some(cells.into_iter().flatten().collect())
}
