//! `sim-host tires`: cornering force of the tyres.

use super::options::ConfigOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use anyhow::ensure;
use dynamics::characteristics::{TireRow, tires, tires_chart};
use dynamics::config::validate;
use dynamics::words::Short;
use serde::Serialize;

/// Compute the cornering force as a function of the slip angle (Figure 2): both roads of Table 1,
/// front and rear, Magic Formula and cubic tyre; also the configured road, if it differs.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host tires --figure fig2.svg
  sim-host tires --slip-max 0.5 --out tires.csv --json tires.json
  sim-host config > vehicle.toml
  sim-host tires --config vehicle.toml --figure tires.svg")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
    /// Greatest slip angle, rad
    #[arg(
        long,
        value_name = "RAD",
        default_value_t = 0.3,
        allow_negative_numbers = true
    )]
    slip_max: f64,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Serialize)]
struct Results<'a> {
    slip_max_rad: f64,
    forces: &'a [TireRow],
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.config.load()?;
    validate(&scenario)?;
    let slip_max_rad = greatest_angle("--slip-max", arguments.slip_max)?;
    arguments.destinations.check(arguments.config.input())?;
    let rows = tires(&scenario, slip_max_rad);
    let results = Results {
        slip_max_rad,
        forces: &rows,
    };
    arguments
        .destinations
        .write(&rows, &results, || tires_chart(&scenario, &rows).svg())?;
    for chunk in rows.chunk_by(|a, b| (a.road, a.axle) == (b.road, b.axle)) {
        let greatest = chunk
            .iter()
            .max_by(|a, b| a.magic_formula_n.total_cmp(&b.magic_formula_n));
        if let Some(row) = greatest {
            say!(
                "{} road, {}: Magic Formula at most {:.1} N, at {:.4} rad",
                row.road.replace('_', "-"),
                row.axle,
                row.magic_formula_n,
                row.slip_angle_rad
            );
        }
    }
    Ok(Outcome::Success)
}

/// The validated end of an axis of angles.
pub fn greatest_angle(option: &str, angle_rad: f64) -> anyhow::Result<f64> {
    let (least, most) = (1e-4, std::f64::consts::FRAC_PI_2);
    ensure!(
        angle_rad >= least && angle_rad <= most,
        "{option} {}: must be from {least} to {most:.4} rad",
        Short(angle_rad)
    );
    Ok(angle_rad)
}
