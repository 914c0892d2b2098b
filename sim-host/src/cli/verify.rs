//! `sim-host verify`: verification of the firmware.

use super::emulator::open_image;
use super::firmware::find;
use super::options::{ConfigOptions, time_out};
use super::outcome::Outcome;
use super::output::check;
use anyhow::ensure;
use dynamics::config::validate;
use dynamics::words::Short;
use files::output::make_folder;
use indicatif::{ProgressBar, ProgressStyle};
use plot::terminal;
use sim_host::report::{self, ReportInput};
use sim_host::verify::{Options, Progress, Verification, verify};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Run the ECU in QEMU and the same model on the host, and report whether their results are
/// equivalent and whether the dither suppresses the chaos.
///
/// The runs are: 1750 rpm without dither, with a square wave of 0.1 V and with a sine wave of 1.0
/// V; 1600, 1845 and 1880 rpm without dither; both dithers as true signals; and one run on a second
/// core. They are as fast as the emulator executes them; a short run of each at the pace of the
/// board's timer measures timing. The outputs are index.html, verdict.json, junit.xml and figures.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host verify           # the paper's vehicle; report in target/report
  sim-host verify --force --duration-s 120  # longer, over the last report
  sim-host config > vehicle.toml
  sim-host verify --config vehicle.toml --out report/vehicle")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
    /// Firmware image (ELF) [default: `bench` in the folder DITHERSTEER_FIRMWARE, in `firmware`
    /// beside this program, or in target/]
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Folder with the recorded proofs, for the report
    #[arg(long, value_name = "FOLDER", default_value = "tests/golden")]
    proofs: PathBuf,
    /// Folder for the report
    #[arg(long, value_name = "FOLDER", default_value = "target/report")]
    out: PathBuf,
    /// Overwrite an existing report
    #[arg(long)]
    force: bool,
    /// Length of each main run on the target, s
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    duration_s: f64,
    /// Time limit for one run in QEMU, s
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0)]
    time_out: f64,
}

/// Shorter runs have too few cycles for a period and an exponent.
const DURATIONS_S: std::ops::RangeInclusive<f64> = 60.0..=3600.0;

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let duration_s = arguments.duration_s;
    ensure!(
        DURATIONS_S.contains(&duration_s),
        "--duration-s {}: must be from {} to {} s",
        Short(duration_s),
        DURATIONS_S.start(),
        DURATIONS_S.end()
    );
    let base = arguments.config.load()?;
    validate(&base)?;
    let firmware = match &arguments.firmware {
        Some(firmware) => firmware.clone(),
        None => find::image("bench")?,
    };
    let options = Options {
        time_out: time_out(arguments.time_out)?,
        image: open_image(&firmware)?,
        base,
        duration_s,
    };
    arguments.check_outputs(&firmware)?;
    make_folder(&arguments.out)?;

    let start = Instant::now();
    let verification = with_progress(&options)?;
    let proofs = recorded(&arguments.proofs);
    write_report(&arguments.out, &verification, &proofs)?;
    show(&verification, &arguments.out, start.elapsed());
    Ok(if verification.verdict.passed() {
        Outcome::Success
    } else {
        Outcome::Failed
    })
}

impl Arguments {
    /// A report exists if one of its files exists.
    fn check_outputs(&self, firmware: &Path) -> anyhow::Result<()> {
        let inputs = [("--firmware", firmware)];
        let mut outputs = check(
            inputs.into_iter().chain(self.config.input()),
            [],
            self.force,
        )?;
        outputs.folder("--out", &self.out)?;
        if self.out.is_dir() {
            for name in report::FILES {
                outputs.file("--out", &self.out.join(name))?;
            }
            let figures = self.out.join(report::FIGURES);
            ensure!(
                self.force || !figures.exists(),
                "{} exists; give --force to overwrite the figures in it",
                figures.display()
            );
        }
        Ok(())
    }
}

fn with_progress(options: &Options) -> anyhow::Result<Verification> {
    let bar = ProgressBar::new(0).with_style(
        ProgressStyle::with_template(
            "{elapsed_precise} [{bar:40}] {pos}/{len} s simulated on the ECU, {eta} left",
        )
        .expect("the template is valid")
        .progress_chars("=> "),
    );
    let simulated_s = Mutex::new(0.0);
    let on_terminal = std::io::stderr().is_terminal();
    let start = Instant::now();
    let verification = verify(options, |progress| match progress {
        Progress::Planned(seconds) => bar.inc_length(seconds as u64),
        Progress::Simulated(seconds) => {
            let mut total_s = simulated_s
                .lock()
                .expect("no thread panics while it is locked");
            *total_s += seconds;
            bar.set_position(*total_s as u64);
        }
        Progress::Done(line) if on_terminal => bar.suspend(|| eprintln!("{line}")),
        Progress::Done(line) => eprintln!("[{:5.1} s] {line}", start.elapsed().as_secs_f64()),
    });
    bar.finish_and_clear();
    Ok(verification?)
}

/// The recorded proofs by name; none without a checkout.
fn recorded(folder: &Path) -> Vec<(String, String)> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut proofs: Vec<(String, String)> = files
        .map(|file| file.path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "txt"))
        .filter_map(|path| {
            let name = path.file_stem()?.to_string_lossy().into_owned();
            Some((name, std::fs::read_to_string(&path).ok()?))
        })
        .collect();
    proofs.sort();
    proofs
}

fn write_report(
    folder: &Path,
    verification: &Verification,
    proofs: &[(String, String)],
) -> anyhow::Result<()> {
    let input = ReportInput {
        title: "Steering ECU: firmware against host, and chaos suppressed by dither",
        verdict: &verification.verdict,
        runs: &verification.runs,
        pairs: &verification.pairs,
        drives: &verification.drives,
        proofs,
        notes: &verification.notes,
    };
    report::write(folder, &input)
}

fn show(verification: &Verification, folder: &Path, elapsed: Duration) {
    let verdict = &verification.verdict;
    let table = terminal::table(verdict, std::io::stdout().is_terminal());
    say!("{}", table.trim_end());
    say!("report: {}", folder.join("index.html").display());
    say!(
        "verdict: {} in {:.0} s",
        verdict.verdict,
        elapsed.as_secs_f64()
    );
}
