//! `sim-host averaging`: comparison of the system under the true dither signal with the averaged
//! system.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use anyhow::ensure;
use dynamics::averaging::{Comparison, chart, compare};
use dynamics::words::Short;
use shared_model::dither::Waveform;

/// Compare the system under the true dither signal with the averaged system, as a function of the
/// dither frequency.
///
/// Each trajectory starts after a 200 s transient without dither. After a further transient of 20
/// s, 40 s are compared.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host averaging --dither square --amplitude-v 0.1
  sim-host averaging --dither sine --amplitude-v 1 --from 500 --to 20000 \\
      --points 9 --figure averaging.svg")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    /// First frequency, rad/s
    #[arg(long, value_name = "RAD_PER_S", default_value_t = 200.0)]
    from: f64,
    /// Last frequency, rad/s
    #[arg(long, value_name = "RAD_PER_S", default_value_t = 20_000.0)]
    to: f64,
    /// Number of frequencies, evenly spaced on a logarithmic scale
    #[arg(long, value_name = "NUMBER", default_value_t = 13)]
    points: u32,
    #[command(flatten)]
    destinations: Destinations,
}

/// Slower dither is not faster than the steering motion; faster dither needs a PWM rate that no
/// timer has.
const FREQUENCIES_RAD_PER_S: std::ops::RangeInclusive<f64> = 50.0..=100_000.0;
const POINTS: std::ops::RangeInclusive<u32> = 1..=200;

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let (from, to, points) = (arguments.from, arguments.to, arguments.points);
    let allowed = &FREQUENCIES_RAD_PER_S;
    ensure!(
        allowed.contains(&from) && allowed.contains(&to),
        "--from {} --to {}: both must be from {} to {} rad/s",
        Short(from),
        Short(to),
        allowed.start(),
        allowed.end()
    );
    ensure!(
        (points == 1) == (from == to),
        "--points {points} --from {} --to {}: one point needs equal ends, and more points need different ends",
        Short(from),
        Short(to)
    );
    ensure!(
        POINTS.contains(&points),
        "--points {points}: must be from {} to {}",
        POINTS.start(),
        POINTS.end()
    );
    let scenario = arguments.run.scenario()?;
    ensure!(
        scenario.dither.waveform != Waveform::None && scenario.dither.amplitude_v > 0.0,
        "the scenario has no dither to average: give --dither square or --dither sine, and --amplitude-v greater than 0"
    );
    arguments.destinations.check(arguments.run.config.input())?;
    let frequencies = frequencies(from.min(to), from.max(to), points);
    let comparisons = compare(&scenario, &frequencies)?;
    show(&comparisons);
    arguments
        .destinations
        .write(&comparisons, &comparisons, || chart(&comparisons).svg())?;
    Ok(Outcome::Success)
}

/// Frequencies evenly spaced on a logarithmic scale, including both ends.
fn frequencies(least: f64, greatest: f64, points: u32) -> Vec<f64> {
    let ratio = (greatest / least).ln() / f64::from(points.max(2) - 1);
    let mut all: Vec<f64> = (0..points)
        .map(|k| least * (ratio * f64::from(k)).exp())
        .collect();
    // Rounding may have moved the last value.
    all[points as usize - 1] = greatest;
    all
}

fn show(comparisons: &[Comparison]) {
    let percent = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.4}"));
    let count = |period: Option<usize>| period.map_or("none".into(), |n| n.to_string());
    say!("rad/s     period  averaged  cycle (%)  swing (%)");
    for comparison in comparisons {
        say!(
            "{:<9.1} {:<7} {:<9} {:>9}  {:>9}",
            comparison.frequency_rad_per_s,
            count(comparison.period),
            count(comparison.averaged_period),
            percent(comparison.cycle_difference_percent),
            percent(comparison.swing_difference_percent)
        );
    }
}
