//! `sim-host faults`: faults on purpose, and whether any of them stays unfound.

use super::emulator::open_image;
use super::options::time_out;
use super::outcome::Outcome;
use super::output::{Destinations, named};
use clap::Args;
use dynamics::words::counted;
use indicatif::{ProgressBar, ProgressStyle};
use pil::fault::campaign::{self, Clean, Row, Total, totals};
use pil::fault::catalogue::{self, Class};
use pil::fault::figure::draw;
use pil::fault::manoeuvres;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Times of the injections from the manoeuvre's start, s: under the undithered chaos, settled under the dither, and later.
const TIMES_S: [f64; 3] = [2.5, 9.0, 14.5];
const QUICK_TIMES_S: [f64; 1] = [9.0];
/// Bits that are flipped in each region of the memory.
const FLIPS: usize = 85;
const QUICK_FLIPS: usize = 5;
/// Unlisted silent faults that are named on the terminal.
const MOST_NAMED: usize = 20;

/// Injects faults into sensors, links, servo, interrupts, memory and core of the ECU in the loop, and judges each run against its
/// clean twin.
///
/// Sensors, links, servo and interrupts fail on all manoeuvres with the ECU's program on this host, memory and core on a short
/// run of the firmware in QEMU. A fault is silent if nobody finds it and the ECU commands something else than without it, or
/// works on a wrong value. Three to four minutes on 2 cores. Exit code 1 if a fault is silent that is not on the list of those that
/// may be.
#[derive(Args)]
#[command(after_help = "Examples:
  sim-host faults --quick
  sim-host faults --firmware target/thumbv7em-none-eabihf/firmware/ecu \\
      --out faults.csv --json faults.json --figure faults.svg")]
pub struct Arguments {
    /// One moment of injection a manoeuvre, and few bits
    #[arg(long)]
    quick: bool,
    /// The firmware's ELF, for faults of memory and core; without it there are none
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Longest time for one answer of the emulator, s
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0)]
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
    let firmware = named("--firmware", &arguments.firmware);
    arguments.destinations.check(firmware)?;
    let limit = time_out(arguments.time_out)?;
    // Before the minutes of work on the host.
    let image = arguments.firmware.as_deref().map(open_image).transpose()?;
    let mut rows = on_host(arguments.quick)?;
    match image {
        Some(image) => rows.extend(processor::inject(image, arguments.quick, limit)?),
        None => eprintln!("no --firmware: no faults of memory and core"),
    }
    report(&rows);
    let totals = totals(&rows);
    let totals = totals.iter().map(|(class, total)| (class.name(), *total));
    let results = Results {
        totals: totals.collect(),
        rows: &rows,
    };
    let figure = || draw(&rows);
    arguments.destinations.write(&rows, &results, figure)?;
    let is_unlisted = rows.iter().any(Row::is_unlisted);
    Ok(if is_unlisted {
        Outcome::Failed
    } else {
        Outcome::Success
    })
}

fn on_host(quick: bool) -> anyhow::Result<Vec<Row>> {
    let times_s = if quick { &QUICK_TIMES_S[..] } else { &TIMES_S };
    let manoeuvres = manoeuvres::all()?;
    let cleans = manoeuvres
        .par_iter()
        .map(|(scenario, manoeuvre)| Clean::drive(scenario, manoeuvre, times_s))
        .collect::<Result<Vec<_>, _>>()?;
    let faults = catalogue::all();
    let progress = progress(campaign::runs(&cleans, &faults));
    let rows = campaign::inject(&cleans, &faults, || progress.inc(1));
    progress.finish_and_clear();
    Ok(rows?)
}

mod processor {
    use super::{FLIPS, QUICK_FLIPS, progress};
    use image::Image;
    use pil::fault::campaign::Row;
    use pil::fault::memory::flips;
    use pil::fault::processor::{Action, BENCH_TICKS, Bench};
    use pil::levels::Target;
    use qemu::session::LinkKind;
    use qemu::{Machine, RunError};
    use rayon::prelude::*;
    use std::time::Duration;

    /// Faults of memory and core, each in an emulator of its own.
    pub fn inject(image: Image, quick: bool, time_out: Duration) -> anyhow::Result<Vec<Row>> {
        let target = Target {
            image,
            machine: Machine::Mps2An386,
            link: LinkKind::Timed,
            time_out,
        };
        let bench = Bench::short(&target)?;
        let count = if quick { QUICK_FLIPS } else { FLIPS };
        let flips = flips(
            &target.image,
            count,
            BENCH_TICKS.start,
            BENCH_TICKS.len() as u32,
        );
        let progress = progress(Action::EVENTS.len() + flips.len());
        let counted = |row: Result<Row, RunError>| {
            if interrupt::requested() {
                return Err(RunError::Interrupted);
            }
            progress.inc(1);
            row
        };
        let events = Action::EVENTS
            .par_iter()
            .map(|&action| counted(bench.event(action, BENCH_TICKS.start)));
        let flips = flips.par_iter().map(|flip| counted(bench.flip(flip)));
        let rows: Result<Vec<_>, _> = events.chain(flips).collect();
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
        "{:<10} {:>8} {:>8} {:>9} {:>8} {:>13} {:>15} {:>13}",
        "class",
        "injected",
        "detected",
        "tolerated",
        "harmless",
        "silent listed",
        "silent unlisted",
        "worst latency"
    );
    let totals = totals(rows);
    for class in Class::ALL {
        let total = totals.get(&class).copied().unwrap_or_default();
        say!(
            "{:<10} {:>8} {:>8} {:>9} {:>8} {:>13} {:>15} {:>7} ticks",
            class.name(),
            total.injected,
            total.detected,
            total.tolerated,
            total.harmless,
            total.silent_listed,
            total.silent_unlisted,
            total.worst_latency_ticks
        );
    }
    let unlisted = rows.iter().filter(|row| row.is_unlisted());
    for row in unlisted.take(MOST_NAMED) {
        say!(
            "silent: {} at {} s of {}",
            row.fault,
            row.injected_s,
            row.manoeuvre
        );
    }
    let reasons: BTreeSet<_> = rows.iter().filter_map(|row| row.accepted).collect();
    for reason in reasons {
        let of_it = rows.iter().filter(|row| row.accepted == Some(reason));
        say!(
            "silent and listed, {}: {reason}",
            counted(of_it.count(), "time")
        );
    }
}
