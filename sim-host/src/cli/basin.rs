//! `sim-host basin`: basins of attraction.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use super::sweep::{Over, TransientOptions, check_interrupted, side_by_side, with_progress};
use anyhow::{Context, bail};
use dynamics::basin::{Basin, Stability, basin, chart, stability, stability_chart};
use dynamics::sweep::{Parameter, Timing, Values};
use dynamics::words::counted;
use serde::Serialize;
use shared_model::Scenario;

/// Compute basins of attraction over a grid of initial sideslip and steering angles.
///
/// The initial yaw rate and steering rate are those of the scenario. Initial states whose
/// trajectory diverges are reported as diverging. With --over, compute the basin stability: the share
/// of the same initial states that approach each kind of attractor, over the parameter.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host basin --rpm 1750 --out basin.csv --figure basin.svg
  sim-host basin --rpm 1600 --beta-from -0.4 --beta-to 0.4 --beta-step 0.02 \\
      --delta-step 0.02 --json basin.json
  sim-host basin --over speed --from 1600 --to 1700 --step 50 --beta-step 0.1 \\
      --delta-step 0.1 --out shares.csv --figure shares.svg    # basin stability")]
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
    /// Basin stability over this parameter
    #[arg(long, value_enum, requires_all = ["from", "to", "step"])]
    over: Option<Over>,
    /// Its first value, at which the steps begin, rpm or V
    #[arg(
        long,
        value_name = "VALUE",
        allow_negative_numbers = true,
        requires = "over"
    )]
    from: Option<f64>,
    /// Its last value, rpm or V
    #[arg(
        long,
        value_name = "VALUE",
        allow_negative_numbers = true,
        requires = "over"
    )]
    to: Option<f64>,
    /// Its step, rpm or V
    #[arg(
        long,
        value_name = "VALUE",
        allow_negative_numbers = true,
        requires = "over"
    )]
    step: Option<f64>,
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

#[derive(Serialize)]
struct StabilityResults<'a> {
    parameter: Parameter,
    initial_states: usize,
    timing: Timing,
    values: &'a [Stability],
}

/// A row of the CSV of a basin stability.
#[derive(Serialize)]
struct StabilityRow<'a> {
    wheel_speed_rpm: f64,
    dither_amplitude_v: f64,
    kind: String,
    steering_angle_lobe: &'a str,
    initial_states: usize,
    share: f64,
    standard_error: f64,
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
    if let Some(over) = arguments.over {
        return over_parameter(
            arguments,
            &scenario,
            over.parameter(),
            (&betas, &deltas),
            timing,
        );
    }
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

/// The shares over a parameter.
fn over_parameter(
    arguments: &Arguments,
    scenario: &Scenario<f64>,
    parameter: Parameter,
    starts: (&Values, &Values),
    timing: Timing,
) -> anyhow::Result<Outcome> {
    let range = (arguments.from, arguments.to, arguments.step);
    let (Some(from), Some(to), Some(step)) = range else {
        bail!("--over needs --from, --to and --step");
    };
    let values = Values::new(parameter.name(), from, to, step)?;
    let each = starts.0.count().saturating_mul(starts.1.count());
    let runs = each.saturating_mul(values.count());
    let announced = &arguments.transient;
    announced.announce(runs, timing, scenario, side_by_side())?;
    let found = with_progress(runs, |control| {
        stability(scenario, parameter, &values, starts, timing, control)
    })?;
    found
        .first()
        .context("interrupted before the first value was complete")?;
    let results = StabilityResults {
        parameter,
        initial_states: each,
        timing,
        values: &found,
    };
    let rows = found.iter().flat_map(|one| {
        let at = parameter.set(scenario, one.value);
        one.shares.iter().map(move |share| StabilityRow {
            wheel_speed_rpm: at.run.wheel_speed_rpm,
            dither_amplitude_v: at.dither.amplitude_v,
            kind: share.kind.to_string(),
            steering_angle_lobe: share.lobe,
            initial_states: share.starts,
            share: share.share,
            standard_error: share.standard_error,
        })
    });
    arguments
        .destinations
        .write(rows, &results, || stability_chart(&found, parameter).svg())?;
    for one in &found {
        let shares = one.shares.iter().map(|share| {
            format!(
                "{:.3} +- {:.3} {}, steering angle {}",
                share.share, share.standard_error, share.kind, share.lobe
            )
        });
        let shares: Vec<String> = shares.collect();
        say!("{} {}: {}", one.value, parameter.unit(), shares.join("; "));
    }
    check_interrupted(found.len(), values.count())?;
    Ok(Outcome::Success)
}
