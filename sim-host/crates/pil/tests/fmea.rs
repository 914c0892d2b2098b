//! The table of failure modes and effects in the documentation has the failure modes of the
//! catalogue.

use pil::fault::catalogue::{self, Class};
use pil::fault::fmea::{HEADING, table};
use pil::fault::injection::Injection;
use pil::fault::judge::{Outcome, Peaks, Reaction, Verdict};
use pil::fault::processor_fault::{Action, ProcessorFault, Region};
use pil::fault::row::{Row, Setting, row};
use std::collections::BTreeSet;
use std::path::Path;

/// Class and failure mode of a line.
fn mode(line: &str) -> Option<(String, String)> {
    let mut cells = line.strip_prefix("| ")?.split(" | ");
    Some((cells.next()?.to_owned(), cells.next()?.to_owned()))
}

#[test]
fn the_documented_table_has_the_modes_of_the_catalogue() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../docs/fmea.md");
    let page = std::fs::read_to_string(page).expect("the page is there");
    let (_, lines) = page.split_once(HEADING).expect("it has the table");
    let documented: BTreeSet<_> = lines.lines().map_while(mode).collect();

    let mut expected = BTreeSet::new();
    let mut add = |injection: Injection| {
        expected.insert((
            injection.class().name().to_owned(),
            injection.kind().to_owned(),
        ));
    };
    for fault in catalogue::all() {
        add(Injection::Loop(fault));
    }
    for event in ProcessorFault::events(1) {
        add(Injection::Processor(event));
    }
    for region in Region::ALL {
        add(Injection::Processor(ProcessorFault {
            action: Action::Flip { address: 0, bit: 0 },
            region: Some(region),
            tick: 1,
        }));
    }
    assert_eq!(
        documented, expected,
        "documented (left) and injected (right)"
    );
}

/// A row of the fault with that number, with another steering angle.
fn example(number: usize, steering_angle_rad: f64, verdict: Verdict) -> Row {
    let injection = Injection::Loop(catalogue::all()[number]);
    let setting = Setting {
        manoeuvre: "straight",
        in_loop: "SIL",
        injected_s: 1.0,
        fault_free: Peaks {
            steering_angle_rad: 0.25,
            front_slip_angle_rad: 0.0,
        },
    };
    let outcome = Outcome {
        verdict,
        detection: None,
        reaction: Reaction::SafeState,
        peaks: Peaks {
            steering_angle_rad,
            front_slip_angle_rad: 0.0,
        },
    };
    row(&injection, &setting, &outcome)
}

#[test]
fn a_mode_has_one_line_with_its_worst_run() {
    let rows = [
        example(0, 0.3, Verdict::Detected),
        example(0, 0.5, Verdict::Undetected),
        example(0, 0.4, Verdict::Undetected),
    ];
    let table = table(&rows);
    let lines: Vec<&str> = table
        .strip_prefix(HEADING)
        .expect("a heading")
        .lines()
        .collect();
    let class = Class::Sensor.name();
    let expected = format!("| {class} | sensor NaN | 3 | 2 | - | - | safe state | 0.50 | 0.25 |");
    assert_eq!(lines, [expected]);
    assert_eq!(pil::fault::fmea::table(&[]), HEADING);
}
