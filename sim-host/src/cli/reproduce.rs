//! `sim-host reproduce`: the paper's figures and claims.

use super::outcome::Outcome;
use super::output::{check, named};
use dynamics::config::validate;
use indicatif::{ProgressBar, ProgressStyle};
use shared_model::{Preset, Scenario};
use sim_host::reproduce::{CLAIMS, Judgement, Options, Progress, Quality, Summary, reproduce};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Reproduce the paper: draw its figures, check its claims under both presets, list its errata, and
/// write one page.
///
/// Completed parts are stored. After Ctrl-C, the same command continues with the missing parts.
/// With the file of another vehicle, the claims are checked for that vehicle instead of the
/// presets.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host reproduce --quick    # everything in seconds
  sim-host reproduce            # full quality, in target/reproduction
  sim-host config > vehicle.toml
  sim-host reproduce --config vehicle.toml --out target/vehicle")]
pub struct Arguments {
    /// Use coarse sweeps and short runs
    #[arg(long)]
    quick: bool,
    /// TOML file of another vehicle, instead of both presets
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder for page, figures and data
    #[arg(long, value_name = "FOLDER", default_value = "target/reproduction")]
    out: PathBuf,
    /// Write into a folder that contains other files
    #[arg(long)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let options = Options {
        quality: if arguments.quick {
            Quality::Quick
        } else {
            Quality::Full
        },
        scenarios: scenarios(arguments)?,
    };
    check_folder(arguments)?;
    let start = Instant::now();
    let bar = ProgressBar::no_length().with_style(
        ProgressStyle::with_template("{elapsed_precise} {spinner} {msg}, {pos} points")
            .expect("the template is valid"),
    );
    bar.enable_steady_tick(Duration::from_millis(200));
    let summary = reproduce(
        &arguments.out,
        &options,
        &interrupt::REQUESTED,
        &|progress| match progress {
            Progress::Begins {
                number,
                of,
                title,
                kept,
                done,
            } => {
                let note = if kept {
                    ": already complete".into()
                } else {
                    time_left(start.elapsed(), done)
                };
                let line = format!("{number}/{of} {title}{note}");
                bar.set_position(0);
                bar.set_message(line.clone());
                if bar.is_hidden() {
                    eprintln!("[{:5.1} s] {line}", start.elapsed().as_secs_f64());
                }
            }
            Progress::Point => bar.inc(1),
        },
    )?;
    bar.finish_and_clear();
    show(&summary);
    let page = arguments.out.join("index.html");
    anyhow::ensure!(
        summary.complete,
        "interrupted; the results so far are in {}, and the same command continues from there",
        page.display()
    );
    say!(
        "page: {} ({:.0} s)",
        page.display(),
        start.elapsed().as_secs_f64()
    );
    Ok(Outcome::Success)
}

/// Rejects a folder with other files, which a reproduction might overwrite.
fn check_folder(arguments: &Arguments) -> anyhow::Result<()> {
    let folder = &arguments.out;
    let inputs = named("--config", &arguments.config);
    check(inputs, [], arguments.force)?.folder("--out", folder)?;
    let is_empty = std::fs::read_dir(folder).map_or(true, |mut files| files.next().is_none());
    anyhow::ensure!(
        is_empty || folder.join(CLAIMS).exists() || arguments.force,
        "{} contains other files than a reproduction's; give another --out, or --force to write into it",
        folder.display()
    );
    Ok(())
}

/// Estimated time left, after a twentieth of the work.
fn time_left(elapsed: Duration, done: f64) -> String {
    if done < 0.05 {
        return String::new();
    }
    let left_s = elapsed.as_secs_f64() * (1.0 - done) / done;
    format!(", about {left_s:.0} s left")
}

fn scenarios(arguments: &Arguments) -> anyhow::Result<Vec<(String, Scenario<f64>)>> {
    if let Some(file) = &arguments.config {
        let scenario = super::options::load_file(file, None)?;
        validate(&scenario)?;
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let plain = |c: char| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '-'
            }
        };
        return Ok(vec![(stem.chars().map(plain).collect(), scenario)]);
    }
    let presets = Preset::ALL.into_iter();
    Ok(presets
        .map(|preset| (preset.name().into(), Scenario::preset(preset)))
        .collect())
}

fn show(summary: &Summary) {
    for Judgement {
        claim,
        preset,
        measured,
        distance,
        verdict,
    } in &summary.judgements
    {
        say!("{claim} {preset:<15} {:<19} {measured}", verdict.words());
        if !distance.is_empty() {
            say!("{:38} {distance}", "");
        }
    }
}
