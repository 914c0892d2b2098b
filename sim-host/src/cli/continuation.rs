//! `sim-host continue`: branches of periodic orbits and equilibria, with their bifurcations.

use super::options::RunOptions;
use super::outcome::Outcome;
use super::output::Destinations;
use anyhow::{bail, ensure};
use dynamics::bifurcations::{Bifurcations, OrbitPoint, Plan, bifurcations, chart};
use dynamics::orbit::{self, Section, Start, diagram};
use dynamics::sweep::{Parameter, RunControl, Timing, Values};
use dynamics::words::{counted, counted_as};
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Waveform;

/// Continue periodic orbits and equilibria over a parameter, stable and unstable, and locate their
/// bifurcations by the multipliers.
///
/// The first orbit is the one that the trajectory from the scenario's initial state returns to, at the
/// scenario's value of the parameter. Others branch off at Hopf bifurcations and period doublings. The
/// dither is averaged. The error of each bifurcation is from a second location at a hundred times the
/// integration tolerance. With a second parameter, the curve of each bifurcation is followed in both.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host continue --rpm 1600              # period doublings over the speed
  sim-host continue --rpm 1700 --from 1500 --to 2000 --doublings 3 \\
      --figure branches.svg --json branches.json
  sim-host continue --over amplitude --dither square --amplitude-v 0.1 \\
      --figure branches-square.svg
  sim-host continue --dither square --amplitude-v 0.1 --rpm 1750 \\
      --second dither.amplitude_v --second-from 0 --second-to 0.2 \\
      --figure curves.svg                   # how much dither is enough
  sim-host continue --over friction.coefficient --from 0.1 --to 0.4")]
pub struct Arguments {
    #[command(flatten)]
    run: RunOptions,
    /// Parameter: `speed`, `amplitude`, or a number of the configuration, as `sim-host config` lists it
    #[arg(long, value_name = "NAME", default_value = "speed")]
    over: String,
    /// Lower end of its range [default: 1500 rpm; 0 V]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Upper end of its range [default: 2000 rpm; 0.2 V of square wave, 1.4 V of sine]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Second parameter: follow the curves of the bifurcations in both
    #[arg(
        long,
        value_name = "NAME",
        requires = "second_from",
        requires = "second_to"
    )]
    second: Option<String>,
    /// Lower end of its range
    #[arg(
        long,
        value_name = "VALUE",
        allow_negative_numbers = true,
        requires = "second"
    )]
    second_from: Option<f64>,
    /// Upper end of its range
    #[arg(
        long,
        value_name = "VALUE",
        allow_negative_numbers = true,
        requires = "second"
    )]
    second_to: Option<f64>,
    /// Cycles of the first orbit [default: those of the settled trajectory, or 1 if it is chaotic]
    #[arg(long, value_name = "NUMBER")]
    cycles: Option<usize>,
    /// Number of period doublings that are followed one after another
    #[arg(long, value_name = "NUMBER", default_value_t = 2)]
    doublings: usize,
    /// Initial transient to discard, s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 200.0,
        allow_negative_numbers = true
    )]
    transient: f64,
    /// Integration tolerance per step, relative
    #[arg(
        long,
        value_name = "NUMBER",
        default_value_t = 1e-12,
        allow_negative_numbers = true
    )]
    tolerance: f64,
    #[command(flatten)]
    destinations: Destinations,
}

/// Most cycles and doublings: the period doubles with each.
const MOST_CYCLES: usize = 16;
const MOST_DOUBLINGS: usize = 6;
/// Longest transient, s.
const LONGEST_TRANSIENT_S: f64 = 100_000.0;
/// Values of the orbit diagram below the branches, and its times.
const DIAGRAM_VALUES: usize = 241;
const DIAGRAM_TIMING: Timing = Timing {
    transient_s: 200.0,
    observed_s: 60.0,
};

/// A row of the CSV: an orbit.
#[derive(Serialize)]
struct Row {
    branch: usize,
    point: &'static str,
    parameter: f64,
    parameter_error: Option<f64>,
    period_s: f64,
    cycles: usize,
    maxima: usize,
    prominent_maxima: usize,
    stable: bool,
    exponent_per_s: f64,
    multiplier_1_re: f64,
    multiplier_1_im: f64,
    multiplier_2_re: f64,
    multiplier_2_im: f64,
    multiplier_3_re: f64,
    multiplier_3_im: f64,
    trivial_multiplier_error: f64,
    yaw_rate_min_rad_per_s: f64,
    yaw_rate_max_rad_per_s: f64,
    sticks: usize,
}

impl Row {
    fn new(branch: usize, point: &'static str, error: Option<f64>, orbit: &OrbitPoint) -> Self {
        let multiplier = |k: usize| {
            orbit
                .multipliers
                .get(k)
                .map_or((f64::NAN, f64::NAN), |m| (m.re, m.im))
        };
        let [first, second, third] = [0, 1, 2].map(multiplier);
        Self {
            branch,
            point,
            parameter: orbit.parameter,
            parameter_error: error,
            period_s: orbit.period_s,
            cycles: orbit.cycles,
            maxima: orbit.maxima_rad_per_s.len(),
            prominent_maxima: orbit.prominent_maxima_rad_per_s.len(),
            stable: orbit.stable,
            exponent_per_s: orbit.exponent_per_s,
            multiplier_1_re: first.0,
            multiplier_1_im: first.1,
            multiplier_2_re: second.0,
            multiplier_2_im: second.1,
            multiplier_3_re: third.0,
            multiplier_3_im: third.1,
            trivial_multiplier_error: orbit.trivial_multiplier_error,
            yaw_rate_min_rad_per_s: orbit.yaw_rate_min_rad_per_s,
            yaw_rate_max_rad_per_s: orbit.yaw_rate_max_rad_per_s,
            sticks: orbit.sticks,
        }
    }
}

impl Arguments {
    fn plan(&self) -> anyhow::Result<Plan> {
        let mut scenario = self.run.scenario()?;
        if let Some(time_s) = self.run.time {
            bail!("--time {time_s}: has no effect, because orbits are solved directly; omit it");
        }
        let parameter = key(&self.over);
        let amplitude = match scenario.dither.waveform {
            Waveform::Sine => (0.0, 1.4),
            Waveform::None | Waveform::Square => (0.0, 0.2),
        };
        let default = match Parameter::from_key(&parameter) {
            Some(Parameter::Speed) => Some((1500.0, 2000.0)),
            Some(Parameter::Amplitude) => Some(amplitude),
            None => None,
        };
        let (from, to) = match (
            self.from.or(default.map(|d| d.0)),
            self.to.or(default.map(|d| d.1)),
        ) {
            (Some(from), Some(to)) => (from, to),
            _ => bail!("--over {}: needs --from and --to", self.over),
        };
        let second = self
            .second
            .as_ref()
            .zip(self.second_from.zip(self.second_to));
        let second = second.map(|(name, range)| (key(name), range));
        let names = std::iter::once(&parameter).chain(second.as_ref().map(|(key, _)| key));
        for name in names {
            ensure!(
                name != Parameter::Amplitude.key() || scenario.dither.waveform != Waveform::None,
                "--dither: must be square or sine, because the amplitude of no dither has no effect"
            );
        }
        ensure!(
            (0.0..=LONGEST_TRANSIENT_S).contains(&self.transient),
            "--transient {}: must be from 0 to {LONGEST_TRANSIENT_S} s",
            self.transient
        );
        ensure!(
            self.doublings <= MOST_DOUBLINGS,
            "--doublings {}: must be at most {MOST_DOUBLINGS}",
            self.doublings
        );
        if let Some(cycles) = self.cycles {
            ensure!(
                (1..=MOST_CYCLES).contains(&cycles),
                "--cycles {cycles}: must be from 1 to {MOST_CYCLES}"
            );
        }
        // A range that does not contain the preset's value begins in its middle, unless a value is given.
        let is_given = match Parameter::from_key(&parameter) {
            Some(Parameter::Speed) => self.run.rpm.is_some() || self.run.config.config.is_some(),
            Some(Parameter::Amplitude) => {
                self.run.amplitude_v.is_some() || self.run.config.config.is_some()
            }
            None => self.run.config.config.is_some(),
        };
        if let Some(value) = scenario.number(&parameter)
            && !is_given
            && from < to
            && !(from..=to).contains(value)
        {
            *value = 0.5 * (from + to);
        }
        Ok(Plan {
            scenario,
            parameter,
            range: (from, to),
            second,
            cycles: self.cycles,
            transient_s: self.transient,
            doublings: self.doublings,
            tolerance: self.tolerance,
        })
    }
}

/// The configuration's name of a parameter.
fn key(name: &str) -> String {
    match name {
        "speed" => Parameter::Speed.key().into(),
        "amplitude" => Parameter::Amplitude.key().into(),
        other => other.into(),
    }
}

/// Name with unit, for axes.
fn axis(key: &str) -> String {
    match Parameter::from_key(key) {
        Some(parameter) => parameter.name().into(),
        None => key.into(),
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let plan = arguments.plan()?;
    arguments.destinations.check(arguments.run.config.input())?;
    let found = bifurcations(&plan)?;
    let branches = found.orbits.iter().enumerate();
    let points = branches.flat_map(|(number, branch)| {
        branch
            .points
            .iter()
            .map(move |orbit| Row::new(number, "orbit", None, orbit))
    });
    let specials = found.specials.iter().map(|special| {
        Row::new(
            special.branch,
            special.kind,
            Some(special.parameter_error),
            &special.orbit,
        )
    });
    arguments
        .destinations
        .write(points.chain(specials), &found, || {
            let second = plan
                .second
                .as_ref()
                .map_or(String::new(), |(key, _)| axis(key));
            let names = [axis(&plan.parameter), second];
            chart(&found, simulated(&plan), plan.range, [&names[0], &names[1]]).svg()
        })?;
    show(&found);
    if interrupt::requested() {
        bail!("interrupted; the requested files contain the branches that were complete");
    }
    Ok(Outcome::Success)
}

/// The maxima of an orbit diagram over the same range, to be drawn below the branches.
fn simulated(plan: &Plan) -> Vec<(f64, f64)> {
    let Some(parameter) = Parameter::from_key(&plan.parameter) else {
        return Vec::new();
    };
    let at = |scenario: &Scenario<f64>| {
        let (from, to) = plan.range;
        let values = Values::between(parameter.name(), from, to, DIAGRAM_VALUES)?;
        let (section, start) = (Section::YawRateMaxima, Start::Fixed);
        diagram(
            scenario,
            parameter,
            &values,
            section,
            DIAGRAM_TIMING,
            start,
            RunControl::none(),
        )
    };
    let points = at(&plan.scenario).unwrap_or_default();
    let dots = points.iter().flat_map(|point| match &point.orbit {
        orbit::Outcome::Meets { values } => {
            values.iter().map(|value| (point.value, *value)).collect()
        }
        _ => Vec::new(),
    });
    dots.collect()
}

fn show(found: &Bifurcations) {
    let key = &found.parameter;
    say!(
        "{}, {}",
        counted_as(
            found.equilibria.len(),
            "branch of equilibria",
            "branches of equilibria"
        ),
        counted_as(
            found.orbits.len(),
            "branch of periodic orbits",
            "branches of periodic orbits"
        )
    );
    for hopf in &found.hopf {
        let criticality = if hopf.first_lyapunov_coefficient < 0.0 {
            "supercritical"
        } else {
            "subcritical"
        };
        say!(
            "Hopf bifurcation at {key} = {:.6}, {:.4} rad/s: {criticality}, first Lyapunov coefficient {:.3e}",
            hopf.parameter,
            hopf.frequency_rad_per_s,
            hopf.first_lyapunov_coefficient
        );
    }
    for (number, branch) in found.orbits.iter().enumerate() {
        let values = || branch.points.iter().map(|point| point.parameter);
        let (low, high) = (
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        );
        say!(
            "branch {number} from {}: {} from {low:.4} to {high:.4}",
            branch.origin,
            counted(branch.points.len(), "orbit")
        );
        for special in found
            .specials
            .iter()
            .filter(|special| special.branch == number)
        {
            let orbit = &special.orbit;
            let error = match special.parameter_error {
                error if error.is_finite() => format!("+- {error:.0e}"),
                _ => "(error unknown)".into(),
            };
            say!(
                "  {} at {key} = {:.8} {error}: period {:.6} s, {}, {}",
                special.kind,
                special.parameter,
                orbit.period_s,
                counted(orbit.cycles, "cycle"),
                counted_as(orbit.maxima_rad_per_s.len(), "maximum", "maxima")
            );
        }
        let ends: Vec<String> = branch.ends.iter().map(ToString::to_string).collect();
        say!("  ends: {}", ends.join("; "));
    }
    for curve in &found.curves {
        let ends: Vec<String> = curve.ends.iter().map(ToString::to_string).collect();
        say!(
            "curve of {}: {}; ends: {}",
            curve.kind,
            counted(curve.points.len(), "point"),
            ends.join("; ")
        );
        for (condition, [first, second]) in &curve.codimension_two {
            say!("  {condition} at {first:.4}, {second:.6}");
        }
    }
    for reason in &found.without_branch {
        say!("no branch from {reason}");
    }
}
