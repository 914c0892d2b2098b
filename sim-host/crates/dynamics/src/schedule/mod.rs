//! The dither's schedule: at each wheel speed N the least amplitude W that gives period one, with a
//! margin.
//!
//! | question | module |
//! |---|---|
//! | which kind of motion has each N and W? | [`cells`] |
//! | which W for which N? | [`choose`] |
//! | how far is it from bifurcations? | [`Margin`] |
//! | does it hold under the true dither signal? | [`check`] |
//! | how does the ECU get it? | [`source`] |
//! | how is it drawn? | [`figure`] |

pub mod cells;
pub mod check;
pub mod choose;
pub mod figure;
mod margin;
mod plan;
pub mod source;

use crate::sweep::{RunControl, SweepError};
use cells::{Cell, Column, columns};
use check::check;
pub use margin::Margin;
pub use plan::Plan;

use choose::{Choice, Entry, choose};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::servo::Pwm;

/// The schedule of one waveform, with what it comes from.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Analysis {
    /// The waveform.
    pub waveform: Waveform,
    /// Width to which edges were bisected, V: a range of W ends within this beyond the ends given.
    pub edge_width_v: f64,
    /// Least room on both sides of an amplitude in its range, V: half a count of the PWM.
    pub room_v: f64,
    /// Kinds of motion over W at each wheel speed.
    pub columns: Vec<Column>,
    /// The table's entries.
    pub entries: Vec<Entry>,
    /// How far the amplitudes of the entries with dither are from bifurcations.
    pub margins: Vec<Margin>,
    /// What the table's amplitudes do as the true signal, at its speeds and midway between them.
    pub checks: Vec<Cell>,
}

impl Analysis {
    /// The table's amplitudes, V.
    pub fn amplitudes_v(&self) -> Vec<f64> {
        self.entries.iter().map(|entry| entry.amplitude_v).collect()
    }

    /// Speeds at which no amplitude calms the motion, rpm.
    pub fn hopeless_rpm(&self) -> Vec<f64> {
        let hopeless = self.entries.iter().filter(|e| e.choice == Choice::Nothing);
        hopeless.map(|entry| entry.wheel_speed_rpm).collect()
    }

    /// Checks that a motion of another kind than period one and rest fails.
    pub fn failed_checks(&self) -> impl Iterator<Item = &Cell> {
        self.checks.iter().filter(|cell| !cell.class().is_calm())
    }

    /// Margins that are not kept, at their own amplitude or at that of a neighbour in the table, which also
    /// acts up to their speed.
    pub fn lost_margins(&self) -> impl Iterator<Item = &Margin> {
        margin::lost(&self.margins)
    }
}

/// How many runs [`schedule`] makes at least; bisections come on top.
pub fn runs(plan: &Plan) -> usize {
    2 * plan.speeds_rpm.count() * (plan.amplitudes_v.count() + 4)
}

/// Makes the schedule of the scenario's waveform: map, choice, check.
///
/// The map takes the mean of the dither. A range of W narrower than the step between amplitudes can
/// be missed, but none is used that is narrower than a count of the PWM. The result does not depend
/// on the number of threads. `None` if it was stopped.
///
/// # Errors
/// If the scenario has no waveform, or one of a speed and amplitude is not valid.
///
/// ```
/// use dynamics::schedule::{Plan, schedule};
/// use dynamics::sweep::{RunControl, Timing, Values};
///
/// let mut scenario = shared_model::Scenario::reconstruction();
/// scenario.dither.waveform = shared_model::dither::Waveform::Square;
/// let plan = Plan {
///     speeds_rpm: Values::new("wheel speed (rpm)", 1750.0, 1750.0, 25.0)?,
///     amplitudes_v: Values::parts("amplitude (V)", 0.15, 10)?,
///     edge_width_v: 1e-3,
///     margin: 0.25,
///     greatest_multiplier: 0.8,
///     timing: Timing::new(150.0, 200.0)?,
/// };
/// let found = schedule(&scenario, &plan, RunControl::none())?.expect("it is not interrupted");
/// let (entry, margin) = (&found.entries[0], &found.margins[0]);
/// assert!((0.105..0.115).contains(&entry.amplitude_v));
/// assert!(margin.greatest_multiplier.unwrap() < 0.8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn schedule(
    scenario: &Scenario<f64>,
    plan: &Plan,
    control: RunControl,
) -> Result<Option<Analysis>, SweepError> {
    plan.validate(scenario)?;
    let Some(columns) = columns(scenario, plan, control)? else {
        return Ok(None);
    };
    let count_v = Pwm::new(&scenario.servo, scenario.run.pwm_rate_hz).volts_per_count();
    let room_v = (0.5 * count_v).max(choose::RESOLUTION_V);
    let entries = choose(&columns, plan.margin, room_v);
    let Some(margins) = margin::margins(scenario, plan, &entries, control)? else {
        return Ok(None);
    };
    let Some(checks) = check(scenario, &plan.speeds_rpm, &entries, plan.timing, control)? else {
        return Ok(None);
    };
    Ok(Some(Analysis {
        waveform: scenario.dither.waveform,
        edge_width_v: plan.edge_width_v,
        room_v,
        columns,
        entries,
        margins,
        checks,
    }))
}
