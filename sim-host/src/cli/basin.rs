//! `sim-host basin`: basins of attraction.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use super::sweep::{TransientOptions, check_interrupted, side_by_side, with_progress};
use dynamics::basin::{Basin, basin, chart};
use dynamics::sweep::{Timing, Values};
use dynamics::words::counted;
use serde::Serialize;

/// Compute basins of attraction over a grid of initial sideslip and steering angles.
///
/// The initial yaw rate and steering rate are those of the scenario. Initial states whose
/// trajectory diverges are reported as diverging.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host basin --rpm 1750 --out basin.csv --figure basin.svg
  sim-host basin --rpm 1600 --beta-from -0.4 --beta-to 0.4 --beta-step 0.02 \\
      --delta-step 0.02 --json basin.json")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    /// First initial sideslip angle, at which the steps begin, rad
    #[arg(long, value_name = "RAD", default_value_t = -0.3, allow_negative_numbers = true)]
    beta_from: f64,
    /// Last initial sideslip angle, rad
    #[arg(
        long,
        value_name = "RAD",
        default_value_t = 0.3,
        allow_negative_numbers = true
    )]
    beta_to: f64,
    /// Step of the sideslip angle, rad
    #[arg(
        long,
        value_name = "RAD",
        default_value_t = 0.03,
        allow_negative_numbers = true
    )]
    beta_step: f64,
    /// First initial steering angle, at which the steps begin, rad
    #[arg(long, value_name = "RAD", default_value_t = -0.6, allow_negative_numbers = true)]
    delta_from: f64,
    /// Last initial steering angle, rad
    #[arg(
        long,
        value_name = "RAD",
        default_value_t = 0.6,
        allow_negative_numbers = true
    )]
    delta_to: f64,
    /// Step of the steering angle, rad
    #[arg(
        long,
        value_name = "RAD",
        default_value_t = 0.05,
        allow_negative_numbers = true
    )]
    delta_step: f64,
    #[command(flatten)]
    transient: TransientOptions,
    #[command(flatten)]
    destinations: Destinations,
}

/// Default length of a run after the transient, s.
const OBSERVED_S: f64 = 200.0;

#[derive(Serialize)]
struct Results<'a> {
    wheel_speed_rpm: f64,
    timing: Timing,
    #[serde(flatten)]
    basin: &'a Basin,
}

/// A row of the CSV.
#[derive(Serialize)]
struct Row {
    sideslip_rad: f64,
    steering_angle_rad: f64,
    attractor: usize,
    kind: String,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let (from, to) = (arguments.beta_from, arguments.beta_to);
    let betas = Values::new("sideslip angle (rad)", from, to, arguments.beta_step)?;
    let (from, to) = (arguments.delta_from, arguments.delta_to);
    let deltas = Values::new("steering angle (rad)", from, to, arguments.delta_step)?;
    let timing = arguments.transient.timing(&arguments.run, OBSERVED_S)?;
    arguments.destinations.check(arguments.run.config.input())?;
    let runs = betas.count().saturating_mul(deltas.count());
    let announced = &arguments.transient;
    announced.announce(runs, timing, &scenario, side_by_side())?;
    let basin = with_progress(runs, |watch| {
        basin(&scenario, &betas, &deltas, timing, watch)
    })?;
    let results = Results {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        timing,
        basin: &basin,
    };
    let rows = basin.cells.iter().map(|cell| Row {
        sideslip_rad: cell.sideslip_rad,
        steering_angle_rad: cell.steering_angle_rad,
        attractor: cell.attractor,
        kind: basin.attractors[cell.attractor].kind.to_string(),
    });
    arguments.destinations.write(rows, &results, || {
        chart(&basin, results.wheel_speed_rpm).svg()
    })?;
    for (k, attractor) in basin.attractors.iter().enumerate() {
        let cells = basin.cells.iter().filter(|c| c.attractor == k).count();
        say!(
            "attractor {k}: {} ({})",
            attractor.describe(),
            counted(cells, "initial state")
        );
    }
    check_interrupted(basin.cells.len(), runs)?;
    Ok(Outcome::Success)
}
