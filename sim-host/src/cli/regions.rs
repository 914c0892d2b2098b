//! `sim-host regions`: regimes along a sweep, and the edges between them.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use super::sweep::{
    RangeOptions, TransientOptions, check_interrupted, side_by_side, with_paper_regions,
    with_progress,
};
use anyhow::ensure;
use dynamics::regions::{Regions, Sample, chart, coexisting, regions};
use dynamics::sweep::{Parameter, Timing, mirrored};
use dynamics::words::{Short, counted};
use serde::Serialize;
use shared_model::Scenario;

/// Classify regimes (equilibrium, period-n, chaos) over wheel speed or dither amplitude, and bisect
/// the edges between them.
///
/// The period is that of the yaw rate's maxima that stand out by 1 % of its range, as the paper counts; the
/// CSV has the number of cycles too, which is what bifurcates. A trajectory that has not settled is decided
/// by Newton's method: by the stable orbit or equilibrium that it approaches. Where an orbit ends at an
/// edge or loses its stability, continuation locates the bifurcation. Chaos requires a largest Lyapunov exponent that
/// exceeds three standard errors and the resolution of the run. If the two criteria disagree, the
/// regime is undecided. Chaos whose maxima visit n separate bands in turn is distinguished from
/// one-band chaos. The sweep is run from the scenario's initial state and from the mirrored one, on
/// the other lobe of the steering angle. Coexisting attractors are reported.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host regions --from 1600 --to 1900 --step 5 \\
      --figure regions.svg                  # the paper's regions I to IV
  sim-host regions --from 1820 --to 1860 --step 1 --width 0.1 \\
      --transient 1000 --time 2000 --json regions.json
  sim-host regions --over amplitude --dither square \\
      --from 0 --to 0.14 --step 0.002 --out regions-square.csv")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    #[command(flatten)]
    range: RangeOptions,
    /// Tolerance of an edge [default: 0.5 rpm; 0.0005 V]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    width: Option<f64>,
    #[command(flatten)]
    transient: TransientOptions,
    #[command(flatten)]
    destinations: Destinations,
}

/// Default length of a run after the transient, s.
const OBSERVED_S: f64 = 400.0;
/// A smaller width only resolves rounding.
const LEAST_WIDTH: f64 = 1e-9;

#[derive(Serialize)]
struct Results {
    parameter: Parameter,
    timing: Timing,
    width: f64,
    sweeps: Vec<Sweep>,
    /// Values at which the two initial states lead to different attractors.
    coexisting_at: Vec<f64>,
}

#[derive(Serialize)]
struct Sweep {
    start: &'static str,
    #[serde(flatten)]
    found: Regions,
}

/// A row of the CSV.
#[derive(Serialize)]
struct Row<'a> {
    start: &'a str,
    wheel_speed_rpm: f64,
    dither_amplitude_v: f64,
    kind: String,
    steering_angle_lobe: &'a str,
    period_residual: Option<f64>,
    cycle_s: Option<f64>,
    cycles: Option<usize>,
    exponent_per_s: Option<f64>,
    exponent_threshold_per_s: Option<f64>,
    yaw_rate_min_rad_per_s: Option<f64>,
    yaw_rate_max_rad_per_s: Option<f64>,
    diverges_at_s: Option<f64>,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let parameter = arguments.range.parameter();
    let values = arguments.range.values(&scenario)?;
    let timing = arguments.transient.timing(&arguments.run, OBSERVED_S)?;
    let width = arguments.width.unwrap_or(parameter.edge_width());
    ensure!(
        width >= LEAST_WIDTH && width.is_finite(),
        "--width {}: must be a finite number of at least {LEAST_WIDTH} {}",
        Short(width),
        parameter.unit()
    );
    arguments.destinations.check(arguments.run.config.input())?;
    let runs = 2 * values.count();
    let announced = &arguments.transient;
    announced.announce(runs, timing, &scenario, side_by_side())?;
    let starts = [("given", scenario), ("mirrored", mirrored(&scenario))];
    let sweeps = with_progress(runs, |watch| {
        let sweep = |(start, scenario)| {
            let found = regions(&scenario, parameter, &values, width, timing, watch)?;
            anyhow::Ok(Sweep { start, found })
        };
        starts.into_iter().map(sweep).collect::<Result<Vec<_>, _>>()
    })?;
    let coexisting_at = coexisting(&scenario, parameter, &sweeps[0].found, &sweeps[1].found)?;
    let results = Results {
        parameter,
        timing,
        width,
        sweeps,
        coexisting_at,
    };
    let rows = results.sweeps.iter().flat_map(|sweep| {
        let row = |sample| row(&scenario, parameter, sweep.start, sample);
        sweep.found.samples.iter().map(row)
    });
    arguments.destinations.write(rows, &results, || {
        let sweeps = results.sweeps.iter();
        let sweeps: Vec<_> = sweeps.map(|sweep| (sweep.start, &sweep.found)).collect();
        with_paper_regions(chart(&sweeps, parameter), parameter).svg()
    })?;
    show(&results);
    let done = results.sweeps.iter().map(|s| s.found.samples.len()).sum();
    check_interrupted(done, runs.max(done))?;
    Ok(Outcome::Success)
}

fn row<'a>(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    start: &'a str,
    sample: &'a Sample,
) -> Row<'a> {
    let scenario = parameter.set(scenario, sample.value);
    let attractor = &sample.attractor;
    let (low, high) = attractor.yaw_rates_rad_per_s();
    let stays = attractor.kind.stays();
    Row {
        start,
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        dither_amplitude_v: scenario.dither.active_amplitude_v(),
        kind: attractor.kind.to_string(),
        steering_angle_lobe: if stays { attractor.lobe() } else { "" },
        period_residual: attractor.residual,
        cycle_s: attractor.cycle_s,
        cycles: attractor.cycles,
        exponent_per_s: attractor.exponent_per_s,
        exponent_threshold_per_s: attractor.exponent_threshold_per_s,
        yaw_rate_min_rad_per_s: stays.then_some(low),
        yaw_rate_max_rad_per_s: stays.then_some(high),
        diverges_at_s: attractor.diverges_at_s,
    }
}

fn show(results: &Results) {
    let unit = results.parameter.unit();
    for sweep in &results.sweeps {
        say!("from the {} initial state:", sweep.start);
        for region in &sweep.found.regions {
            let inside = |s: &&Sample| (region.from..=region.to).contains(&s.value);
            let mut lobes: Vec<_> = sweep.found.samples.iter().filter(inside).collect();
            lobes.dedup_by_key(|sample| sample.attractor.lobe());
            let lobes: Vec<_> = lobes.iter().map(|s| s.attractor.lobe()).collect();
            say!(
                "  {:10.4} to {:10.4} {unit}  {}, steering angle {}",
                region.from,
                region.to,
                region.kind,
                lobes.join(" or ")
            );
        }
        for edge in &sweep.found.edges {
            let what = match (edge.bifurcation, edge.is_inflection) {
                (Some(at), _) => format!(
                    "; {} at {:.6} +- {:.0e} {unit}",
                    at.kind, at.value, at.error
                ),
                (None, true) => "; an inflection of the same orbit, no bifurcation".into(),
                (None, false) => String::new(),
            };
            say!(
                "  edge from {:.4} to {:.4} {unit}: {} below, {} above{what}",
                edge.lower,
                edge.upper,
                edge.below,
                edge.above
            );
        }
    }
    let at = &results.coexisting_at;
    match (at.first(), at.last()) {
        (Some(first), Some(last)) => say!(
            "two attractors coexist at {} from {first} to {last} {unit}",
            counted(at.len(), "value")
        ),
        _ => say!("both initial states lead to the same attractor at every value"),
    }
}
