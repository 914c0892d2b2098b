//! `sim-host continue` as a user meets it: its results, and bad input.

mod common;

use common::{assert_ends, assert_refused, command, folder};
use std::fs;

#[test]
fn branches_and_their_bifurcations_are_written_and_printed() {
    let folder = folder();
    let arguments = [
        "continue",
        "--rpm",
        "1620",
        "--from",
        "1600",
        "--to",
        "1660",
        "--doublings",
        "1",
        "--out",
        "b.csv",
        "--json",
        "b.json",
        "--figure",
        "b.svg",
    ];
    let output = assert_ends(&mut command(folder.path(), arguments), 0);
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(
        text.contains("period doubling at run.wheel_speed_rpm = 1639.1888"),
        "{text}"
    );
    assert!(text.contains("subcritical"), "{text}");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a file");
    let rows = read("b.csv");
    assert!(
        rows.lines().any(|row| row.contains(",period doubling,")),
        "{rows}"
    );
    // Of twice the period, from the doubling.
    assert!(rows.lines().any(|row| row.starts_with("1,orbit,")));
    assert!(!rows.contains("NaN"));
    let json: serde_json::Value = serde_json::from_str(&read("b.json")).expect("JSON");
    let multiplier = &json["specials"][0]["multipliers"][0]["re"];
    assert!((multiplier.as_f64().expect("a number") + 1.0).abs() < 1e-6);
    let figure = read("b.svg");
    assert!(figure.contains("unstable") && figure.contains("period doubling"));
    // What is there is not overwritten.
    assert_refused(folder.path(), arguments, &["b.csv", "--force"]);
}

#[test]
fn bad_input_is_refused_with_its_bounds() {
    let refused = |line: &str, parts: &[&str]| {
        let folder = folder();
        let arguments = format!("continue {line} --out o.csv");
        assert_refused(folder.path(), arguments.split_whitespace(), parts);
        assert!(!folder.path().join("o.csv").exists(), "{line}");
    };
    refused(
        "--from 2000 --to 1500",
        &["from 2000 to 1500", "ascending range"],
    );
    refused(
        "--from 1600 --to 1600",
        &["from 1600 to 1600", "ascending range"],
    );
    refused("--from nan", &["from NaN", "ascending range"]);
    refused("--from -5", &["from -5", "within 1 to 100000"]);
    refused("--rpm 1400", &["1400", "in the range from 1500 to 2000"]);
    refused("--tolerance 0", &["tolerance of 0e0", "1e-14"]);
    refused("--tolerance 1", &["tolerance of 1e0", "1e-6"]);
    refused("--cycles 0", &["--cycles 0", "from 1 to 16"]);
    refused("--doublings 99", &["--doublings 99", "at most 6"]);
    refused("--transient -1", &["--transient -1", "from 0"]);
    refused("--time 100", &["--time 100", "no effect"]);
    refused("--over amplitude", &["--dither", "square or sine"]);
    refused("--over friction.coefficient", &["needs --from and --to"]);
    refused(
        "--over run.speed --from 1 --to 2",
        &["run.speed", "no number of that name"],
    );
    refused(
        "--over vehicle.slip_form --from 0 --to 1",
        &["no number of that name"],
    );
    refused(
        "--second speed --second-from 1 --second-to 2",
        &["both parameters", "the same"],
    );
    refused("--second friction.coefficient", &["--second-from"]);
    refused(
        "--second friction.coefficient --second-from 0 --second-to 11",
        &["friction.coefficient", "within 0 to 10"],
    );
}

/// Nothing moves at that speed: an answer, not an error.
#[test]
fn a_vehicle_at_rest_has_equilibria_and_no_orbit() {
    let folder = folder();
    let arguments = ["continue", "--rpm", "400", "--from", "300", "--to", "500"];
    let output = assert_ends(&mut command(folder.path(), arguments), 0);
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(text.contains("0 branches of periodic orbits"), "{text}");
    assert!(
        text.contains("no branch from the scenario's trajectory"),
        "{text}"
    );
}
