//! Faults of the ECU's processor, injected into the firmware through the emulator's gdb stub; and
//! faults between vehicle and ECU, to which firmware and host react bit-identically.

use pil::fault::catalogue::{self, Kind};
use pil::fault::judge::{Detector, Reaction, Verdict};
use pil::fault::memory::flips;
use pil::fault::processor::{BENCH_TICKS, Bench};
use pil::fault::processor_fault::{Action, ProcessorFault, Region};
use pil::fault::row::Row;
use pil::mil_sil_pil::Target;
use qemu::Machine;
use qemu::session::LinkKind;
use rayon::prelude::*;
use shared_model::frame::decode_actuation;
use shared_model::signal::Mode;
use std::collections::BTreeSet;
use std::time::Duration;
use tests::image;

const TICK: u32 = BENCH_TICKS.start;
/// Without an answer for so long, the ECU has stopped sending. An answer takes some milliseconds, and one flip is
/// judged by this time.
const STALLED: Duration = Duration::from_secs(15);
/// Flips in each region.
const FLIPS: usize = 5;

fn target() -> Target {
    Target {
        image: image("bench"),
        machine: Machine::Mps2An386,
        link: LinkKind::Timed,
        time_out: STALLED,
    }
}

fn bench() -> Bench {
    Bench::short(&target()).unwrap_or_else(|error| panic!("{error}"))
}

/// The debugger's stops alone change nothing, so any other difference is caused by the fault.
#[test]
fn stops_change_nothing() {
    let bench = bench();
    let run = bench.run(Action::Nothing, TICK).expect("it runs");
    assert_eq!(run.packets, bench.fault_free());
    assert_eq!(run.outcome.verdict, Verdict::NoEffect);
}

#[test]
fn faults_of_the_core_are_detected() {
    let bench = bench();
    let ended = |code| (Reaction::Ended, Some(Detector::Firmware(code)));
    for (action, (reaction, detector), latest) in [
        (Action::MissPwm(3), (Reaction::SafeState, None), 1),
        (Action::MissControl, (Reaction::SafeState, None), 2),
        (Action::DoubleControl, (Reaction::Tolerated, None), 1),
        (Action::Overrun, (Reaction::SafeState, None), 2),
        // The watchdog expires after 20 ms.
        (Action::HangMainLoop, ended(15), 21),
        (Action::OverflowStack, ended(14), 1),
        (Action::HardFault, ended(14), 1),
        (Action::Reset, (Reaction::Restart, None), 1),
    ] {
        let outcome = bench.run(action, TICK).expect("it runs").outcome;
        assert_eq!(outcome.reaction, reaction, "{action}: {outcome:?}");
        let detection = outcome.detection.expect("it was detected");
        assert!(detection.latency_ticks <= latest, "{action}: {detection:?}");
        if let Some(detector) = detector {
            assert_eq!(detection.detector, detector, "{action}");
        }
    }
}

/// The same fault gives the same run.
#[test]
fn faults_are_repeatable() {
    let bench = bench();
    let run = |flip: &ProcessorFault| bench.run(flip.action, flip.tick).expect("it runs");
    let flips = flips(&target().image, FLIPS, TICK..TICK + 10);
    // Not every bit is read again.
    let found = flips.iter().map(|flip| (flip, run(flip)));
    let (flip, first) = found
        .into_iter()
        .find(|(_, run)| run.packets != bench.fault_free())
        .expect("a bit of the control task has an effect");
    assert_eq!(first, run(flip));
}

#[test]
fn sr13_no_flipped_bit_is_undetected() {
    let bench = bench();
    let flips = flips(&target().image, FLIPS, BENCH_TICKS);
    assert_eq!(flips.len(), FLIPS * Region::ALL.len());
    let rows: Vec<Row> = flips
        .par_iter()
        .map(|flip| {
            bench
                .inject(*flip)
                .unwrap_or_else(|error| panic!("{flip:?}: {error}"))
        })
        .collect();
    let failures: Vec<&Row> = rows.iter().filter(|row| row.is_failure()).collect();
    assert!(failures.is_empty(), "{failures:#?}");
    // The control task is compared as a whole at its next tick.
    let in_control = rows
        .iter()
        .filter(|row| row.kind == Region::ControlTask.name());
    let found = in_control.filter(|row| row.latency_ticks.is_some_and(|ticks| ticks <= 1));
    assert!(found.count() >= FLIPS - 1);
}

/// After a reset the ECU starts from its initial state: neutral, its counters from zero.
#[test]
fn a_reset_restarts_from_the_initial_state() {
    let bench = bench();
    let packets = bench.run(Action::Reset, TICK).expect("it runs").packets;
    let from = (10 * TICK) as usize;
    assert_eq!(packets[..from], bench.fault_free()[..from]);
    let since = &packets[from..];
    // Neutral at least for the two ticks that the first command takes.
    assert!(
        since[..20]
            .iter()
            .all(|packet| packet.duty_code == bench.fault_free()[0].duty_code)
    );
    let first = since.iter().find_map(|packet| packet.frame);
    let first = first.expect("a frame comes");
    let [_, _, counter, ..] = first;
    assert_eq!(counter, 0);
    let actuation = decode_actuation(&first).expect("the mode is known");
    assert_eq!((actuation.mode, actuation.faults), (Mode::Starting, 0));
}

/// One fault of each kind between vehicle and ECU.
#[test]
fn firmware_and_host_react_identically() {
    let bench = bench();
    let mut seen = BTreeSet::new();
    for fault in catalogue::all() {
        if matches!(fault.kind, Kind::Timing(_)) || !seen.insert(fault.kind.name()) {
            continue;
        }
        let [software, processor] = bench
            .both(fault, TICK)
            .unwrap_or_else(|error| panic!("{fault}: {error}"));
        assert_eq!(software, processor, "{fault}");
        assert_eq!(software.len(), bench.fault_free().len());
    }
    assert!(seen.len() > 20, "{seen:?}");
}
