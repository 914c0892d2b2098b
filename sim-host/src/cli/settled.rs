//! Options of the plots of a post-transient trajectory, and its computation.

use super::options::RunOptions;
use super::options::advice;
use super::output::Named;
use anyhow::{bail, ensure};
use clap::Args;
use dynamics::simulate::{after_transient, early_end, record};
use dynamics::trace::Trace;
use dynamics::words::Short;
use shared_model::Scenario;

/// Least and greatest transient, s.
const TRANSIENTS_S: std::ops::RangeInclusive<f64> = 0.0..=100_000.0;
/// Maximum number of states in memory.
const MAX_STATES: u32 = 20_000_000;

/// A run with an initial transient. The dither, if any, is on from the start.
#[derive(Args)]
pub struct SettledRun {
    #[command(flatten)]
    run: RunOptions,
    /// Initial transient to discard, before the run, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 200.0,
        allow_negative_numbers = true
    )]
    pub transient: f64,
}

impl SettledRun {
    /// The input file, if any.
    pub fn input(&self) -> Option<Named<'_>> {
        self.run.config.input()
    }

    /// The scenario, validated together with the transient.
    pub fn scenario(&self) -> anyhow::Result<Scenario<f64>> {
        let scenario = self.run.scenario()?;
        ensure!(
            TRANSIENTS_S.contains(&self.transient),
            "--transient {}: must be from {} to {} s",
            Short(self.transient),
            TRANSIENTS_S.start(),
            TRANSIENTS_S.end()
        );
        Ok(scenario)
    }

    /// The scenario's trajectory after the transient.
    pub fn trace(&self, scenario: &Scenario<f64>) -> anyhow::Result<Trace> {
        ensure!(
            scenario.steps() <= MAX_STATES,
            "--time {}: must be at most {} s, which is {MAX_STATES} steps",
            Short(scenario.run.duration_s),
            f64::from(MAX_STATES) * scenario.step_s()
        );
        let trace = record(&mut after_transient(scenario, self.transient)?, scenario);
        if let Some(end) = early_end(scenario, &trace) {
            let end = end.later_by(self.transient);
            bail!("{end}; nothing was written. {}", advice(end.reason));
        }
        Ok(trace)
    }
}

/// Speed and dither of a run, for headings.
pub fn title(scenario: &Scenario<f64>) -> String {
    use plot::number::four_digits;
    use shared_model::dither::{Application, Waveform};
    let dither = &scenario.dither;
    let waveform = match dither.waveform {
        Waveform::None => return format!("{} rpm, no dither", scenario.run.wheel_speed_rpm),
        Waveform::Square => "square",
        Waveform::Sine => "sine",
    };
    let application = match dither.application {
        Application::Averaged => "averaged",
        Application::Signal => "as a signal",
    };
    format!(
        "{} rpm, {waveform} dither {} V {application}",
        scenario.run.wheel_speed_rpm,
        four_digits(dither.amplitude_v)
    )
}
