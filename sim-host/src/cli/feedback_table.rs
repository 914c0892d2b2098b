//! `sim-host feedback --table`: the periods and gains that the ECU carries.

use super::options::parameters_in_words;
use super::outcome::Outcome;
use super::sweep::{check_interrupted, with_progress};
use dynamics::delayed_feedback::{Plan, entries, source};
use dynamics::sweep::Values;
use files::output::write_text;
use shared_model::Scenario;
use std::path::Path;

/// Computes the tables without and with dither, and writes them to the file. `command` is what made them.
pub fn run(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    plan: &Plan,
    command: &str,
    (path, force): (&Path, bool),
) -> anyhow::Result<Outcome> {
    let entries = with_progress(speeds_rpm.count(), |control| {
        entries(scenario, speeds_rpm, &plan.feedback, &plan.gains, control)
    })?;
    check_interrupted(entries.len(), speeds_rpm.count())?;
    let made_by = [
        format!("Made by `{command}`; not to be edited by hand."),
        format!("Parameters: {}.", parameters_in_words(scenario)),
    ];
    let text = source(scenario, speeds_rpm, &entries, &made_by)?;
    write_text(path, &text, force)?;
    say!(
        "{} wheel speeds, without and with dither",
        speeds_rpm.count()
    );
    Ok(Outcome::Success)
}
