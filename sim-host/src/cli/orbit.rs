//! `sim-host orbit`: the orbit diagram.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use super::sweep::{
    RangeOptions, TransientOptions, check_interrupted, side_by_side, with_paper_regions,
    with_progress,
};
use clap::ValueEnum;
use dynamics::component::Component;
use dynamics::orbit::{self, Point, Section, Start, chart, diagram};
use dynamics::sweep::{Parameter, Timing};
use dynamics::words::counted;
use serde::Serialize;
use shared_model::Scenario;

/// Compute an orbit diagram (bifurcation diagram) over wheel speed or dither amplitude: maxima of
/// the yaw rate, or crossings of a section.
///
/// Each run starts from the scenario's initial state, or from the final state of its neighbour
/// (`--start up` or `down`), which shows hysteresis. The dither is averaged and on from the start.
/// Runs that diverge are reported as diverging and have no values.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host orbit --from 1600 --to 1900 --step 1 \\
      --out orbit.csv --figure orbit.svg    # the paper's Figure 6
  sim-host orbit --over amplitude --dither square --rpm 1750 \\
      --figure orbit-square.svg             # Figure 8
  sim-host orbit --over amplitude --dither sine --from 0 --to 1.4 --step 0.005 \\
      --figure orbit-sine.svg
  sim-host orbit --start down --section steering-rate --level 0 \\
      --out orbit-down.csv")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    #[command(flatten)]
    range: RangeOptions,
    #[command(flatten)]
    transient: TransientOptions,
    /// Initial state of each run
    #[arg(long, value_enum, default_value_t = StartOption::Fixed)]
    start: StartOption,
    /// Section: the maxima of the yaw rate, or rising crossings of `--level` by a component. A
    /// crossing shows the yaw rate, a crossing of the yaw rate shows the sideslip angle
    #[arg(long, value_enum, default_value_t = SectionOption::YawRateMaxima)]
    section: SectionOption,
    /// Level of the section, rad or rad/s
    #[arg(
        long,
        value_name = "VALUE",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    level: f64,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum StartOption {
    /// The scenario's initial state
    Fixed,
    /// The final state of the next lower value
    Up,
    /// The final state of the next higher value
    Down,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SectionOption {
    /// Local maxima of the yaw rate
    YawRateMaxima,
    /// Sideslip angle, rising
    Sideslip,
    /// Yaw rate, rising
    YawRate,
    /// Steering angle, rising
    SteeringAngle,
    /// Steering rate, rising
    SteeringRate,
}

impl SectionOption {
    fn section(self, level: f64) -> Section {
        let component = match self {
            Self::YawRateMaxima => return Section::YawRateMaxima,
            Self::Sideslip => Component::SIDESLIP,
            Self::YawRate => Component::YAW_RATE,
            Self::SteeringAngle => Component::STEERING_ANGLE,
            Self::SteeringRate => Component::STEERING_RATE,
        };
        Section::Rising { component, level }
    }
}

/// Default length of a run after the transient, s.
const OBSERVED_S: f64 = 200.0;

#[derive(Serialize)]
struct Results<'a> {
    parameter: Parameter,
    section: Section,
    shown: Component,
    start: Start,
    timing: Timing,
    points: &'a [Point],
}

/// A row of the CSV.
#[derive(Serialize)]
struct Row {
    wheel_speed_rpm: f64,
    dither_amplitude_v: f64,
    outcome: &'static str,
    yaw_rate_rad_per_s: Option<f64>,
    sideslip_rad: Option<f64>,
    diverges_at_s: Option<f64>,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.run.scenario()?;
    let parameter = arguments.range.parameter();
    let values = arguments.range.values(&scenario)?;
    let timing = arguments.transient.timing(&arguments.run, OBSERVED_S)?;
    anyhow::ensure!(
        arguments.level.is_finite(),
        "--level {}: must be a finite number",
        arguments.level
    );
    let section = arguments.section.section(arguments.level);
    let (start, at_once) = match arguments.start {
        StartOption::Fixed => (Start::Fixed, side_by_side()),
        StartOption::Up => (Start::Up, 1),
        StartOption::Down => (Start::Down, 1),
    };
    arguments.destinations.check(arguments.run.config.input())?;
    let announced = &arguments.transient;
    announced.announce(values.count(), timing, &scenario, at_once)?;
    let points = with_progress(values.count(), |watch| {
        diagram(&scenario, parameter, &values, section, timing, start, watch)
    })?;
    let results = Results {
        parameter,
        section,
        shown: section.shown(),
        start,
        timing,
        points: &points,
    };
    let rows = points
        .iter()
        .flat_map(|point| rows(&scenario, parameter, section, point));
    arguments.destinations.write(rows, &results, || {
        let chart = chart(&points, parameter, section, start);
        with_paper_regions(chart, parameter).svg()
    })?;
    say!("{}", summary(&results));
    check_interrupted(points.len(), values.count())?;
    Ok(Outcome::Success)
}

fn rows(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    section: Section,
    point: &Point,
) -> Vec<Row> {
    let scenario = parameter.set(scenario, point.value);
    let row = |outcome, value: Option<f64>, diverges_at_s| Row {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        dither_amplitude_v: scenario.dither.active_amplitude_v(),
        outcome,
        yaw_rate_rad_per_s: value.filter(|_| section.shown() == Component::YAW_RATE),
        sideslip_rad: value.filter(|_| section.shown() == Component::SIDESLIP),
        diverges_at_s,
    };
    match &point.orbit {
        orbit::Outcome::Meets { values } => {
            let meeting = |&value: &f64| row("meets", Some(value), None);
            values.iter().map(meeting).collect()
        }
        orbit::Outcome::Misses => vec![row("misses", None, None)],
        orbit::Outcome::Rests { value } => vec![row("rests", Some(*value), None)],
        orbit::Outcome::Diverges { time_s } => vec![row("diverges", None, Some(*time_s))],
        orbit::Outcome::NotFollowed(_) => vec![row("not_followed", None, None)],
    }
}

fn summary(results: &Results) -> String {
    let count =
        |is: fn(&orbit::Outcome) -> bool| results.points.iter().filter(|p| is(&p.orbit)).count();
    let met = count(|o| matches!(o, orbit::Outcome::Meets { .. }));
    let rests = count(|o| matches!(o, orbit::Outcome::Rests { .. }));
    let misses = count(|o| matches!(o, orbit::Outcome::Misses));
    let diverges = count(|o| matches!(o, orbit::Outcome::Diverges { .. }));
    let not_followed = results.points.iter().find_map(|point| match point.orbit {
        orbit::Outcome::NotFollowed(end) => Some(format!("; at {}: {end}", point.value)),
        _ => None,
    });
    format!(
        "{} of {}: {met} with crossings, {misses} without; {rests} at rest, {diverges} diverging{}",
        counted(results.points.len(), "value"),
        results.parameter.name(),
        not_followed.unwrap_or_default()
    )
}
