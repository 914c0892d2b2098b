//! `sim-host lyapunov`: Lyapunov exponents over the wheel speed.

use super::options::RunOptions;
use super::outcome::{COULD_NOT_RUN, Outcome};
use super::output::Destinations;
use super::sweep::SpeedRange;
use anyhow::ensure;
use clap::ValueEnum;
use dynamics::flow::{Flow, VehicleFlow};
use dynamics::method::{Estimate, Method, chart, estimates};
use dynamics::sweep::{Parameter, RunControl, Timing, scenarios};
use dynamics::synchronisation::Search;
use dynamics::words::{Short, counted};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use shared_model::Scenario;
use std::time::{Duration, Instant};

/// Estimate Lyapunov exponents at one speed or over a range of speeds, by three independent
/// methods.
///
/// A positive largest exponent indicates chaos. The dither, if any, is averaged and on from the
/// start. The results report trajectories that diverge and searches without a result. On Ctrl-C,
/// points in progress are finished and the results so far are written.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host lyapunov --rpm 1750 --method all     # three methods side by side
  sim-host lyapunov --rpm 1750 --spectrum       # all four exponents
  sim-host lyapunov --from 1500 --to 1950 --step 5 \\
      --out exponents.csv --figure exponents.svg
  sim-host lyapunov --rpm 1750 --dither square --amplitude-v 0.1
  sim-host lyapunov --rpm 1600 --method printed-response    # equation (20)")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    #[command(flatten)]
    range: SpeedRange,
    /// Method for the largest exponent
    #[arg(long, value_enum, default_value = "tangent")]
    method: Choice,
    /// Estimate all four exponents by tangent dynamics, in addition to --method two-particle or
    /// synchronisation
    #[arg(long)]
    spectrum: bool,
    /// Initial transient to discard, s; the run is 1200 s including it, unless --time is given
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 200.0,
        allow_negative_numbers = true
    )]
    transient: f64,
    /// Synchronisation: weakest coupling of the search, 1/s
    #[arg(long, value_name = "PER_S", default_value_t = Search::default().from_per_s, allow_negative_numbers = true)]
    coupling_from: f64,
    /// Synchronisation: strongest coupling of the search, 1/s
    #[arg(long, value_name = "PER_S", default_value_t = Search::default().to_per_s, allow_negative_numbers = true)]
    coupling_to: f64,
    /// Synchronisation: tolerance of the bisection, 1/s
    #[arg(long, value_name = "PER_S", default_value_t = Search::default().tolerance_per_s, allow_negative_numbers = true)]
    tolerance: f64,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Choice {
    /// Tangent dynamics
    Tangent,
    /// Two-particle method: separation of two neighbouring trajectories
    #[value(alias = "twin")]
    TwoParticle,
    /// Least coupling that synchronises two copies: the paper's method, equations (17) to (19)
    Synchronisation,
    /// All three
    All,
    /// Equation (20) as printed: a conditional exponent, not the largest exponent
    PrintedResponse,
}

/// Default length of the run, s.
const TIME_S: f64 = 1200.0;
/// Least length after the transient, about eighty cycles, for a meaningful standard error, s.
const LEAST_OBSERVED_S: f64 = 100.0;
/// Estimated work above which the estimate is printed, s.
const ANNOUNCED_S: f64 = 10.0;

#[derive(Serialize)]
struct Results<'a> {
    transient_s: f64,
    observed_s: f64,
    search: Search,
    complete: bool,
    exponents: &'a [Estimate],
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenarios = speeds(arguments)?;
    let timing = timing(arguments)?;
    let search = Search {
        from_per_s: arguments.coupling_from,
        to_per_s: arguments.coupling_to,
        tolerance_per_s: arguments.tolerance,
    }
    .validated()?;
    arguments.destinations.check(arguments.run.config.input())?;
    let methods = methods(arguments);
    let points = scenarios.len() * methods.len();
    announce(&scenarios, &methods, timing, search)?;
    let (estimates, done) = measure(&scenarios, &methods, timing, search)?;
    show(&estimates);
    let results = Results {
        transient_s: timing.transient_s,
        observed_s: timing.observed_s,
        search,
        complete: done == points,
        exponents: &estimates,
    };
    arguments.destinations.write(&estimates, &results, || {
        chart(&estimates, &methods, timing).svg()
    })?;
    if done < points {
        eprintln!(
            "interrupted after {done} of {}; the results so far are printed and written to the requested files",
            counted(points, "point")
        );
        return Ok(Outcome::Code(COULD_NOT_RUN));
    }
    Ok(Outcome::Success)
}

/// One validated scenario for each speed.
fn speeds(arguments: &Arguments) -> anyhow::Result<Vec<Scenario<f64>>> {
    let scenario = arguments.run.scenario()?;
    let values = arguments.range.values(&scenario)?;
    Ok(scenarios(&scenario, Parameter::Speed, &values)?)
}

fn timing(arguments: &Arguments) -> anyhow::Result<Timing> {
    let time_s = arguments.run.time.unwrap_or(TIME_S);
    let timing = Timing::new(arguments.transient, time_s)?;
    ensure!(
        timing.observed_s >= LEAST_OBSERVED_S,
        "--time {} with --transient {} leaves {} s after the transient: must be at least {LEAST_OBSERVED_S} s",
        Short(time_s),
        Short(timing.transient_s),
        Short(timing.observed_s)
    );
    Ok(timing)
}

fn methods(arguments: &Arguments) -> Vec<Method> {
    let tangent = if arguments.spectrum {
        Method::Spectrum
    } else {
        Method::Tangent
    };
    let alone = |method| {
        let spectrum = arguments.spectrum.then_some(Method::Spectrum);
        spectrum.into_iter().chain([method]).collect()
    };
    match arguments.method {
        Choice::Tangent => vec![tangent],
        Choice::All => vec![tangent, Method::Twin, Method::Synchronisation],
        Choice::TwoParticle => alone(Method::Twin),
        Choice::Synchronisation => alone(Method::Synchronisation),
        Choice::PrintedResponse => alone(Method::PrintedResponse),
    }
}

/// Prints the estimated time of long work, from the measured time of some steps.
fn announce(
    scenarios: &[Scenario<f64>],
    methods: &[Method],
    timing: Timing,
    search: Search,
) -> anyhow::Result<()> {
    const TRIAL_STEPS: u32 = 2000;
    let flow = VehicleFlow::new(&scenarios[0])?;
    let mut x = flow.start();
    let start = Instant::now();
    for _ in 0..TRIAL_STEPS {
        x = std::hint::black_box(flow.step(&x));
    }
    let step = start.elapsed().as_secs_f64() / f64::from(TRIAL_STEPS);
    let cost_s = |method: &Method| method.cost_s(timing, search);
    let one_speed = methods.iter().map(cost_s).sum::<f64>() / flow.step_s();
    let threads = rayon::current_num_threads() as f64;
    let seconds = one_speed * step * scenarios.len() as f64 / threads;
    if seconds > ANNOUNCED_S {
        eprintln!(
            "{}, {} s each: about {seconds:.0} s on {}; Ctrl-C keeps the results so far",
            counted(scenarios.len(), "speed"),
            timing.time_s(),
            counted(threads, "thread")
        );
    }
    Ok(())
}

/// The estimates by speed and method, and the number of completed points.
fn measure(
    scenarios: &[Scenario<f64>],
    methods: &[Method],
    timing: Timing,
    search: Search,
) -> anyhow::Result<(Vec<Estimate>, usize)> {
    let bar = ProgressBar::new((scenarios.len() * methods.len()) as u64).with_style(
        ProgressStyle::with_template("{elapsed_precise} [{bar:40}] {pos}/{len} points, {eta} left")
            .expect("the template is valid")
            .progress_chars("=> "),
    );
    bar.enable_steady_tick(Duration::from_millis(200));
    let watch = RunControl {
        stop: &interrupt::REQUESTED,
        done: &|| bar.inc(1),
    };
    let by_method = methods
        .iter()
        .map(|&method| estimates(scenarios, method, timing, search, watch))
        .collect::<Result<Vec<_>, _>>()?;
    bar.finish_and_clear();
    let of_speed = |k: usize| by_method.iter().filter_map(move |made| made[k].clone());
    let points: Vec<Vec<Estimate>> = (0..scenarios.len()).flat_map(of_speed).collect();
    let done = points.len();
    Ok((points.into_iter().flatten().collect(), done))
}

fn show(estimates: &[Estimate]) {
    say!(
        "{:>8}  {:<22}{:>2}  {:>9}  {:>8}  finding",
        "rpm",
        "method",
        "",
        "1/s",
        "error"
    );
    for estimate in estimates {
        let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.4}"));
        let reason = estimate
            .reason
            .as_deref()
            .map(|reason| format!(": {reason}"));
        say!(
            "{:>8}  {:<22}{:>2}  {:>9}  {:>8}  {}{}",
            estimate.wheel_speed_rpm,
            estimate.method.name(),
            estimate.index,
            number(estimate.exponent_per_s),
            number(estimate.error_per_s()),
            estimate.finding.words(),
            reason.unwrap_or_default()
        );
    }
}
