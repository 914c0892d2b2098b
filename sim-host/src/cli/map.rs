//! `sim-host map`: largest Lyapunov exponent, period, extent and regime over wheel speed and dither
//! amplitude.

use super::grid::{GridOptions, TimeOptions};
use super::options::ConfigOptions;
use super::outcome::Outcome;
use super::output::{Named, check, named};
use anyhow::{Context, bail, ensure};
use clap::{Args, Subcommand, ValueEnum};
use dynamics::config::validate;
use dynamics::map::cell::{Cell, Kind};
use dynamics::map::figure::draw;
use dynamics::map::plan::{CELLS_A_TILE, Grid, Plan, Sheet, Start};
use dynamics::map::table;
use dynamics::map::tiles::{Folder, Merged, Shard, TilesError, plan_of};
use dynamics::sweep::{RunControl, SweepError, Values};
use dynamics::words::counted;
use files::output::{self, Outputs, write_fallible_rows, write_text};
use indicatif::{ProgressBar, ProgressStyle};
use shared_model::dither::Waveform;
use std::path::PathBuf;

/// Compute a map over wheel speed N and dither amplitude W: largest Lyapunov exponent, period,
/// extent and regime of each cell.
///
/// The dither is averaged and on from the start. Period and extent are computed from the turning
/// points after the transient, the exponent from a tangent vector along the trajectory. Cells are
/// computed in tiles, and each completed tile is stored in the work folder. On Ctrl-C, tiles in
/// progress are finished, and the same command continues with the missing tiles. The files are
/// byte-identical for any number of threads, interruptions and shards.
#[derive(Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  sim-host map --speeds 64 --amplitudes 64 \\
      --out map.csv --parquet map.parquet --figure map.svg
  sim-host map --dither square --from 1700 --to 1800 --step 2 \\
      --square-to 0.1 --square-step 0.002 --figure map-detail.svg
  # on two machines, then merged
  sim-host map --speeds 16 --amplitudes 16 --shard 1/2 --work one
  sim-host map --speeds 16 --amplitudes 16 --shard 2/2 --work two
  sim-host map merge one two --out map-merged.csv"
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Action>,
    #[command(flatten)]
    config: ConfigOptions,
    /// Waveforms of the dither
    #[arg(long, value_enum, default_value_t = Dither::Both)]
    dither: Dither,
    /// Initial states: the scenario's, its mirror image (opposite signs), or both
    #[arg(long, value_enum, default_value_t = Starts::Given)]
    start: Starts,
    #[command(flatten)]
    grid: GridOptions,
    /// Number of wheel speeds including both ends, instead of --step
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = 256,
        conflicts_with = "step"
    )]
    speeds: usize,
    /// Least amplitude of the square wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    square_from: f64,
    /// Least amplitude of the sine wave, V
    #[arg(
        long,
        value_name = "VOLTS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    sine_from: f64,
    /// Number of amplitudes of each waveform including both ends, instead of --square-step and
    /// --sine-step
    #[arg(long, value_name = "COUNT", default_value_t = 256, conflicts_with_all = ["square_step", "sine_step"])]
    amplitudes: usize,
    #[command(flatten)]
    times: TimeOptions,
    /// Folder of the tiles [default: the first file's name followed by `.tiles`]
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// Compute only shard I of N of the tiles, for `map merge`
    #[arg(long, value_name = "I/N", conflicts_with_all = ["out", "parquet", "figure"], requires = "work")]
    shard: Option<Shard>,
    #[command(flatten)]
    files: Files,
}

#[derive(Subcommand)]
enum Action {
    Merge(Merge),
}

/// Merge the tiles of several work folders, which must be of the same map.
#[derive(Args)]
struct Merge {
    /// The work folders
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,
    #[command(flatten)]
    files: Files,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Dither {
    Square,
    Sine,
    Both,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Starts {
    Given,
    Mirrored,
    Both,
}

/// The map's files.
#[derive(Args)]
struct Files {
    /// Write the cells as CSV
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the cells as Parquet
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Draw the map as an SVG figure
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    if let Some(Action::Merge(merge)) = &arguments.command {
        return merge.run();
    }
    let plan = arguments.plan()?;
    let mut outputs = arguments.files.check(arguments.config.input())?;
    let work = arguments.work()?;
    outputs.folder("--work", &work)?;
    let folder = Folder::make(&work, &plan)?;
    let shard = arguments.shard.unwrap_or(Shard::ALL);
    fill(&folder, shard)?;
    let missing = folder.missing(shard).len();
    if missing > 0 {
        bail!(
            "interrupted with {} missing; the same command continues from the tiles in {}",
            counted(missing, "tile"),
            work.display()
        );
    }
    if arguments.shard.is_some() {
        say!("the shard is complete: {}", work.display());
        return Ok(Outcome::Success);
    }
    arguments.files.write(&plan, &[folder])?;
    say!(
        "tiles: {}; delete this folder when it is no longer needed",
        work.display()
    );
    Ok(Outcome::Success)
}

/// Computes the missing tiles, with progress on a terminal.
fn fill(folder: &Folder, shard: Shard) -> anyhow::Result<()> {
    let template = "{elapsed_precise} [{bar:40}] {pos}/{len} cells, {per_sec}, {eta} left";
    let style = ProgressStyle::with_template(template)
        .expect("the template is valid")
        .progress_chars("=> ");
    let cells = folder.missing(shard).len() * CELLS_A_TILE;
    let bar = ProgressBar::new(cells as u64).with_style(style);
    let watch = RunControl {
        stop: &interrupt::REQUESTED,
        done: &|| bar.inc(CELLS_A_TILE as u64),
    };
    let filled = folder.fill(shard, watch);
    bar.finish_and_clear();
    Ok(filled?)
}

impl Arguments {
    /// The folder of the tiles.
    fn work(&self) -> anyhow::Result<PathBuf> {
        if let Some(work) = &self.work {
            return Ok(work.clone());
        }
        let mut files = self.files.all().peekable();
        ensure!(
            files.peek().is_some(),
            "no output: give --out, --parquet, --figure or --work"
        );
        let file = files.find(|(_, file)| output::is_file(file));
        let (_, file) = file.context(
            "--work: is required without a regular output file, which gives the folder its name",
        )?;
        let mut name = file.as_os_str().to_owned();
        name.push(".tiles");
        Ok(name.into())
    }

    fn plan(&self) -> anyhow::Result<Plan> {
        let scenario = self.config.load()?;
        validate(&scenario)?;
        let waveforms = match self.dither {
            Dither::Square => &[Waveform::Square][..],
            Dither::Sine => &[Waveform::Sine],
            Dither::Both => &[Waveform::Square, Waveform::Sine],
        };
        let starts = match self.start {
            Starts::Given => &[Start::Given][..],
            Starts::Mirrored => &[Start::Mirrored],
            Starts::Both => &[Start::Given, Start::Mirrored],
        };
        let mut sheets = Vec::new();
        for &start in starts {
            for &waveform in waveforms {
                sheets.push(Sheet {
                    waveform,
                    start,
                    amplitudes_v: self.amplitudes_v(waveform)?,
                });
            }
        }
        let (from, to) = (self.grid.from, self.grid.to);
        let speeds_rpm = grid("wheel speed (rpm)", from, to, self.grid.step, self.speeds)?;
        Ok(Plan::new(
            scenario,
            sheets,
            speeds_rpm,
            self.times.timing()?,
        )?)
    }

    fn amplitudes_v(&self, waveform: Waveform) -> Result<Grid, SweepError> {
        let (what, to, step) = self.grid.amplitudes_v(waveform);
        let from = match waveform {
            Waveform::Sine => self.sine_from,
            Waveform::Square | Waveform::None => self.square_from,
        };
        grid(what, from, to, step, self.amplitudes)
    }
}

/// An axis given by its step or by its number of values.
fn grid(
    what: &'static str,
    from: f64,
    to: f64,
    step: Option<f64>,
    count: usize,
) -> Result<Grid, SweepError> {
    let values = match step {
        Some(step) => Values::new(what, from, to, step),
        None => Values::between(what, from, to, count),
    };
    Ok(values?.into())
}

impl Merge {
    fn run(&self) -> anyhow::Result<Outcome> {
        ensure!(
            self.files.all().next().is_some(),
            "no output: give --out, --parquet or --figure"
        );
        let folders = self.folders.iter();
        let folders = folders.map(|folder| ("the folder", folder.as_path()));
        self.files.check(folders)?;
        let plan = plan_of(&self.folders[0])?;
        let folders = self.folders.iter();
        let folders: Vec<Folder> = folders
            .map(|path| Folder::open(path, &plan))
            .collect::<Result<_, _>>()?;
        self.files.write(&plan, &folders)?;
        Ok(Outcome::Success)
    }
}

impl Files {
    fn all(&self) -> impl Iterator<Item = Named<'_>> {
        let files = [
            named("--out", &self.out),
            named("--parquet", &self.parquet),
            named("--figure", &self.figure),
        ];
        files.into_iter().flatten()
    }

    fn check<'a>(&'a self, inputs: impl IntoIterator<Item = Named<'a>>) -> anyhow::Result<Outputs> {
        check(inputs, self.all().map(Some), self.force)
    }

    /// Writes the files from the tiles in some folders, and prints the shares of the regimes.
    fn write(&self, plan: &Plan, folders: &[Folder]) -> anyhow::Result<()> {
        let map = Merged::new(plan, folders)?;
        // Reads all tiles, so that no file is begun if one of them is damaged.
        let counts = count(plan, &map)?;
        if let Some(path) = &self.out {
            write_fallible_rows(path, map.cells(), self.force)?;
        }
        if let Some(path) = &self.parquet {
            output::write(path, self.force, |to| {
                Ok(table::write(plan, map.cells(), to)?)
            })?;
        }
        if let Some(path) = &self.figure {
            let cells = map.cells().collect::<Result<Vec<Cell>, _>>()?;
            write_text(path, &draw(plan, &cells), self.force)?;
        }
        show(plan, &counts);
        Ok(())
    }
}

/// Cells of each regime in a sheet.
type Counts = [usize; 5];

/// Counts the regimes, sheet by sheet.
fn count(plan: &Plan, map: &Merged) -> Result<Vec<Counts>, TilesError> {
    let cells_a_sheet = plan.cells() / plan.sheets.len();
    let mut counts = vec![Counts::default(); plan.sheets.len()];
    for (index, cell) in map.cells().enumerate() {
        counts[index / cells_a_sheet][cell?.kind as usize] += 1;
    }
    Ok(counts)
}

/// Prints the shares of the regimes, sheet by sheet.
fn show(plan: &Plan, counts: &[Counts]) {
    for (sheet, counts) in plan.sheets.iter().zip(counts) {
        let cells: usize = counts.iter().sum();
        let share = |kind: Kind| 100.0 * counts[kind as usize] as f64 / cells as f64;
        say!(
            "{:?} dither, {:?} initial state, {}: {:.1} % at rest, {:.1} % periodic, {:.1} % chaos, {:.1} % undecided, {:.1} % diverge",
            sheet.waveform,
            sheet.start,
            counted(cells, "cell"),
            share(Kind::Equilibrium),
            share(Kind::Periodic),
            share(Kind::Chaos),
            share(Kind::Undecided),
            share(Kind::Diverges)
        );
    }
}
