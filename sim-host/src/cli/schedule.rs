//! `sim-host schedule`: the dither amplitude required at each wheel speed, as the ECU's table.

use super::grid::{GridOptions, TimeOptions};
use super::options::{ConfigOptions, parameters_in_words};
use super::outcome::Outcome;
use super::output::{check, named};
use super::sweep::with_progress;
use anyhow::{bail, ensure};
use dynamics::config::validate;
use dynamics::schedule::cells::Cell;
use dynamics::schedule::choose::Choice;
use dynamics::schedule::figure::draw;
use dynamics::schedule::{Analysis, Margin, Plan, runs, schedule, source};
use dynamics::sweep::{Timing, Values};
use dynamics::words::{Short, counted};
use files::output::{write_json, write_rows, write_text};
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::path::PathBuf;

/// Compute the dither amplitude W required at each wheel speed N, for square and sine wave: the
/// ECU's table.
///
/// At each speed the amplitude is scanned upwards from 0, from the scenario's initial state and
/// from the mirrored one. If both trajectories without dither are at rest or of period one, the
/// entry is 0. Otherwise it is the least amplitude of the first range with period one (one
/// trajectory may be at rest) at that speed and no other regime at its neighbours, plus a margin.
/// The map uses the averaged dither. The entries are then checked with the true signal at the PWM
/// rate, at the table's speeds and midway. The multipliers of the orbits under each entry must stay
/// below --greatest-multiplier, at its own speed and at its neighbours. The run takes about twenty
/// seconds on 2 cores. The exit code is 1 if a speed has no such amplitude, a multiplier is greater,
/// or a check fails.
#[derive(clap::Args)]
// Finer and longer than the default map.
#[command(
    mut_arg("step", |arg| arg.default_value("25")),
    mut_arg("square_to", |arg| arg.default_value("0.15")),
    mut_arg("sine_to", |arg| arg.default_value("1.35")),
    mut_arg("transient", |arg| arg.default_value("150"))
)]
#[command(after_help = "Examples:
  sim-host schedule --from 1700 --to 1800 \\
      --csv schedule.csv --figure schedule.svg
  sim-host config > vehicle.toml
  sim-host schedule --config vehicle.toml --from 1500 --to 1600 --step 50 \\
      --margin 0.5 --json schedule.json
  # the ECU's table, for shared-model/src; then build the firmware
  sim-host schedule --out schedule_table.rs")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
    #[command(flatten)]
    grid: GridOptions,
    /// Number of steps from 0 to the greatest amplitude, instead of --square-step and --sine-step;
    /// edges are bisected to a sixteenth of a step
    #[arg(long, value_name = "COUNT", default_value_t = 30, conflicts_with_all = ["square_step", "sine_step"], value_parser = clap::value_parser!(u32).range(2..=1000))]
    amplitudes: u32,
    /// Margin above the least amplitude, as a share of its range, from 0 to 1; at least half a PWM
    /// count
    #[arg(
        long,
        value_name = "SHARE",
        default_value_t = 0.25,
        allow_negative_numbers = true
    )]
    margin: f64,
    /// Greatest modulus of a multiplier, beside 1, that an orbit under the dither may have, from 0 to
    /// 1: the share of a perturbation that is left after a period
    #[arg(
        long,
        value_name = "SHARE",
        default_value_t = 0.8,
        allow_negative_numbers = true
    )]
    greatest_multiplier: f64,
    #[command(flatten)]
    times: TimeOptions,
    /// Write the table as Rust source, the module `shared_model::schedule_table`
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the map's cells as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the map, the entries and the checks as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the map with the schedule as an SVG figure
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

/// Allowed numbers of amplitudes, including 0.
const AMPLITUDES: std::ops::RangeInclusive<usize> = 3..=1001;
/// An edge is bisected to this share of the step between amplitudes.
const EDGE_SHARE: f64 = 1.0 / 16.0;

#[derive(Serialize)]
struct Results<'a> {
    margin: f64,
    greatest_multiplier: f64,
    timing: Timing,
    schedules: &'a [Analysis],
}

/// A row of the CSV.
#[derive(Serialize)]
struct Row {
    waveform: Waveform,
    wheel_speed_rpm: f64,
    dither_amplitude_v: f64,
    class: &'static str,
    kind_from_given_start: String,
    kind_from_mirrored_start: String,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.config.load()?;
    validate(&scenario)?;
    let plans = [
        arguments.plan(&scenario, Waveform::Square)?,
        arguments.plan(&scenario, Waveform::Sine)?,
    ];
    let files = [
        named("--out", &arguments.out),
        named("--csv", &arguments.csv),
        named("--json", &arguments.json),
        named("--figure", &arguments.figure),
    ];
    check(arguments.config.input(), files, arguments.force)?;
    let mut analyses = Vec::new();
    for (scenario, plan) in plans {
        let made = with_progress(runs(&plan), |watch| schedule(&scenario, &plan, watch))?;
        let Some(analysis) = made else {
            bail!("interrupted: a schedule needs all of its runs; no file was written");
        };
        analyses.push(analysis);
    }
    arguments.write(&scenario, &analyses)?;
    analyses.iter().for_each(show);
    let good = |a: &Analysis| {
        a.hopeless_rpm().is_empty()
            && a.lost_margins().next().is_none()
            && a.failed_checks().next().is_none()
    };
    Ok(if analyses.iter().all(good) {
        Outcome::Success
    } else {
        Outcome::Failed
    })
}

impl Arguments {
    /// The validated scenario with this waveform, and its plan.
    fn plan(
        &self,
        scenario: &Scenario<f64>,
        waveform: Waveform,
    ) -> anyhow::Result<(Scenario<f64>, Plan)> {
        ensure!(
            (0.0..=1.0).contains(&self.margin),
            "--margin {}: must be a share from 0 to 1",
            Short(self.margin)
        );
        ensure!(
            self.greatest_multiplier > 0.0 && self.greatest_multiplier < 1.0,
            "--greatest-multiplier {}: must be greater than 0 and less than 1",
            Short(self.greatest_multiplier)
        );
        let (what, to_v, step_v) = self.grid.amplitudes_v(waveform);
        let amplitudes_v = match step_v {
            Some(step_v) => Values::new(what, 0.0, to_v, step_v)?,
            None => Values::parts(what, to_v, self.amplitudes as usize)?,
        };
        let step_v = step_v.unwrap_or(to_v / f64::from(self.amplitudes));
        ensure!(
            AMPLITUDES.contains(&amplitudes_v.count()) && to_v > 0.0,
            "{what}: {} from 0 to {} in steps of {}: must be {} to {}, ascending",
            counted(amplitudes_v.count(), "value"),
            Short(to_v),
            Short(step_v),
            AMPLITUDES.start(),
            AMPLITUDES.end()
        );
        let (from, to) = (self.grid.from, self.grid.to);
        let plan = Plan {
            speeds_rpm: Values::new("wheel speed (rpm)", from, to, self.step_rpm())?,
            amplitudes_v,
            edge_width_v: EDGE_SHARE * step_v,
            margin: self.margin,
            greatest_multiplier: self.greatest_multiplier,
            timing: self.times.timing()?,
        };
        let mut scenario = *scenario;
        scenario.dither.waveform = waveform;
        plan.validate(&scenario)?;
        Ok((scenario, plan))
    }

    fn step_rpm(&self) -> f64 {
        self.grid.step.expect("it has a default")
    }

    /// The options of the axes, with amplitudes by number or by step.
    fn axes(&self) -> String {
        let grid = &self.grid;
        let step = |option, step: Option<f64>| step.map(|step| format!(" --{option} {step}"));
        let steps = [
            step("square-step", grid.square_step),
            step("sine-step", grid.sine_step),
        ];
        let amplitudes = match steps {
            [None, None] => format!(" --amplitudes {}", self.amplitudes),
            steps => steps.into_iter().flatten().collect(),
        };
        format!(
            "--from {} --to {} --step {} --square-to {} --sine-to {}{amplitudes}",
            grid.from,
            grid.to,
            self.step_rpm(),
            grid.square_to,
            grid.sine_to
        )
    }

    fn times(&self) -> String {
        format!(
            "--transient {} --time {}",
            self.times.transient, self.times.time
        )
    }

    fn write(&self, scenario: &Scenario<f64>, analyses: &[Analysis]) -> anyhow::Result<()> {
        if let Some(path) = &self.out {
            let source = source::source(analyses, &self.made_by(scenario));
            write_text(path, &source, self.force)?;
        }
        if let Some(path) = &self.csv {
            write_rows(path, analyses.iter().flat_map(rows), self.force)?;
        }
        if let Some(path) = &self.json {
            let results = Results {
                margin: self.margin,
                greatest_multiplier: self.greatest_multiplier,
                timing: self.times.timing()?,
                schedules: analyses,
            };
            write_json(path, &results, self.force)?;
        }
        if let Some(path) = &self.figure {
            write_text(path, &draw(analyses), self.force)?;
        }
        Ok(())
    }

    /// The command, and what it was run on.
    fn made_by(&self, scenario: &Scenario<f64>) -> Vec<String> {
        vec![
            format!("Made by `sim-host schedule {}", self.axes()),
            format!(
                "--margin {} {} --out FILE`; not to be edited by hand.",
                self.margin,
                self.times()
            ),
            format!("Parameters: {}.", parameters_in_words(scenario)),
        ]
    }
}

fn rows(analysis: &Analysis) -> impl Iterator<Item = Row> + '_ {
    let cells = analysis.columns.iter().flat_map(|column| &column.cells);
    cells.map(|cell| Row {
        waveform: analysis.waveform,
        wheel_speed_rpm: cell.wheel_speed_rpm,
        dither_amplitude_v: cell.amplitude_v,
        class: cell.class().name(),
        kind_from_given_start: cell.given.to_string(),
        kind_from_mirrored_start: cell.mirrored.to_string(),
    })
}

/// The multipliers at an entry, and the amplitudes at which they keep their bound.
fn in_words(margin: &Margin) -> String {
    let Some(multiplier) = margin.greatest_multiplier else {
        return "; no stable orbit or equilibrium".to_owned();
    };
    let kept = margin.kept.map_or_else(
        || "more than the bound".to_owned(),
        |kept| format!("bound kept from {:.4} to {:.4} V", kept.from_v, kept.to_v),
    );
    format!("; greatest multiplier {multiplier:.3}, {kept}")
}

fn show(analysis: &Analysis) {
    let word = match analysis.waveform {
        Waveform::Sine => "sine",
        Waveform::Square | Waveform::None => "square wave",
    };
    say!(
        "{word} (range limits are accurate to {:.1} mV):",
        1e3 * analysis.edge_width_v
    );
    for entry in &analysis.entries {
        let is_its = |margin: &&Margin| margin.wheel_speed_rpm == entry.wheel_speed_rpm;
        let margin = analysis.margins.iter().find(is_its);
        say!(
            "  {:.4} V  {}{}",
            entry.amplitude_v,
            source::remark(entry),
            margin.map_or_else(String::new, in_words)
        );
    }
    let count = |choice| {
        analysis
            .entries
            .iter()
            .filter(|e| e.choice == choice)
            .count()
    };
    say!(
        "  speeds: {} without dither, {} with period one, {} only at rest, {} without a solution",
        count(Choice::Undithered),
        count(Choice::PeriodOne),
        count(Choice::Rest),
        count(Choice::Nothing)
    );
    let failed: Vec<&Cell> = analysis.failed_checks().collect();
    let coexist = analysis.checks.iter().filter(|cell| cell.coexist());
    say!(
        "  checks with the true signal at the speeds and midway: {} of {} passed; at {} of them an orbit and an equilibrium coexist",
        analysis.checks.len() - failed.len(),
        analysis.checks.len(),
        coexist.count()
    );
    if analysis.entries[0].amplitude_v > 0.0 {
        say!(
            "  WARNING: the first speed requires dither, and the table has none below it; reduce --from"
        );
    }
    for margin in analysis.lost_margins() {
        say!(
            "  MARGIN LOST at {} rpm, {:.4} V, or at the amplitude of a neighbour{}; increase --margin or --greatest-multiplier",
            margin.wheel_speed_rpm,
            margin.amplitude_v,
            in_words(margin)
        );
    }
    for cell in failed {
        say!(
            "  FAILED at {} rpm, {:.4} V: {} from the given initial state, {} from the mirrored one",
            cell.wheel_speed_rpm,
            cell.amplitude_v,
            cell.given,
            cell.mirrored
        );
    }
}
