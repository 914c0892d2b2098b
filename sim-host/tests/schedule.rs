//! The dither's schedule: the ECU's table against the analysis, the number of threads, and bad
//! input.

mod common;

use common::{assert_ends, assert_refused, command, folder};
use dynamics::schedule::choose::Choice;
use dynamics::schedule::{Analysis, Plan, schedule};
use dynamics::sweep::{RunControl, Timing, Values};
use shared_model::dither::Waveform;
use shared_model::schedule::Schedule;
use shared_model::schedule_table::{POINTS, SINE, SQUARE};
use shared_model::{Real, Scenario};
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The plan behind the ECU's table, at fewer speeds.
fn plan(from_rpm: f64, to_rpm: f64, greatest_v: f64) -> Plan {
    let step_v = greatest_v / 30.0;
    Plan {
        speeds_rpm: Values::new("wheel speed", from_rpm, to_rpm, 25.0).unwrap(),
        amplitudes_v: Values::parts("amplitude", greatest_v, 30).unwrap(),
        edge_width_v: step_v / 16.0,
        margin: 0.25,
        greatest_multiplier: 0.8,
        timing: Timing::new(150.0, 200.0).unwrap(),
    }
}

fn analysis(waveform: Waveform, plan: &Plan) -> Analysis {
    let mut scenario = Scenario::reconstruction();
    scenario.dither.waveform = waveform;
    let watch = RunControl {
        stop: &AtomicBool::new(false),
        done: &|| (),
    };
    let made = schedule(&scenario, plan, watch).expect("the scenarios are valid");
    made.expect("it is not interrupted")
}

/// An entry needs its neighbours' ranges, so of three speeds the middle one is as in the whole
/// table.
#[test]
fn the_ecus_table_is_what_the_analysis_gives() {
    for (waveform, greatest_v, table, around_rpm) in [
        (Waveform::Square, 0.15, SQUARE, 1750.0),
        (Waveform::Square, 0.15, SQUARE, 1550.0),
        (Waveform::Sine, 1.35, SINE, 1900.0),
    ] {
        let plan = plan(around_rpm - 25.0, around_rpm + 25.0, greatest_v);
        let made = analysis(waveform, &plan);
        let entry = made.entries[1];
        assert_eq!(entry.choice, Choice::PeriodOne, "{entry:?}");
        assert_eq!(entry.amplitude_v as f32, entry_of(&table, around_rpm));
        let range = entry.range.expect("there is dither");
        assert!(entry.amplitude_v - range.from_v >= made.room_v);
        assert!(range.to_v - entry.amplitude_v >= made.room_v);
        assert_eq!(made.failed_checks().count(), 0, "{:?}", made.checks);
        assert_eq!(made.lost_margins().count(), 0, "{:?}", made.margins);
        // The paper's attractor is of period one at each of them, from the other start there may be
        // rest.
        assert_eq!(made.checks.len(), 5);
    }
}

fn entry_of(table: &Schedule<f32, POINTS>, rpm: f64) -> f32 {
    let place = (rpm as f32 - table.first_rpm) / table.step_rpm;
    table.amplitudes_v[place.to_u32() as usize]
}

/// The undithered motion of period one at 1500 rpm and rest on the other lobe need no dither;
/// nothing is to be found where the range of amplitudes ends below the least good one.
#[test]
fn no_dither_where_none_is_needed_and_none_where_none_helps() {
    let calm = analysis(Waveform::Square, &plan(1500.0, 1500.0, 0.01));
    assert_eq!(calm.entries[0].choice, Choice::Undithered);
    assert!(calm.entries[0].coexist_undithered);
    assert_eq!(calm.amplitudes_v(), [0.0]);
    let weak = analysis(Waveform::Square, &plan(1750.0, 1750.0, 0.06));
    assert_eq!(weak.hopeless_rpm(), [1750.0]);
    assert_eq!(weak.failed_checks().count(), 1);
}

const FILES: [&str; 4] = ["o.rs", "o.csv", "o.json", "o.svg"];
const TO_FILES: &str = "--out o.rs --csv o.csv --json o.json --figure o.svg --force";

#[test]
fn the_number_of_threads_does_not_change_the_bytes() {
    let folder = folder();
    let made = ["1", "3"].map(|threads| {
        let line = format!(
            "schedule --from 1700 --to 1750 --step 50 --amplitudes 10 --transient 40 --time 70 {TO_FILES}"
        );
        let mut command = command(folder.path(), line.split_whitespace());
        assert_ends(command.env("RAYON_NUM_THREADS", threads), 0);
        FILES.map(|name| fs::read_to_string(folder.path().join(name)).expect("written"))
    });
    assert_eq!(made[0], made[1]);
    let [table, csv, json, _] = &made[0];
    assert!(table.contains("--from 1700 --to 1750") && table.contains("POINTS: usize = 2;"));
    assert!(table.contains("// 1750 rpm: period one from 0."), "{table}");
    assert!(csv.lines().count() > 2 * 2 * 11, "{csv}");
    serde_json::from_str::<serde_json::Value>(json).expect("JSON");
}

/// Exit code 1, and the table says so: an amplitude range that ends too low has no period one.
#[test]
fn a_speed_that_nothing_calms_fails() {
    let folder = folder();
    let line = format!(
        "schedule --from 1750 --to 1750 --square-to 0.02 --sine-to 0.2 --amplitudes 2 --transient 20 --time 60 {TO_FILES}"
    );
    let output = assert_ends(&mut command(folder.path(), line.split_whitespace()), 1);
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains("FAILED at 1750 rpm"), "{shown}");
    let table = fs::read_to_string(folder.path().join("o.rs")).expect("written");
    assert!(table.contains("NEITHER PERIOD ONE NOR REST"), "{table}");
}

#[test]
fn bad_input_is_refused_and_nothing_is_written() {
    for (rest, parts) in [
        ("--from 1900 --to 1e300", &["ten million"][..]),
        ("--step 0", &["in steps of 0", "greater than 0"]),
        ("--step nan", &["in steps of NaN", "finite"]),
        ("--from 0 --to 50", &["run.wheel_speed_rpm = 0"]),
        ("--margin -0.1", &["--margin -0.1", "from 0 to 1"]),
        ("--margin 1.1", &["--margin 1.1", "from 0 to 1"]),
        ("--margin nan", &["--margin NaN", "from 0 to 1"]),
        (
            "--greatest-multiplier 0",
            &["--greatest-multiplier 0", "less than 1"],
        ),
        (
            "--greatest-multiplier nan",
            &["--greatest-multiplier NaN", "greater than 0"],
        ),
        ("--square-to 0", &["square wave", "greater than 0"]),
        ("--sine-to -1", &["amplitude of the sine", "-1"]),
        ("--sine-to 20", &["bus_voltage"]),
        ("--amplitudes 1", &["--amplitudes"]),
        (
            "--square-step 0.1",
            &["2 values from 0 to 0.15", "3 to 1001"],
        ),
        ("--transient 200", &["transient of 200 s", "shorter"]),
    ] {
        let folder = folder();
        let line = format!("schedule {rest} {TO_FILES}");
        assert_refused(folder.path(), line.split_whitespace(), parts);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{line}");
    }
}

/// Twenty seconds on 2 cores: `cargo test --release -p sim-host --test schedule -- --ignored`.
#[test]
#[ignore = "makes the whole table"]
fn the_whole_table_is_made_again_byte_for_byte() {
    let folder = folder();
    let arguments = ["schedule", "--out", "table.rs"];
    assert_ends(&mut command(folder.path(), arguments), 0);
    let made = fs::read_to_string(folder.path().join("table.rs")).expect("written");
    let committed =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared-model/src/schedule_table.rs");
    assert_eq!(made, fs::read_to_string(committed).expect("it is there"));
}
