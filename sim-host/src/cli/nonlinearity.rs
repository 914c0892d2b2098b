//! `sim-host nonlinearity`: effective nonlinearities under dither.

use super::options::{ConfigOptions, waveform};
use super::outcome::Outcome;
use super::output::Destinations;
use super::tires::greatest_angle;
use anyhow::ensure;
use dynamics::characteristics::{NonlinearityRow, nonlinearities, nonlinearities_chart};
use dynamics::config::validate;
use serde::Serialize;
use shared_model::dither::Waveform;

/// Compare effective and original nonlinearities (Figures 9 to 11 and 14 to 16): front tyre, rear
/// tyre, and the sign function of the friction as printed.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host nonlinearity --dither square --amplitude-v 0.1 --figure figs9-11.svg
  sim-host nonlinearity --dither sine --amplitude-v 1 --figure figs14-16.svg
  sim-host nonlinearity --dither sine --amplitude-v 1 --max 0.2 \\
      --out nonlinearity.csv")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
    /// Waveform of the dither: square or sine
    #[arg(long, value_name = "WAVEFORM", value_parser = waveform)]
    dither: Option<Waveform>,
    /// Amplitude of the dither, V
    #[arg(long, value_name = "VOLTS", allow_negative_numbers = true)]
    amplitude_v: Option<f64>,
    /// Greatest slip and steering angle, rad
    #[arg(
        long,
        value_name = "RAD",
        default_value_t = 0.3,
        allow_negative_numbers = true
    )]
    max: f64,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Serialize)]
struct Results<'a> {
    waveform: Waveform,
    amplitude_v: f64,
    amplitude_rad: f64,
    nonlinearities: &'a [NonlinearityRow],
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut scenario = arguments.config.load()?;
    let dither = &mut scenario.dither;
    dither.waveform = arguments.dither.unwrap_or(dither.waveform);
    dither.amplitude_v = arguments.amplitude_v.unwrap_or(dither.amplitude_v);
    validate(&scenario)?;
    let amplitude_rad = scenario.dither.amplitude_rad();
    ensure!(
        amplitude_rad > 0.0,
        "the scenario has no dither: give --dither square or --dither sine, and --amplitude-v greater than 0"
    );
    let greatest = greatest_angle("--max", arguments.max)?;
    arguments.destinations.check(arguments.config.input())?;
    let rows = nonlinearities(&scenario, greatest);
    let results = Results {
        waveform: scenario.dither.waveform,
        amplitude_v: scenario.dither.amplitude_v,
        amplitude_rad,
        nonlinearities: &rows,
    };
    arguments.destinations.write(&rows, &results, || {
        nonlinearities_chart(&scenario, &rows).svg()
    })?;
    let dither = &scenario.dither;
    say!(
        "{:?} dither of {} V, {amplitude_rad:.6} rad ahead of the nonlinearities",
        dither.waveform,
        dither.amplitude_v
    );
    Ok(Outcome::Success)
}
