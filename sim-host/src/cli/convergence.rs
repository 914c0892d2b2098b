//! `sim-host convergence`: error of the fixed step relative to the reference integrator.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use anyhow::ensure;
use dynamics::convergence::{chart, errors};
use dynamics::words::Short;

/// Compute the error of the ECU's fixed step relative to the reference integrator, as a function of
/// the step.
///
/// Both start from the scenario's initial state, with the dither on from time 0. The reference
/// locates friction events to 1e-12 s. In chaos every error grows exponentially, so the comparison
/// is meaningful for a few seconds only.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host convergence                  # over 4 s, friction events included
  sim-host convergence --dither sine --amplitude-v 1 --figure convergence.svg")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    #[command(flatten)]
    destinations: Destinations,
}

/// Default length of the trajectory, s; and the allowed lengths, after which an error is still
/// meaningful.
const TIME_S: f64 = 4.0;
const TIMES_S: std::ops::RangeInclusive<f64> = 0.01..=60.0;

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let time_s = arguments.run.time.unwrap_or(TIME_S);
    ensure!(
        TIMES_S.contains(&time_s),
        "--time {}: must be from {} to {} s",
        Short(time_s),
        TIMES_S.start(),
        TIMES_S.end()
    );
    arguments.destinations.check(arguments.run.config.input())?;
    let errors = errors(&scenario, time_s)?;
    say!("{:>10}  {:>10}  {:>6}", "step (s)", "error", "order");
    for error in &errors {
        let order = error
            .order
            .map_or(String::new(), |order| format!("{order:.2}"));
        say!("{:>10}  {:>10.2e}  {order:>6}", error.step_s, error.error);
    }
    arguments
        .destinations
        .write(&errors, &errors, || chart(&errors, time_s).svg())?;
    Ok(Outcome::Success)
}
