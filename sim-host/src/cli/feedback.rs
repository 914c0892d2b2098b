//! `sim-host feedback`: unstable orbits held by delayed feedback through the motor.

use super::feedback_table;
use super::options::{ConfigOptions, load_file};
use super::outcome::Outcome;
use super::output::{Destinations, check, named};
use super::sweep::{check_interrupted, with_progress};
use anyhow::{bail, ensure};
use dynamics::component::Component;
use dynamics::config::validate;
use dynamics::delayed_feedback::{
    Cell, CellRow, Conditions, Feedback, Held, LONGEST_TICKS, Mixed, Plan, Point, PointRow, chart,
    over_speed, region, region_chart,
};
use dynamics::sweep::{Parameter, SweepError, Values, scenarios};
use dynamics::words::Short;
use serde::Serialize;
use shared_model::Scenario;
use std::path::PathBuf;

/// Hold the unstable orbit of one cycle by delayed feedback of a sensor through the motor.
///
/// The torque K (y(t - T) - y(t)) is added to the motor's constant one at the control rate, T being the
/// period of the orbit. At each speed the orbit is computed, the gain K with the least multiplier is
/// chosen from those tried, and the trajectory from the scenario's initial state is simulated, the
/// feedback being switched on after --free. Beside it: an impulse per cycle that holds the same orbit, and
/// feedback of the whole state that leads to rest, both by the exact state. The torque is about the steering axis. The dither, if there
/// is one, is averaged. With --table the periods and gains that the ECU carries are computed instead.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host feedback --from 1650 --to 1750 --step 50
  sim-host feedback --step 40 --out feedback.csv --figure feedback.svg
  sim-host feedback --from 1750 --to 1750 --delay-error 0.01 --adaptation 1
  sim-host feedback --from 1750 --to 1750 --noise 0.01 --latency 2
  sim-host feedback --from 1750 --to 1750 --region --gain-from 2 \\
      --gain-to 12 --gain-step 2 --time 100 --out region.csv --figure region.svg
  sim-host feedback --from 1750 --to 1750 --signal steering_angle \\
      --gain-from -100 --gain-to 100 --gain-step 5
  sim-host feedback --from 1560 --step 20 --table table.rs  # for the ECU")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
    /// First wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 1640.0,
        allow_negative_numbers = true
    )]
    from: f64,
    /// Last wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 2000.0,
        allow_negative_numbers = true
    )]
    to: f64,
    /// Step of the wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 40.0,
        allow_negative_numbers = true
    )]
    step: f64,
    /// Signal that is fed back
    #[arg(long, value_name = "COMPONENT", default_value = "yaw_rate")]
    signal: Component,
    /// Signal that is added to it with a weight, as in steering_rate=-0.5
    #[arg(long, value_name = "COMPONENT=WEIGHT", allow_hyphen_values = true)]
    mix: Option<Mixed>,
    /// Least gain tried, N m s/rad for rates, N m/rad for angles
    #[arg(
        long,
        value_name = "GAIN",
        default_value_t = 0.5,
        allow_negative_numbers = true
    )]
    gain_from: f64,
    /// Greatest gain tried
    #[arg(
        long,
        value_name = "GAIN",
        default_value_t = 12.0,
        allow_negative_numbers = true
    )]
    gain_to: f64,
    /// Step of the gain
    #[arg(
        long,
        value_name = "GAIN",
        default_value_t = 0.5,
        allow_negative_numbers = true
    )]
    gain_step: f64,
    /// Weight of a past period relative to the one after it, from 0 to less than 1
    #[arg(
        long,
        value_name = "SHARE",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    memory: f64,
    /// Greatest torque either way, N m
    #[arg(
        long,
        value_name = "NM",
        default_value_t = 8.0,
        allow_negative_numbers = true
    )]
    limit: f64,
    /// Error of the delay in the simulation, s [default: 0; with --region the greatest, 0.02]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    delay_error: Option<f64>,
    /// Rate at which the delay adapts to the orbit's period while the torque is less than a quarter of
    /// --limit, ticks per square of the signal's unit
    #[arg(
        long,
        value_name = "RATE",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    adaptation: f64,
    /// Control ticks from the measurement to the torque, beside the one in which it is computed
    #[arg(long, value_name = "TICKS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=100))]
    latency: u32,
    /// Standard deviation of the sensor's noise in the simulation, in the signal's unit
    #[arg(
        long,
        value_name = "DEVIATION",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    noise: f64,
    /// TOML file of the vehicle that is simulated; orbits, delays and gains are those of the scenario
    /// [default: the scenario]
    #[arg(long, value_name = "FILE")]
    plant: Option<PathBuf>,
    /// Write the ECU's periods and gains at these speeds, without and with its dither, as Rust source, the
    /// module `shared_model::delayed_feedback::table`; without simulation
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = [
            "region", "plant", "memory", "signal", "mix", "limit", "delay_error", "adaptation", "noise",
            "free", "time", "out", "json", "figure",
        ]
    )]
    table: Option<PathBuf>,
    /// At each speed, simulate all gains and 21 errors of the delay, up to --delay-error either way
    #[arg(long)]
    region: bool,
    /// Time before the feedback is switched on, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 100.0,
        allow_negative_numbers = true
    )]
    free: f64,
    /// Time with it, of which the torque of the last minute is reported, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 300.0,
        allow_negative_numbers = true
    )]
    time: f64,
    #[command(flatten)]
    destinations: Destinations,
}

/// Gains tried at each speed, and speeds.
const MOST_GAINS: usize = 1000;
const MOST_SPEEDS: usize = 1000;
/// Control rate at which the delay line has room for any orbit's period, Hz: 4 s.
const MOST_RATE_HZ: f64 = 2000.0;
/// Times of a simulation, s.
const FREE_S: std::ops::RangeInclusive<f64> = 10.0..=10_000.0;
const TIME_S: std::ops::RangeInclusive<f64> = 60.0..=100_000.0;
/// Torque limits, N m: the motor's is 16 N m.
const LIMIT_NM: std::ops::RangeInclusive<f64> = 0.0..=1000.0;
/// Errors of the delay, s.
const DELAY_ERROR_S: std::ops::RangeInclusive<f64> = -0.5..=0.5;
/// Errors of the delay in a region, and the greatest unless told otherwise, s.
const REGION_ERRORS: usize = 21;
const REGION_ERROR_S: f64 = 0.02;
/// Rates of adaptation, ticks per square unit, and deviations of the noise.
const ADAPTATION: std::ops::RangeInclusive<f64> = 0.0..=1000.0;
const NOISE: std::ops::RangeInclusive<f64> = 0.0..=10.0;

#[derive(Serialize)]
struct Results<'a> {
    signal: Component,
    mixed: Option<Mixed>,
    memory: f64,
    limit_nm: f64,
    delay_error_s: f64,
    points: &'a [Point],
}

#[derive(Serialize)]
struct RegionResults<'a> {
    signal: Component,
    mixed: Option<Mixed>,
    memory: f64,
    limit_nm: f64,
    cells: &'a [Cell],
}

impl Arguments {
    fn plan(&self) -> anyhow::Result<Plan> {
        for (option, value, allowed, unit) in [
            ("--limit", self.limit, &LIMIT_NM, "N m"),
            ("--delay-error", self.delay_error(), &DELAY_ERROR_S, "s"),
            (
                "--adaptation",
                self.adaptation,
                &ADAPTATION,
                "ticks per square unit",
            ),
            ("--noise", self.noise, &NOISE, "of the signal's unit"),
            ("--free", self.free, &FREE_S, "s"),
            ("--time", self.time, &TIME_S, "s"),
        ] {
            ensure!(
                allowed.contains(&value),
                "{option} {}: must be from {} to {} {unit}",
                Short(value),
                allowed.start(),
                allowed.end()
            );
        }
        ensure!(
            (0.0..1.0).contains(&self.memory),
            "--memory {}: must be from 0 to less than 1",
            Short(self.memory)
        );
        let gains = Values::new("gain", self.gain_from, self.gain_to, self.gain_step)?;
        ensure!(
            gains.count() <= MOST_GAINS,
            "--gain-from {} --gain-to {} --gain-step {}: {} gains, must be at most {MOST_GAINS}",
            Short(self.gain_from),
            Short(self.gain_to),
            Short(self.gain_step),
            gains.count()
        );
        Ok(Plan {
            feedback: Feedback {
                component: self.signal,
                mixed: self.mix,
                // Both are chosen at each speed.
                gain: 0.0,
                delay_s: 0.0,
                memory: self.memory,
                limit_nm: self.limit,
                adaptation: self.adaptation,
                latency_ticks: self.latency as usize,
            },
            gains,
            delay_error_s: self.delay_error(),
            conditions: Conditions {
                free_s: self.free,
                time_s: self.time,
                noise: self.noise,
            },
        })
    }

    fn delay_error(&self) -> f64 {
        let usual = if self.region { REGION_ERROR_S } else { 0.0 };
        self.delay_error.unwrap_or(usual)
    }

    /// The vehicle that is simulated.
    fn plant(&self, scenario: &Scenario<f64>) -> anyhow::Result<Scenario<f64>> {
        let Some(file) = &self.plant else {
            return Ok(*scenario);
        };
        let plant = load_file(file, self.config.preset.as_deref())?;
        validate(&plant)?;
        Ok(plant)
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.config.load()?;
    validate(&scenario)?;
    let plan = arguments.plan()?;
    let (from, to) = (arguments.from, arguments.to);
    let speeds = Values::new(Parameter::Speed.name(), from, to, arguments.step)?;
    ensure!(
        speeds.count() <= MOST_SPEEDS,
        "--from {} --to {} --step {}: {} speeds, must be at most {MOST_SPEEDS}",
        Short(from),
        Short(to),
        Short(arguments.step),
        speeds.count()
    );
    let plant = arguments.plant(&scenario)?;
    for scenario in [&scenario, &plant] {
        let rate_hz = scenario.run.control_rate_hz;
        ensure!(
            rate_hz <= MOST_RATE_HZ,
            "run.control_rate_hz = {}: must be at most {MOST_RATE_HZ} Hz, for delays of up to {LONGEST_TICKS} ticks",
            Short(rate_hz)
        );
    }
    let inputs = arguments
        .config
        .input()
        .into_iter()
        .chain(named("--plant", &arguments.plant));
    let files = arguments.destinations.files().into_iter();
    let files = files.chain([named("--table", &arguments.table)]);
    check(inputs, files, arguments.destinations.force)?;
    if arguments.region {
        return over_delay(arguments, &scenario, &speeds, &plan, &plant);
    }
    if let Some(path) = &arguments.table {
        let command = format!(
            "sim-host feedback --from {from} --to {to} --step {} --gain-from {} --gain-to {} --gain-step {} --latency {} --table FILE",
            arguments.step,
            arguments.gain_from,
            arguments.gain_to,
            arguments.gain_step,
            arguments.latency
        );
        return feedback_table::run(
            &scenario,
            &speeds,
            &plan,
            &command,
            (path, arguments.destinations.force),
        );
    }
    let begun = with_progress(speeds.count(), |control| {
        over_speed(&scenario, &speeds, &plan, &plant, control)
    })?;
    let points: Vec<Point> = begun.iter().flatten().cloned().collect();
    if points.is_empty() {
        check_interrupted(begun.len(), speeds.count())?;
        bail!("no orbit of one cycle was found at any speed from {from} to {to} rpm");
    }
    let results = Results {
        signal: arguments.signal,
        mixed: arguments.mix,
        memory: arguments.memory,
        limit_nm: arguments.limit,
        delay_error_s: plan.delay_error_s,
        points: &points,
    };
    arguments
        .destinations
        .write(points.iter().map(PointRow::from), &results, || {
            chart(&points).svg()
        })?;
    show(&points);
    if points.len() < begun.len() {
        say!(
            "no orbit of one cycle at {} of {} speeds",
            begun.len() - points.len(),
            begun.len()
        );
    }
    check_interrupted(begun.len(), speeds.count())?;
    Ok(Outcome::Success)
}

/// The region of gain and delay at each speed.
fn over_delay(
    arguments: &Arguments,
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    plan: &Plan,
    plant: &Scenario<f64>,
) -> anyhow::Result<Outcome> {
    let error_s = plan.delay_error_s.abs();
    ensure!(
        error_s > 0.0,
        "--region --delay-error 0: must be greater than 0"
    );
    let errors = Values::between("error of the delay (s)", -error_s, error_s, REGION_ERRORS)?;
    let scenarios = scenarios(scenario, Parameter::Speed, speeds_rpm)?;
    let all = errors.count() * plan.gains.count() * scenarios.len();
    let cells = with_progress(all, |control| {
        let region = |scenario: &Scenario<f64>| {
            let plant = Parameter::Speed.set(plant, scenario.run.wheel_speed_rpm);
            region(scenario, plan, &errors, &plant, control)
        };
        Ok::<_, SweepError>(
            scenarios
                .iter()
                .filter_map(region)
                .flatten()
                .collect::<Vec<_>>(),
        )
    })?;
    if cells.is_empty() {
        check_interrupted(0, all)?;
        bail!("no orbit of one cycle was found at any of the speeds");
    }
    let results = RegionResults {
        signal: arguments.signal,
        mixed: arguments.mix,
        memory: arguments.memory,
        limit_nm: arguments.limit,
        cells: &cells,
    };
    arguments
        .destinations
        .write(cells.iter().map(CellRow::from), &results, || {
            region_chart(&cells, &plan.feedback).svg()
        })?;
    for of_speed in cells.chunk_by(|a, b| a.wheel_speed_rpm == b.wheel_speed_rpm) {
        let periodic = of_speed.iter().filter(|cell| cell.held.maxima.is_some());
        say!(
            "{} rpm: periodic at {} of {} pairs of gain and delay",
            of_speed[0].wheel_speed_rpm,
            periodic.count(),
            of_speed.len()
        );
    }
    check_interrupted(cells.len(), all)?;
    Ok(Outcome::Success)
}

fn captured(held: &Held) -> String {
    match (held.capture_s, held.diverges_at_s) {
        (Some(seconds), _) => format!("{seconds:.0}"),
        (None, Some(_)) => "diverges".into(),
        (None, None) => "no".into(),
    }
}

fn show(points: &[Point]) {
    say!(
        "speed  period    multiplier      gain   gains that hold  torque (N m)      maxima  captured  impulses  rest"
    );
    say!(
        "rpm    s         free     held            from    to      rms      peak             after s   after s   after s"
    );
    for point in points {
        let (best, held) = (&point.best, &point.held);
        let (low, high) = best
            .holding
            .map_or(("-".into(), "-".into()), |(low, high)| {
                (format!("{low}"), format!("{high}"))
            });
        say!(
            "{:<6} {:.6}  {:<8.3} {:<6.3} {:>6}   {low:<7} {high:<7} {:<8.4} {:<8.4} {:<7} {:<9} {:<9} {}",
            point.wheel_speed_rpm,
            point.period_s,
            point.free_multiplier,
            best.multiplier,
            best.gain,
            held.torque_rms_nm,
            held.torque_peak_nm,
            held.maxima
                .map_or("none".into(), |maxima| maxima.to_string()),
            captured(held),
            captured(&point.under_impulses),
            captured(&point.to_rest)
        );
    }
}
