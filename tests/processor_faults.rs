//! Faults of the ECU's processor, done to the firmware through the emulator's gdb stub; and faults between vehicle and
//! ECU, which the firmware takes as the host's program does, bit for bit.

use pil::fault::campaign::Row;
use pil::fault::catalogue::{self, Kind};
use pil::fault::judge::{Finder, Reaction, Verdict};
use pil::fault::memory::{Region, flips};
use pil::fault::processor::{Action, BENCH_TICKS, Bench};
use pil::levels::Target;
use qemu::Machine;
use qemu::session::LinkKind;
use shared_model::frame::decode_actuation;
use shared_model::signal::Mode;
use std::collections::BTreeSet;
use tests::{TIME_OUT, image};

const TICK: u32 = BENCH_TICKS.start;
/// Flips in each region.
const FLIPS: usize = 5;

fn target() -> Target {
    Target {
        image: image("ecu"),
        machine: Machine::Mps2An386,
        link: LinkKind::Timed,
        time_out: TIME_OUT,
    }
}

fn bench() -> Bench {
    Bench::short(&target()).unwrap_or_else(|error| panic!("{error}"))
}

/// The stops alone change nothing, so that what else is different is the fault's doing.
#[test]
fn stops_change_nothing() {
    let bench = bench();
    let run = bench.run(Action::Nothing, TICK).expect("it runs");
    assert_eq!(run.packets, bench.clean());
    assert_eq!(run.outcome.verdict, Verdict::Harmless);
}

#[test]
fn what_is_done_to_the_core_is_found() {
    let bench = bench();
    let ended = |code| (Reaction::Ended, Some(Finder::Firmware(code)));
    for (action, (reaction, finder), latest) in [
        (Action::MissPwm(3), (Reaction::SafeState, None), 1),
        (Action::MissControl, (Reaction::SafeState, None), 2),
        (Action::DoubleControl, (Reaction::Tolerated, None), 1),
        (Action::Overrun, (Reaction::SafeState, None), 2),
        // The watchdog has 20 ms.
        (Action::HangMainLoop, ended(15), 21),
        (Action::OverflowStack, ended(14), 1),
        (Action::HardFault, ended(14), 1),
        (Action::Reset, (Reaction::Restart, None), 1),
    ] {
        let outcome = bench.run(action, TICK).expect("it runs").outcome;
        assert_eq!(outcome.reaction, reaction, "{action}: {outcome:?}");
        let finding = outcome.finding.expect("it was found");
        assert!(finding.latency_ticks <= latest, "{action}: {finding:?}");
        if let Some(finder) = finder {
            assert_eq!(finding.finder, finder, "{action}");
        }
    }
}

/// The same fault gives the same run.
#[test]
fn faults_are_repeatable() {
    let bench = bench();
    let flip = flips(&target().image, FLIPS, TICK, 10)[0];
    let [a, b] = [(), ()].map(|()| bench.run(flip.action, flip.tick).expect("it runs"));
    assert_eq!(a, b);
    assert_ne!(a.packets, bench.clean());
}

#[test]
fn no_flipped_bit_is_silent() {
    let bench = bench();
    let flips = flips(&target().image, FLIPS, TICK, BENCH_TICKS.len() as u32);
    assert_eq!(flips.len(), FLIPS * Region::ALL.len());
    let rows: Vec<Row> = flips
        .iter()
        .map(|flip| {
            bench
                .flip(flip)
                .unwrap_or_else(|error| panic!("{flip:?}: {error}"))
        })
        .collect();
    let unlisted: Vec<&Row> = rows.iter().filter(|row| row.is_unlisted()).collect();
    assert!(unlisted.is_empty(), "{unlisted:#?}");
    // The control task is compared as a whole at its next tick.
    let in_control = rows
        .iter()
        .filter(|row| row.kind == Region::ControlTask.name());
    let found = in_control.filter(|row| row.latency_ticks.is_some_and(|ticks| ticks <= 1));
    assert!(found.count() >= FLIPS - 1);
}

/// After a reset the ECU begins anew, on the processor as on the host: neutral, its counters from zero.
#[test]
fn a_reset_begins_anew() {
    let bench = bench();
    let packets = bench.run(Action::Reset, TICK).expect("it runs").packets;
    let from = (10 * TICK) as usize;
    assert_eq!(packets[..from], bench.clean()[..from]);
    let since = &packets[from..];
    // Neutral at least for the two ticks that the first command takes.
    assert!(
        since[..20]
            .iter()
            .all(|packet| packet.duty_code == bench.clean()[0].duty_code)
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
fn the_firmware_takes_faults_as_the_host_does() {
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
        assert_eq!(software.len(), bench.clean().len());
    }
    assert!(seen.len() > 20, "{seen:?}");
}
