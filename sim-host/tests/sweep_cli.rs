//! The subcommands that sweep, as a user meets them: bad input, the same bytes for any number of
//! threads, no NaN.

mod common;

use common::{assert_ends, command, folder};
use std::fs;
use std::path::Path;

/// Expects exit code 2, a message with all of `parts`, and no file.
fn assert_refused(line: &str, parts: &[&str]) {
    let folder = folder();
    let arguments = line.split_whitespace().chain(["--out", "o.csv"]);
    common::assert_refused(folder.path(), arguments, parts);
    assert!(!folder.path().join("o.csv").exists(), "{line}");
}

#[test]
fn ranges_are_checked() {
    for command in ["orbit", "regions"] {
        let line = |rest: &str| format!("{command} {rest}");
        assert_refused(
            &line("--from 1900 --to 1e300"),
            &["from 1900 to 1e300 in steps of 5", "ten million"],
        );
        assert_refused(
            &line("--from 1600 --to 1900 --step 0"),
            &["in steps of 0", "greater than 0"],
        );
        assert_refused(&line("--step -1"), &["in steps of -1", "greater than 0"]);
        assert_refused(&line("--from nan"), &["from NaN", "finite"]);
        assert_refused(
            &line("--from 0 --to 10 --step 5"),
            &["run.wheel_speed_rpm = 0", "from 1"],
        );
        assert_refused(&line("--step 1e-9"), &["more than ten million"]);
        assert_refused(
            &line("--over amplitude"),
            &["waveform is none", "square or sine"],
        );
        assert_refused(
            &line("--over amplitude --dither sine --from 5 --to 20 --step 1"),
            &["bus_voltage"],
        );
        assert_refused(
            &line("--time 100"),
            &["100 s", "transient of 200 s", "shorter"],
        );
        assert_refused(
            &line("--transient -5"),
            &["transient of -5 s", "at least 0"],
        );
        assert_refused(
            &line("--from 1000 --to 2000 --step 0.04"),
            &["runs of", "about", "--yes"],
        );
    }
    assert_refused("regions --width 0", &["--width 0", "at least"]);
    assert_refused("regions --width nan", &["--width NaN", "finite"]);
    assert_refused(
        "basin --beta-from 0.3 --beta-to -1e300",
        &["sideslip angle", "to -1e300 in", "ten million"],
    );
    assert_refused(
        "basin --delta-step 0",
        &["steering angle", "greater than 0"],
    );
    assert_refused("basin --beta-step 0.001 --delta-step 0.001", &["--yes"]);
    assert_refused("basin --over speed --from 1600", &["--to", "--step"]);
    assert_refused("basin --from 1600 --to 1700 --step 50", &["--over"]);
    assert_refused(
        "basin --over speed --from 1600 --to 1700 --step 0",
        &["in steps of 0"],
    );
    assert_refused(
        "basin --over speed --from 0 --to 1700 --step 50",
        &["run.wheel_speed_rpm = 0"],
    );
    assert_refused(
        "equilibria --from 2000 --to 1000 --step 0",
        &["in steps of 0"],
    );
    assert_refused("equilibria --from 1000", &["--to"]);
    for (option, parts) in [
        ("--memory 1", &["--memory 1", "less than 1"][..]),
        ("--memory nan", &["--memory NaN"]),
        ("--limit -1", &["--limit -1", "from 0 to 1000 N m"]),
        ("--delay-error 1", &["--delay-error 1", "-0.5 to 0.5 s"]),
        ("--adaptation -1", &["--adaptation -1", "from 0 to"]),
        ("--noise nan", &["--noise NaN"]),
        ("--free 0", &["--free 0", "from 10 to"]),
        ("--time inf", &["--time inf", "from 60 to"]),
        ("--latency 101", &["--latency", "101"]),
        ("--gain-step 0", &["in steps of 0"]),
        ("--gain-step 1e-4", &["must be at most 1000"]),
        ("--signal mass", &["mass", "yaw_rate"]),
        ("--mix mass=1", &["mass", "yaw_rate"]),
        ("--mix steering_rate", &["steering_rate", "=-0.5"]),
        ("--mix yaw_rate=nan", &["NaN", "from -1000000 to 1000000"]),
        ("--mix yaw_rate=1e9", &["1000000000", "-1000000 to"]),
        ("--region --delay-error 0", &["greater than 0"]),
        ("--from 0", &["run.wheel_speed_rpm = 0"]),
        ("--from 300 --to 310 --step 10", &["no orbit of one cycle"]),
        ("--plant missing.toml", &["missing.toml"]),
        ("--step 0.001", &["--step 0.001", "must be at most 1000"]),
    ] {
        assert_refused(&format!("feedback {option}"), parts);
    }
    assert_refused("equilibria --rpm 1750 --time 10", &["--time 10"]);
    assert_refused("equilibria --rpm 0", &["run.wheel_speed_rpm = 0"]);
}

#[test]
fn a_section_that_is_never_crossed_is_said_with_the_motions_bounds() {
    assert_refused(
        "orbit --from 1600 --to 1610 --step 10 --transient 20 --time 40 --section steering-angle --level 3",
        &["steering_angle_rad = 3", "never crossed", "stay from"],
    );
    assert_refused(
        "orbit --from 1600 --to 1600 --section steering-angle --level inf",
        &["--level inf", "finite"],
    );
}

/// Every command, with one thread and with three.
#[test]
fn the_number_of_threads_does_not_change_the_bytes() {
    let folder = folder();
    for (k, analysis) in [
        "orbit --from 1600 --to 1700 --step 10 --transient 20 --time 60",
        "orbit --from 1600 --to 1640 --step 10 --transient 20 --time 60 --start down",
        "regions --from 1600 --to 1660 --step 20 --width 5 --transient 20 --time 100",
        "equilibria --from 1600 --to 1700",
        "basin --beta-step 0.2 --delta-step 0.4 --transient 20 --time 60",
        "feedback --from 1700 --to 1740 --step 40 --free 20 --time 60 --noise 0.01",
        "feedback --from 1700 --to 1700 --region --gain-from 4 --gain-to 6 --gain-step 2 --free 20 --time 60",
        "basin --over speed --from 1600 --to 1700 --step 100 --beta-step 0.2 --delta-step 0.4 --transient 20 --time 60",
    ]
    .into_iter()
    .enumerate()
    {
        let files = ["1", "3"].map(|threads| {
            let name = format!("{k}-{threads}");
            let line =
                format!("{analysis} --out {name}.csv --json {name}.json --figure {name}.svg");
            let mut command = command(folder.path(), line.split_whitespace());
            assert_ends(command.env("RAYON_NUM_THREADS", threads), 0);
            ["csv", "json", "svg"].map(|kind| {
                fs::read_to_string(folder.path().join(format!("{name}.{kind}"))).expect("written")
            })
        });
        assert_eq!(files[0], files[1], "{analysis}");
        let [csv, json, _] = &files[0];
        assert!(csv.lines().count() > 2, "{csv}");
        assert!(!csv.contains("NaN") && !csv.contains("inf"), "{analysis}");
        serde_json::from_str::<serde_json::Value>(json).expect("JSON");
    }
}

#[test]
fn diverging_motions_are_named_and_have_no_numbers() {
    let folder = folder();
    let road = "[tires.front]\nstiffness_per_rad = 6.7651\nshape = 1.3\npeak_n = 6436.8\n\
                [tires.rear]\nstiffness_per_rad = 9.0051\nshape = 1.3\npeak_n = 5430.0\n";
    fs::write(folder.path().join("road.toml"), road).expect("the file can be written");
    for analysis in ["orbit", "regions"] {
        let line = format!(
            "{analysis} --config road.toml --from 1750 --to 1750 --transient 5 --time 10 --out {analysis}.csv --figure f.svg --force"
        );
        assert_ends(&mut command(folder.path(), line.split_whitespace()), 0);
        let csv =
            fs::read_to_string(folder.path().join(format!("{analysis}.csv"))).expect("written");
        assert!(csv.contains("diverges"), "{csv}");
        assert!(!csv.contains("NaN") && !csv.contains("inf"), "{csv}");
    }
}

/// Upwards, downwards, and of one value: all as a reader types them, ascending.
#[test]
fn ranges_have_the_decimals_that_were_typed() {
    let folder = folder();
    let run = "--transient 5 --time 10 --out o.csv --force";
    for (line, column, typed) in [
        (
            "orbit --over amplitude --dither square --from 0 --to 0.35 --step 0.1",
            "dither_amplitude_v",
            &["0.0", "0.1", "0.2", "0.3"][..],
        ),
        (
            "orbit --over amplitude --dither square --from 0.3 --to 0 --step 0.1",
            "dither_amplitude_v",
            &["0.0", "0.1", "0.2", "0.3"],
        ),
        (
            "orbit --from 1700.3 --to 1700 --step -0.1",
            "wheel_speed_rpm",
            &["1700.0", "1700.1", "1700.2", "1700.3"],
        ),
        (
            "orbit --from 1700 --to 1700",
            "wheel_speed_rpm",
            &["1700.0"],
        ),
        (
            "map --dither square --from 1700.1 --to 1700.1 --speeds 1 --square-to 0.3 --square-step 0.1 --work w1",
            "dither_amplitude_v",
            &["0.0", "0.1", "0.2", "0.3"],
        ),
        (
            "map --dither square --from 1700 --to 1700 --step 1 --square-from 0.3 --square-to 0.3 --amplitudes 1 --work w2",
            "dither_amplitude_v",
            &["0.3"],
        ),
        (
            "map --dither square --from 1700.3 --to 1700.1 --speeds 3 --square-to 0 --square-step 1 --work w3",
            "wheel_speed_rpm",
            &["1700.1", "1700.2", "1700.3"],
        ),
    ] {
        let arguments = format!("{line} {run}");
        assert_ends(&mut command(folder.path(), arguments.split(' ')), 0);
        let mut csv = csv::Reader::from_path(folder.path().join("o.csv")).expect("CSV");
        let headers = csv.headers().expect("a header").clone();
        let index = headers.iter().position(|name| name == column);
        let rows = csv.records().map(|row| row.expect("a row"));
        let mut found: Vec<String> = rows.map(|row| row[index.expect(column)].into()).collect();
        found.dedup();
        assert_eq!(found, typed, "{line}");
    }
}

/// A period longer than the delay line is refused, and a vehicle that leaves all bounds is reported.
#[test]
fn feedback_needs_a_line_as_long_as_the_period_and_reports_a_divergence() {
    let folder = folder();
    let write = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).expect("the file can be written");
    };
    write(
        "fast.toml",
        "[run]\ncontrol_rate_hz = 5000.0\npwm_rate_hz = 20000.0\n",
    );
    let parts = ["control_rate_hz = 5000", "at most 2000 Hz"];
    for option in ["--config", "--plant"] {
        let arguments = ["feedback", option, "fast.toml"];
        common::assert_refused(folder.path(), arguments, &parts);
    }
    write(
        "b.toml",
        "[tires.front]\nstiffness_per_rad = 6.7651\nshape = 1.3\npeak_n = 6436.8\n\
         [tires.rear]\nstiffness_per_rad = 9.0051\nshape = 1.3\npeak_n = 5430.0\n",
    );
    let line = "feedback --from 1750 --to 1750 --plant b.toml --out o.csv";
    let output = assert_ends(&mut command(folder.path(), line.split_whitespace()), 0);
    assert!(String::from_utf8_lossy(&output.stdout).contains("diverges"));
    let csv = fs::read_to_string(folder.path().join("o.csv")).expect("written");
    assert!(!csv.contains("NaN") && !csv.contains("inf"), "{csv}");
}

#[test]
fn a_table_with_a_gap_is_refused() {
    let folder = folder();
    for (options, parts) in [
        ("--region", &["--table", "--region"][..]),
        ("--out o.csv", &["--table", "--out"]),
        ("--to 1640", &["at least two wheel speeds"]),
        (
            "--from 1700 --to 1720 --step 20 --gain-from 0 --gain-to 1",
            &["no gain that was tried holds the orbit at 1700 rpm"],
        ),
        ("--from 1960 --to 2400 --step 220", &["at 2180 rpm", "gap"]),
    ] {
        let line = format!("feedback --table t.rs {options}");
        common::assert_refused(folder.path(), line.split_whitespace(), parts);
        assert!(!folder.path().join("t.rs").exists());
    }
}

#[test]
fn the_ecus_table_of_the_feedback_is_made_again_byte_for_byte() {
    let folder = folder();
    let committed =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared-model/src/delayed_feedback/table.rs");
    let committed = fs::read_to_string(committed).expect("it is there");
    let line = "feedback --from 1560 --step 20 --gain-step 0.25 --latency 2 --table table.rs";
    assert_ends(&mut command(folder.path(), line.split_whitespace()), 0);
    let made = fs::read_to_string(folder.path().join("table.rs")).expect("written");
    assert_eq!(made, committed);
}
