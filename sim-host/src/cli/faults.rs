//! `sim-host faults`: the fault campaign.

use super::emulator::open_image;
use super::firmware::find;
use super::options::time_out;
use super::outcome::Outcome;
use super::output::{Destinations, check, named};
use clap::Args;
use dynamics::words::counted;
use files::output::write_text;
use indicatif::{ProgressBar, ProgressStyle};
use pil::fault::catalogue::{self, Class};
use pil::fault::figure::draw;
use pil::fault::fmea;
use pil::fault::host::{self, FaultFree};
use pil::fault::manoeuvres;
use pil::fault::row::Row;
use pil::fault::totals::{Total, totals};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Times of injection from the manoeuvre's start, s: in the chaos without dither, settled under the
/// dither, and later.
const TIMES_S: [f64; 3] = [2.5, 9.0, 14.5];
const QUICK_TIMES_S: [f64; 1] = [9.0];
/// Bit flips in each region of the memory.
const FLIPS: usize = 85;
const QUICK_FLIPS: usize = 5;
/// Undetected faults that are listed on the terminal.
const MAX_LISTED: usize = 20;

/// Inject faults into the ECU in the loop, and compare every run with its fault-free run.
///
/// Faults of sensors, links, servo and interrupts are injected on seven manoeuvres with the ECU's
/// program on this host. Faults of memory and core are injected in a short run of the firmware in
/// QEMU. A fault is undetected if no diagnostic is raised, but an output of the ECU differs or a
/// corrupted value is in use. The run takes three to four minutes on 2 cores. The exit code is 1 if
/// an undetected fault has no waiver.
#[derive(Args)]
#[command(after_help = "Examples:
  sim-host faults --quick
  sim-host faults --firmware target/thumbv7em-none-eabihf/firmware/bench \\
      --out faults.csv --json faults.json --figure faults.svg")]
pub struct Arguments {
    /// Inject at one time per manoeuvre, and flip few bits
    #[arg(long)]
    quick: bool,
    /// Firmware image (ELF) for the faults of memory and core, which are omitted without it; without
    /// a path `bench` in the folder DITHERSTEER_FIRMWARE, in `firmware` beside this program, or in
    /// target/
    #[arg(long, value_name = "ELF", num_args = 0..=1)]
    firmware: Option<Option<PathBuf>>,
    /// Write the failure modes, their effects and their detection (FMEA) as a table in Markdown
    #[arg(long, value_name = "FILE")]
    fmea: Option<PathBuf>,
    /// Time without an answer after which the ECU has stopped sending, s; an answer takes milliseconds
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    time_out: f64,
    #[command(flatten)]
    destinations: Destinations,
}

#[derive(Serialize)]
struct Results<'a> {
    totals: BTreeMap<&'static str, Total>,
    rows: &'a [Row],
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let firmware = match &arguments.firmware {
        Some(None) => Some(find::image("bench")?),
        Some(Some(path)) => Some(path.clone()),
        None => None,
    };
    let destinations = &arguments.destinations;
    let fmea = named("--fmea", &arguments.fmea);
    let files = destinations.files().into_iter().chain([fmea]);
    check(named("--firmware", &firmware), files, destinations.force)?;
    let limit = time_out(arguments.time_out)?;
    // Before the campaign on the host, which takes minutes.
    let image = firmware.as_deref().map(open_image).transpose()?;
    let mut rows = on_host(arguments.quick)?;
    match image {
        Some(image) => rows.extend(processor::inject(image, arguments.quick, limit)?),
        None => eprintln!("without --firmware, the faults of memory and core are omitted"),
    }
    report(&rows);
    let totals = totals(&rows);
    let totals = totals.iter().map(|(class, total)| (class.name(), *total));
    let results = Results {
        totals: totals.collect(),
        rows: &rows,
    };
    let figure = || draw(&rows);
    destinations.write(&rows, &results, figure)?;
    if let Some(path) = &arguments.fmea {
        write_text(path, &fmea::table(&rows), destinations.force)?;
    }
    let is_failure = rows.iter().any(Row::is_failure);
    Ok(if is_failure {
        Outcome::Failed
    } else {
        Outcome::Success
    })
}

fn on_host(quick: bool) -> anyhow::Result<Vec<Row>> {
    let times_s = if quick { &QUICK_TIMES_S[..] } else { &TIMES_S };
    let manoeuvres = manoeuvres::all()?;
    let fault_free = manoeuvres
        .par_iter()
        .map(|(scenario, manoeuvre)| FaultFree::run(scenario, manoeuvre, times_s))
        .collect::<Result<Vec<_>, _>>()?;
    let faults = catalogue::all();
    let progress = progress(host::runs(&fault_free, &faults));
    let rows = host::inject(&fault_free, &faults, &|| progress.inc(1));
    progress.finish_and_clear();
    Ok(rows?)
}

mod processor {
    use super::{FLIPS, QUICK_FLIPS, progress};
    use image::Image;
    use pil::fault::memory::flips;
    use pil::fault::processor::{BENCH_TICKS, Bench};
    use pil::fault::processor_fault::ProcessorFault;
    use pil::fault::row::Row;
    use pil::mil_sil_pil::Target;
    use qemu::session::LinkKind;
    use qemu::{Machine, RunError};
    use rayon::prelude::*;
    use std::time::Duration;

    /// Faults of memory and core, each in a separate emulator.
    pub fn inject(image: Image, quick: bool, time_out: Duration) -> anyhow::Result<Vec<Row>> {
        let target = Target {
            image,
            machine: Machine::Mps2An386,
            link: LinkKind::Timed,
            time_out,
        };
        let bench = Bench::short(&target)?;
        let count = if quick { QUICK_FLIPS } else { FLIPS };
        let mut faults: Vec<_> = ProcessorFault::events(BENCH_TICKS.start).collect();
        faults.extend(flips(&target.image, count, BENCH_TICKS));
        let progress = progress(faults.len());
        let inject = |fault: &ProcessorFault| {
            let row = bench.inject(*fault);
            if interrupt::requested() {
                return Err(RunError::Interrupted);
            }
            progress.inc(1);
            row
        };
        let rows: Result<Vec<Row>, _> = faults.par_iter().map(inject).collect();
        progress.finish_and_clear();
        Ok(rows?)
    }
}

fn progress(runs: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} faults, {eta} left");
    ProgressBar::new(runs as u64).with_style(style.expect("the template is valid"))
}

fn report(rows: &[Row]) {
    say!(
        "{:<10} {:>8} {:>8} {:>9} {:>9} {:>6} {:>10} {:>13}",
        "class",
        "injected",
        "detected",
        "tolerated",
        "no effect",
        "waived",
        "undetected",
        "worst latency"
    );
    let totals = totals(rows);
    for class in Class::ALL {
        let total = totals.get(&class).copied().unwrap_or_default();
        say!(
            "{:<10} {:>8} {:>8} {:>9} {:>9} {:>6} {:>10} {:>7} ticks",
            class.name(),
            total.injected,
            total.detected,
            total.tolerated,
            total.no_effect,
            total.waived,
            total.undetected,
            total.worst_latency_ticks
        );
    }
    let failures = rows.iter().filter(|row| row.is_failure());
    for row in failures.take(MAX_LISTED) {
        say!(
            "undetected: {} at {} s of {}",
            row.fault,
            row.injected_s,
            row.manoeuvre
        );
    }
    let rationales: BTreeSet<_> = rows.iter().filter_map(|row| row.waiver).collect();
    for rationale in rationales {
        let waived = rows.iter().filter(|row| row.waiver == Some(rationale));
        say!("waived, {}: {rationale}", counted(waived.count(), "fault"));
    }
}
