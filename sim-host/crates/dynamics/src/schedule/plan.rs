//! The inputs of a schedule.

use crate::sweep::{Parameter, SweepError, Timing, Values, scenarios};
use shared_model::Scenario;

/// What a schedule is made from.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// The wheel speeds of the table, rpm.
    pub speeds_rpm: Values,
    /// The amplitudes looked at, V; the first must be 0.
    pub amplitudes_v: Values,
    /// Width to which the edges of the ranges of W are bisected, V.
    pub edge_width_v: f64,
    /// Share of its range by which an amplitude lies above the least one: 0 to 1.
    pub margin: f64,
    /// Greatest modulus of a multiplier beside 1 of the orbits under an amplitude: 0 to 1.
    pub greatest_multiplier: f64,
    /// Times of each run.
    pub timing: Timing,
}

impl Plan {
    /// The greatest amplitude looked at, V.
    pub(super) fn greatest_amplitude_v(&self) -> f64 {
        self.amplitudes_v.iter().fold(0.0, f64::max)
    }

    /// Checks that the scenario can be run at every speed and at every amplitude of the plan.
    ///
    /// # Errors
    /// If it cannot, or has no waveform.
    pub fn validate(&self, scenario: &Scenario<f64>) -> Result<(), SweepError> {
        scenarios(scenario, Parameter::Amplitude, &self.amplitudes_v)?;
        scenarios(scenario, Parameter::Speed, &self.speeds_rpm)?;
        Ok(())
    }
}
