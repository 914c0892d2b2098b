//! `sim-host poincare`: Poincaré section after the transient.

use super::outcome::Outcome;
use super::output::Destinations;
use super::settled::{SettledRun, title};
use anyhow::{Context, ensure};
use clap::ValueEnum;
use dynamics::component::{Component, panel_of_states};
use dynamics::poincare::{crossings, range};
use dynamics::section::{Crossing, Direction, Section};
use dynamics::words::counted;
use plot::chart::{Chart, Look, Panel};
use serde::Serialize;

/// Compute a Poincaré section after the transient: the states at which one component crosses a
/// value.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host poincare --rpm 1750 --time 2000 --figure poincare.svg
  sim-host poincare --rpm 1840 --section yaw_rate --at 0 --direction rising \\
      --out period3.csv
  sim-host poincare --section sideslip --x yaw_rate --y steering_rate \\
      --time 500 --figure section.svg

Components: sideslip (beta), yaw_rate (gamma), steering_angle (delta_f), steering_rate (delta_f_dot).")]
pub struct Arguments {
    #[command(flatten)]
    run: SettledRun,
    /// Component that defines the section
    #[arg(long, value_name = "COMPONENT", default_value = "yaw_rate")]
    section: Component,
    /// Its value on the section, in its unit [default: the middle of its range in the run]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    at: Option<f64>,
    /// Direction of the crossing
    #[arg(long, value_enum, default_value = "rising")]
    direction: Sense,
    /// Component on the horizontal axis [default: the first that is not the section's]
    #[arg(long, value_name = "COMPONENT")]
    x: Option<Component>,
    /// Component on the vertical axis [default: the next one]
    #[arg(long, value_name = "COMPONENT")]
    y: Option<Component>,
    #[command(flatten)]
    destinations: Destinations,
}

/// [`Direction`] as an option.
#[derive(Clone, Copy, ValueEnum)]
enum Sense {
    /// Upwards
    Rising,
    /// Downwards
    Falling,
    /// Either
    Both,
}

#[derive(Serialize)]
struct Row {
    time_s: f64,
    sideslip_rad: f64,
    yaw_rate_rad_per_s: f64,
    steering_angle_rad: f64,
    steering_rate_rad_per_s: f64,
    rising: bool,
}

impl From<Crossing> for Row {
    fn from(crossing: Crossing) -> Self {
        Self {
            time_s: crossing.time_s,
            sideslip_rad: crossing.x[0],
            yaw_rate_rad_per_s: crossing.x[1],
            steering_angle_rad: crossing.x[2],
            steering_rate_rad_per_s: crossing.x[3],
            rising: crossing.rising,
        }
    }
}

#[derive(Serialize)]
struct Results {
    wheel_speed_rpm: f64,
    transient_s: f64,
    section: Section,
    mean_return_time_s: Option<f64>,
    crossings: Vec<Row>,
}

impl Arguments {
    /// The components on the axes.
    fn axes(&self) -> anyhow::Result<(Component, Component)> {
        let free = |taken: &[Component]| {
            Component::ALL
                .into_iter()
                .find(|component| !taken.contains(component))
                .expect("four components, of which three are taken at most")
        };
        let x = match (self.x, self.y) {
            (Some(x), _) => x,
            (None, Some(y)) => free(&[self.section, y]),
            (None, None) => free(&[self.section]),
        };
        let y = self.y.unwrap_or_else(|| free(&[self.section, x]));
        ensure!(
            x != y,
            "--x and --y are both {x}: must be different components"
        );
        for (option, component) in [("--x", x), ("--y", y)] {
            ensure!(
                component != self.section,
                "{option} {component}: must not be the section's component, which is the same at all points"
            );
        }
        Ok((x, y))
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let (x, y) = arguments.axes()?;
    if let Some(at) = arguments.at {
        ensure!(at.is_finite(), "--at {at}: must be a finite number");
    }
    arguments.destinations.check(arguments.run.input())?;
    let component = arguments.section;
    let value = match arguments.at {
        Some(value) => value,
        None => {
            let (low, high) = range(&scenario, arguments.run.transient, component)
                .context("no file was written")?;
            ensure!(
                high - low > 1e-9,
                "the trajectory is at rest: {component} ranges from {low} to {high} {}, so it crosses no section; no file was written",
                component.unit
            );
            0.5 * (low + high)
        }
    };
    let section = Section {
        component,
        value,
        direction: match arguments.direction {
            Sense::Rising => Direction::Rising,
            Sense::Falling => Direction::Falling,
            Sense::Both => Direction::Both,
        },
    };
    let found =
        crossings(&scenario, arguments.run.transient, &section).context("no file was written")?;
    let (first, last) = (found[0].time_s, found[found.len() - 1].time_s);
    let returns = found.len() - 1;
    let results = Results {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        transient_s: arguments.run.transient,
        section,
        mean_return_time_s: (returns > 0).then(|| (last - first) / returns as f64),
        crossings: found.iter().copied().map(Row::from).collect(),
    };
    arguments
        .destinations
        .write(&results.crossings, &results, || {
            let states = found.iter().map(|crossing| crossing.x);
            Chart {
                heading: format!("Poincar\u{e9} section \u{2013} {}", title(&scenario)),
                panels: vec![Panel {
                    caption: format!("{} of {section:.4}", counted(found.len(), "crossing")),
                    ..panel_of_states((x, y), states, Look::Dots)
                }],
            }
            .svg()
        })?;
    say!("{} of {section}", counted(found.len(), "crossing"));
    if let Some(time_s) = results.mean_return_time_s {
        say!("mean time between crossings {time_s:.6} s");
    }
    Ok(Outcome::Success)
}
