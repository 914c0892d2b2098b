//! `sim-host lyapunov` as a user meets it.

mod common;

use common::{assert_ends, assert_refused, folder};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

fn lyapunov(folder: &Path, arguments: &[&str]) -> Command {
    common::command(folder, [&["lyapunov"], arguments].concat())
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("it is text")
}

/// The column of this name in a CSV file.
fn column(path: &Path, name: &str) -> Vec<String> {
    let mut csv = csv::Reader::from_path(path).expect("the file is there");
    let headers = csv.headers().expect("it has a header").clone();
    let index = headers.iter().position(|header| header == name);
    let index = index.unwrap_or_else(|| panic!("{name} is none of {headers:?}"));
    csv.records()
        .map(|record| record.expect("the row is whole")[index].to_owned())
        .collect()
}

#[test]
fn bad_input_is_refused_with_values_and_bounds() {
    let folder = folder();
    let cases: [(&[&str], &[&str]); 12] = [
        (
            &["--from", "1900", "--to", "1e300", "--step", "5"],
            &["from 1900 to 1e300 in steps of 5", "ten million"],
        ),
        (
            &["--from", "1600", "--to", "1900", "--step", "0"],
            &["steps of 0", "greater than 0"],
        ),
        (
            &["--from", "1600", "--to", "1900", "--step", "-5"],
            &["steps of -5", "greater than 0"],
        ),
        (
            &["--from", "nan", "--to", "1900", "--step", "5"],
            &["NaN", "finite"],
        ),
        (
            &["--from", "0", "--to", "10", "--step", "5"],
            &["run.wheel_speed_rpm = 0", "from 1 to 100000"],
        ),
        (
            &["--from", "1", "--to", "90000", "--step", "0.001"],
            &["ten million"],
        ),
        (&["--from", "1600", "--step", "5"], &["--to"]),
        (
            &["--rpm", "1600", "--from", "1", "--to", "2", "--step", "1"],
            &["--rpm", "cannot be used with"],
        ),
        (&["--time", "100"], &["100 s", "transient of 200 s"]),
        (
            &["--time", "250"],
            &["leaves 50 s", "must be at least 100 s"],
        ),
        (
            &["--coupling-from", "2", "--coupling-to", "1"],
            &["from 2 to 1 1/s", "must rise"],
        ),
        (&["--tolerance", "0"], &["tolerance of 0 1/s"]),
    ];
    for (arguments, parts) in cases {
        let all = [&["lyapunov", "--out", "x.csv"], arguments].concat();
        assert_refused(folder.path(), all, parts);
        assert!(!folder.path().join("x.csv").exists(), "{arguments:?}");
    }
}

const RANGE: [&str; 8] = [
    "--from", "1600", "--to", "1640", "--step", "20", "--time", "300",
];

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let folder = folder();
    let files = ["1", "2", "5"].map(|threads| {
        let names = ["csv", "json", "svg"].map(|end| format!("{threads}.{end}"));
        let [csv, json, svg] = [0, 1, 2].map(|k| names[k].as_str());
        let outputs = ["--out", csv, "--json", json, "--figure", svg];
        let all = [&RANGE[..], &["--method", "all", "--spectrum"], &outputs].concat();
        let mut command = lyapunov(folder.path(), &all);
        assert_ends(command.env("RAYON_NUM_THREADS", threads), 0);
        names.map(|name| fs::read_to_string(folder.path().join(name)).expect("it is written"))
    });
    assert!(files[0] == files[1] && files[0] == files[2]);
    let speeds = column(&folder.path().join("1.csv"), "wheel_speed_rpm");
    // Four of the spectrum, two-particle method, synchronisation.
    let expected = ["1600.0", "1620.0", "1640.0"].map(|rpm| [rpm; 6]).concat();
    assert_eq!(speeds, expected);
    assert!(!files[0].iter().any(|file| file.contains("NaN")));
    let json: serde_json::Value = serde_json::from_str(&files[0][1]).expect("it is JSON");
    assert_eq!(json["complete"], true);
    assert_eq!(json["exponents"].as_array().map(Vec::len), Some(18));
}

#[test]
fn existing_files_are_kept_unless_forced() {
    let folder = folder();
    fs::write(folder.path().join("x.csv"), "mine").expect("the file can be written");
    let arguments = ["--rpm", "1600", "--time", "300", "--out", "x.csv"];
    let mut unforced = lyapunov(folder.path(), &arguments);
    let output = assert_ends(&mut unforced, 2);
    assert!(text(&output.stderr).contains("--force"));
    let path = folder.path().join("x.csv");
    assert_eq!(fs::read_to_string(&path).expect("it is there"), "mine");
    assert_ends(unforced.arg("--force"), 0);
    assert_eq!(column(&path, "finding"), ["zero"]);
}

/// The high-friction road with the cubic tyre diverges: results say so and hold no number.
#[test]
fn diverging_motions_are_named() {
    let folder = folder();
    fs::write(
        folder.path().join("road.toml"),
        "[tires.front]\nstiffness_per_rad = 6.7651\nshape = 1.3\npeak_n = 6436.8\n\
         [tires.rear]\nstiffness_per_rad = 9.0051\nshape = 1.3\npeak_n = 5430.0\n",
    )
    .expect("the file can be written");
    let arguments = ["--config", "road.toml", "--method", "all", "--spectrum"];
    let outputs = ["--out", "x.csv", "--figure", "x.svg"];
    let mut command = lyapunov(folder.path(), &[&arguments[..], &outputs].concat());
    let output = assert_ends(&mut command, 0);
    let path = folder.path().join("x.csv");
    assert_eq!(column(&path, "finding"), ["diverges"; 3]);
    assert_eq!(column(&path, "exponent_per_s"), [""; 3]);
    assert!(column(&path, "reason")[0].contains("the motion diverges"));
    assert!(!text(&output.stdout).contains("NaN"));
}

#[test]
fn a_search_without_result_is_untested_and_names_its_interval() {
    let folder = folder();
    let arguments = [
        "--rpm",
        "1750",
        "--time",
        "300",
        "--method",
        "synchronisation",
    ];
    let search = [
        "--coupling-from",
        "-1",
        "--coupling-to",
        "0.01",
        "--out",
        "x.csv",
    ];
    let mut command = lyapunov(folder.path(), &[&arguments[..], &search].concat());
    assert_ends(&mut command, 0);
    let path = folder.path().join("x.csv");
    assert_eq!(column(&path, "finding"), ["untested"]);
    let reason = "untested: no coupling from -1 to 0.01 1/s synchronises";
    assert_eq!(column(&path, "reason"), [reason]);
}

#[test]
fn stopping_keeps_what_is_done() {
    let folder = folder();
    let range = [
        "--from", "1501", "--to", "2000", "--step", "0.03", "--time", "600",
    ];
    let outputs = ["--out", "x.csv", "--json", "x.json"];
    // One thread: hundreds of batches, of some hundredths of a second each; those done are kept.
    let child = lyapunov(folder.path(), &[&range[..], &outputs].concat())
        .env("RAYON_NUM_THREADS", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    std::thread::sleep(Duration::from_secs(2));
    let id = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(id, rustix::process::Signal::INT).expect("it still runs");
    let output = child.wait_with_output().expect("it ends");
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(
        message.contains("16634 speeds"),
        "the estimated cost comes first: {message}"
    );
    assert!(message.contains("interrupted after"), "{message}");
    assert!(message.contains("of 16634 points"), "{message}");
    let rows = column(&folder.path().join("x.csv"), "exponent_per_s").len();
    assert!((1..16634).contains(&rows), "{rows} rows");
    let json = fs::read_to_string(folder.path().join("x.json")).expect("it is written");
    let json: serde_json::Value = serde_json::from_str(&json).expect("it is JSON");
    assert_eq!(json["complete"], false);
    assert_eq!(json["exponents"].as_array().map(Vec::len), Some(rows));
}
