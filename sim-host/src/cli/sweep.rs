//! Options and progress of the subcommands with many runs: range, times, estimated cost and
//! interruption.

use super::options::RunOptions;
use anyhow::{bail, ensure};
use clap::{Args, ValueEnum};
use dynamics::observe::observe;
use dynamics::sweep::{LARGEST_BATCH, Parameter, RunControl, SweepError, Timing, Values};
use dynamics::words::counted;
use engine::taylor::Observables;
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use plot::chart::{Chart, Region};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use sim_host::paper::REGION_EDGES_RPM;
use std::time::Instant;

/// Number of runs above which the estimated cost is printed.
const MANY: usize = 1000;
/// Number of runs above which `--yes` is required.
const TOO_MANY: usize = 20_000;
/// Length of the runs that are timed for the estimate, s.
const TIMED_S: f64 = 10.0;

/// Swept parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Over {
    /// Wheel speed, rpm
    Speed,
    /// Dither amplitude, V
    Amplitude,
}

impl Over {
    /// The parameter of the analyses.
    pub fn parameter(self) -> Parameter {
        match self {
            Self::Speed => Parameter::Speed,
            Self::Amplitude => Parameter::Amplitude,
        }
    }
}

/// The swept parameter and its values. Results are in ascending order for both orders of the ends.
#[derive(Args)]
pub struct RangeOptions {
    /// Parameter to sweep
    #[arg(long, value_enum, default_value_t = Over::Speed)]
    over: Over,
    /// First value, at which the steps begin, rpm or V [default: 1550 rpm; 0 V]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Last value, which may be the lower one, rpm or V [default: 1900 rpm; 0.14 V of square wave,
    /// 1.4 V of sine]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Step, rpm or V [default: 5 rpm; 0.002 V of square wave, 0.02 V of sine]
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    step: Option<f64>,
}

impl RangeOptions {
    /// The parameter.
    pub fn parameter(&self) -> Parameter {
        self.over.parameter()
    }

    /// Its values.
    pub fn values(&self, scenario: &Scenario<f64>) -> Result<Values, SweepError> {
        let (from, to, step) = match (self.over, scenario.dither.waveform) {
            (Over::Speed, _) => (1550.0, 1900.0, 5.0),
            (Over::Amplitude, Waveform::Sine) => (0.0, 1.4, 0.02),
            (Over::Amplitude, _) => (0.0, 0.14, 0.002),
        };
        Values::new(
            self.parameter().name(),
            self.from.unwrap_or(from),
            self.to.unwrap_or(to),
            self.step.unwrap_or(step),
        )
    }
}

/// A range of wheel speeds instead of one. Results are in ascending order for both orders of the
/// ends.
#[derive(Args)]
pub struct SpeedRange {
    /// First wheel speed of a range, at which the steps begin, rpm
    #[arg(
        long,
        value_name = "RPM",
        allow_negative_numbers = true,
        requires = "to",
        conflicts_with = "rpm"
    )]
    from: Option<f64>,
    /// Last wheel speed, which may be the lower one, rpm
    #[arg(
        long,
        value_name = "RPM",
        allow_negative_numbers = true,
        requires = "from"
    )]
    to: Option<f64>,
    /// Step of the wheel speed, rpm
    #[arg(
        long,
        value_name = "RPM",
        default_value_t = 10.0,
        allow_negative_numbers = true,
        requires = "from"
    )]
    step: f64,
}

impl SpeedRange {
    /// The speeds; without a range, the scenario's speed alone.
    pub fn values(&self, scenario: &Scenario<f64>) -> Result<Values, SweepError> {
        let rpm = scenario.run.wheel_speed_rpm;
        let (from, to) = (self.from.unwrap_or(rpm), self.to.unwrap_or(rpm));
        Values::new(Parameter::Speed.name(), from, to, self.step)
    }
}

/// The times of each run.
#[derive(Args)]
pub struct TransientOptions {
    /// Initial transient of each run to discard, s; `--time` includes it
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 200.0,
        allow_negative_numbers = true
    )]
    transient: f64,
    /// Allow more than 20,000 runs
    #[arg(long)]
    yes: bool,
}

impl TransientOptions {
    /// The times; `observed_s` after the transient is the default.
    pub fn timing(&self, run: &RunOptions, observed_s: f64) -> Result<Timing, SweepError> {
        let time_s = run.time.unwrap_or(self.transient + observed_s);
        Timing::new(self.transient, time_s)
    }

    /// Prints the estimated cost of many runs, of which `at_once` run in parallel. Rejects too many
    /// runs unless confirmed.
    pub fn announce(
        &self,
        runs: usize,
        timing: Timing,
        scenario: &Scenario<f64>,
        at_once: usize,
    ) -> anyhow::Result<()> {
        if runs <= MANY {
            return Ok(());
        }
        let trial = vec![*scenario; at_once];
        let start = Instant::now();
        let timed = Timing::new(0.0, TIMED_S)?;
        observe::<0, ()>(
            &trial,
            timed,
            Observables::default(),
            RunControl::none(),
            |_, _| (),
        )?;
        let rounds = runs.div_ceil(at_once) as f64 * timing.time_s() / TIMED_S;
        let cost = HumanDuration(start.elapsed().mul_f64(rounds));
        let cost = format!(
            "{runs} runs of {} s each, {at_once} at once: about {cost}",
            timing.time_s()
        );
        ensure!(
            runs <= TOO_MANY || self.yes,
            "{cost}; must be at most {TOO_MANY} runs, unless --yes is given"
        );
        eprintln!("{cost}");
        Ok(())
    }
}

/// Number of independent runs in parallel on all threads.
pub fn side_by_side() -> usize {
    LARGEST_BATCH * rayon::current_num_threads()
}

/// Does the work with progress on a terminal; `runs` is the expected number of runs.
pub fn with_progress<R>(runs: usize, work: impl FnOnce(RunControl) -> R) -> R {
    let style =
        ProgressStyle::with_template("{elapsed_precise} [{bar:40}] {pos}/{len} runs, {eta} left")
            .expect("the template is valid")
            .progress_chars("=> ");
    let bar = ProgressBar::new(runs as u64).with_style(style);
    let result = work(RunControl {
        stop: &interrupt::REQUESTED,
        done: &|| bar.inc(1),
    });
    bar.finish_and_clear();
    result
}

/// After Ctrl-C, returns an error with the number of completed runs.
pub fn check_interrupted(done: usize, of: usize) -> anyhow::Result<()> {
    if interrupt::requested() {
        bail!(
            "interrupted after {done} of {}; the requested files contain their results",
            counted(of, "run")
        );
    }
    Ok(())
}

/// The chart with the paper's regions I to IV shaded, if its panels are over the wheel speed.
pub fn with_paper_regions(mut chart: Chart, parameter: Parameter) -> Chart {
    if parameter != Parameter::Speed {
        return chart;
    }
    for panel in &mut chart.panels {
        let Some((from, to)) = panel.x.range else {
            continue;
        };
        panel.regions = paper_regions(from, to);
        panel.caption += "; I to IV: the paper's regions";
    }
    chart
}

/// The paper's regions I to IV where they meet a sweep over the speed, to be shaded.
fn paper_regions(from: f64, to: f64) -> Vec<Region> {
    let [first, second, third] = REGION_EDGES_RPM;
    let edges = [f64::NEG_INFINITY, first, second, third, f64::INFINITY];
    let region = |(ends, label): (&[f64], &str)| Region {
        from: ends[0].max(from),
        to: ends[1].min(to),
        label: label.into(),
    };
    let all = edges.windows(2).zip(["I", "II", "III", "IV"]).map(region);
    all.filter(|region| region.to > region.from).collect()
}
