//! `sim-host schedule`: the dither amplitude required at each wheel speed, as the ECU's table.

use super::grid::{GridOptions, TimeOptions};
use super::options::ConfigOptions;
use super::outcome::Outcome;
use super::output::{check, named};
use super::sweep::with_progress;
use anyhow::{Context, anyhow, bail, ensure};
use dynamics::config::{differences, validate};
use dynamics::map::cell::Cell as MapCell;
use dynamics::map::plan::Plan as MapPlan;
use dynamics::schedule::cells::Cell;
use dynamics::schedule::choose::Choice;
use dynamics::schedule::figure::draw;
use dynamics::schedule::{Analysis, Plan, from_map, runs, schedule, source};
use dynamics::sweep::{Timing, Values};
use dynamics::words::{Short, counted};
use files::output::{write_json, write_rows, write_text};
use serde::Serialize;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use std::path::{Path, PathBuf};

/// Compute the dither amplitude W required at each wheel speed N, for square and sine wave: the
/// ECU's table.
///
/// At each speed the amplitude is scanned upwards from 0, from the scenario's initial state and
/// from the mirrored one. If both trajectories without dither are at rest or of period one, the
/// entry is 0. Otherwise it is the least amplitude of the first range with period one (one
/// trajectory may be at rest) at that speed and no other regime at its neighbours, plus a margin.
/// The map uses the averaged dither. The entries are then checked with the true signal at the PWM
/// rate, at the table's speeds and midway. The run takes about ten seconds on 2 cores. The exit
/// code is 1 if a speed has no such amplitude or a check fails.
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
  # the cells of the grid from a map
  sim-host map --start both --from 1700 --to 1800 --step 25 --square-to 0.15 \\
      --sine-to 1.35 --amplitudes 31 --transient 150 --parquet known.parquet
  sim-host schedule --from 1700 --to 1800 --map known.parquet
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
    #[command(flatten)]
    times: TimeOptions,
    /// Read the cells of the grid from a map's Parquet file instead of computing them; scenario,
    /// times and grid must be the same, with both initial states
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
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
    let map = named("--map", &arguments.map);
    check(
        arguments.config.input().into_iter().chain(map),
        files,
        arguments.force,
    )?;
    let first_cells = arguments.first_cells(&scenario, &plans)?;
    let mut analyses = Vec::new();
    for ((scenario, plan), first) in plans.into_iter().zip(first_cells) {
        let known = first.as_ref().map_or(0, |cells| 2 * cells.len());
        let made = with_progress(runs(&plan) - known, |watch| {
            schedule(&scenario, &plan, first, watch)
        })?;
        let Some(analysis) = made else {
            bail!("interrupted: a schedule needs all of its runs; no file was written");
        };
        analyses.push(analysis);
    }
    arguments.write(&scenario, &analyses)?;
    analyses.iter().for_each(show);
    let good = |a: &Analysis| a.hopeless_rpm().is_empty() && a.failed_checks().next().is_none();
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
            timing: self.times.timing()?,
        };
        let mut scenario = *scenario;
        scenario.dither.waveform = waveform;
        plan.validate(&scenario)?;
        Ok((scenario, plan))
    }

    /// The cells of each plan's grid, if there is a map.
    fn first_cells(
        &self,
        scenario: &Scenario<f64>,
        plans: &[(Scenario<f64>, Plan); 2],
    ) -> anyhow::Result<[Option<Vec<Cell>>; 2]> {
        let Some(path) = &self.map else {
            return Ok([None, None]);
        };
        let [(_, square), (_, sine)] = plans;
        let fitting = from_map::fitting(scenario, square, sine)
            .context("no map is consistent with this schedule; omit --map")?;
        let (map, cells) = self.read_map(path, &fitting).map_err(|error| {
            let command = self.map_command(path);
            anyhow!(
                "cannot use {}: {error:#}; this command creates a consistent map: `{command}`",
                path.display()
            )
        })?;
        let of = |waveform, plan| from_map::first_cells(&map, &cells, waveform, plan);
        Ok([of(Waveform::Square, square), of(Waveform::Sine, sine)])
    }

    fn read_map(&self, path: &Path, fitting: &MapPlan) -> anyhow::Result<(MapPlan, Vec<MapCell>)> {
        let (map, cells) = dynamics::map::table::open(path)?;
        let misfits = from_map::misfits(&map, fitting);
        ensure!(misfits.is_empty(), "{}", misfits.join("; "));
        Ok((map, cells))
    }

    /// The command that creates a map: at `path`, unless a file exists there.
    fn map_command(&self, path: &Path) -> String {
        let path = if path.exists() {
            Path::new("consistent.parquet")
        } else {
            path
        };
        format!(
            "sim-host map{} --start both {} {} --parquet {}",
            self.config.words(),
            self.axes(self.amplitudes + 1),
            self.times(),
            path.display()
        )
    }

    fn step_rpm(&self) -> f64 {
        self.grid.step.expect("it has a default")
    }

    /// The options of the axes, with amplitudes by number or by step.
    fn axes(&self, amplitudes: u32) -> String {
        let grid = &self.grid;
        let step = |option, step: Option<f64>| step.map(|step| format!(" --{option} {step}"));
        let steps = [
            step("square-step", grid.square_step),
            step("sine-step", grid.sine_step),
        ];
        let amplitudes = match steps {
            [None, None] => format!(" --amplitudes {amplitudes}"),
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
        let differences = differences(scenario);
        let parameters = match &differences[..] {
            [] => "the paper's (preset `reconstruction`)".to_owned(),
            _ => format!("the paper's but for {}", differences.join(", ")),
        };
        vec![
            format!("Made by `sim-host schedule {}", self.axes(self.amplitudes)),
            format!(
                "--margin {} {} --out FILE`; not to be edited by hand. Parameters: {parameters}.",
                self.margin,
                self.times()
            ),
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
        say!("  {:.4} V  {}", entry.amplitude_v, source::remark(entry));
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
