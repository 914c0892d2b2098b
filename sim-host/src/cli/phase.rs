//! `sim-host phase`: phase portrait after the transient.

use super::outcome::Outcome;
use super::output::Destinations;
use super::settled::{SettledRun, title};
use dynamics::component::{Component, panel_of_states};
use plot::chart::{Chart, Look};
use serde::Serialize;

/// Draw a phase portrait after the transient: one component of the state against another.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host phase --rpm 1750 --figure phase.svg
  sim-host phase --rpm 1750 --dither square --amplitude-v 0.1 \\
      --figure fig12a.svg
  sim-host phase --x steering_angle --y steering_rate --time 60 \\
      --out phase-steering.csv --figure phase-steering.svg

Components: sideslip (beta), yaw_rate (gamma), steering_angle (delta_f), steering_rate (delta_f_dot).")]
pub struct Arguments {
    #[command(flatten)]
    run: SettledRun,
    /// Component on the horizontal axis
    #[arg(long, value_name = "COMPONENT", default_value = "sideslip")]
    x: Component,
    /// Component on the vertical axis
    #[arg(long, value_name = "COMPONENT", default_value = "yaw_rate")]
    y: Component,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Serialize)]
struct Row {
    time_s: f64,
    sideslip_rad: f64,
    yaw_rate_rad_per_s: f64,
    steering_angle_rad: f64,
    steering_rate_rad_per_s: f64,
}

#[derive(Serialize)]
struct Results<'a> {
    wheel_speed_rpm: f64,
    transient_s: f64,
    x: Component,
    y: Component,
    x_range: (f64, f64),
    y_range: (f64, f64),
    states: &'a [Row],
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let (x, y) = (arguments.x, arguments.y);
    anyhow::ensure!(
        x != y,
        "--x and --y are both {x}: must be different components"
    );
    arguments.destinations.check(arguments.run.input())?;
    let trace = arguments.run.trace(&scenario)?;
    let rows: Vec<Row> = trace
        .states
        .iter()
        .enumerate()
        .map(|(k, state)| Row {
            time_s: trace.time_s(k),
            sideslip_rad: state.x[0],
            yaw_rate_rad_per_s: state.x[1],
            steering_angle_rad: state.x[2],
            steering_rate_rad_per_s: state.x[3],
        })
        .collect();
    let results = Results {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        transient_s: arguments.run.transient,
        x,
        y,
        x_range: trace.range(x.index, 0),
        y_range: trace.range(y.index, 0),
        states: &rows,
    };
    arguments.destinations.write(&rows, &results, || {
        let states = trace.states.iter().map(|state| state.x);
        Chart {
            heading: format!("Phase portrait \u{2013} {}", title(&scenario)),
            panels: vec![panel_of_states((x, y), states, Look::Line(0))],
        }
        .svg()
    })?;
    for (component, (low, high)) in [(x, results.x_range), (y, results.y_range)] {
        say!("{component}: from {low} to {high} {}", component.unit);
    }
    Ok(Outcome::Success)
}
