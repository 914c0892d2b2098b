//! The subcommands that plot, as a user meets them: files with named columns and units, and bad
//! input refused with value and bounds, exit code 2, nothing written.

mod common;

use common::{assert_ends, command, folder};
use serde_json::Value;
use std::fs;

/// What a command wrote: columns and rows of its CSV, its JSON, its figure.
struct Written {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
    json: Value,
    figure: String,
}

impl Written {
    fn column(&self, name: &str) -> Vec<f64> {
        let index = self.columns.iter().position(|column| column == name);
        let index = index.unwrap_or_else(|| panic!("no column {name} in {:?}", self.columns));
        let number = |row: &Vec<String>| row[index].parse().expect("a number");
        self.rows.iter().map(number).collect()
    }
}

/// Runs a command with all its destinations and expects success.
fn written(arguments: &[&str]) -> Written {
    let folder = folder();
    let mut all = arguments.to_vec();
    all.extend(["--out", "a.csv", "--json", "a.json", "--figure", "a.svg"]);
    let output = assert_ends(&mut command(folder.path(), &all), 0);
    assert!(!output.stdout.is_empty(), "{arguments:?}");
    let read = |name| fs::read_to_string(folder.path().join(name)).expect("it was written");
    let csv = read("a.csv");
    let mut lines = csv.lines().map(|line| {
        let cells = line.split(',').map(str::to_owned);
        cells.collect::<Vec<_>>()
    });
    let figure = read("a.svg");
    assert!(figure.starts_with("<svg") && !figure.contains("no data"));
    assert!(!csv.contains("NaN") && !figure.contains("NaN"));
    // Nothing is overwritten without --force.
    assert_ends(&mut command(folder.path(), &all), 2);
    all.push("--force");
    assert_ends(&mut command(folder.path(), &all), 0);
    assert_eq!(read("a.csv"), csv, "the same input gives the same bytes");
    Written {
        columns: lines.next().expect("a header"),
        rows: lines.collect(),
        json: serde_json::from_str(&read("a.json")).expect("JSON"),
        figure,
    }
}

/// Runs a command with all its destinations, expects exit code 2, all of `parts` in the message,
/// and no file.
fn assert_refused(arguments: &[&str], parts: &[&str]) {
    let folder = folder();
    let mut all = arguments.to_vec();
    all.extend(["--out", "a.csv", "--json", "a.json", "--figure", "a.svg"]);
    common::assert_refused(folder.path(), all, parts);
    let files = fs::read_dir(folder.path()).expect("the folder is there");
    assert_eq!(files.count(), 0, "{arguments:?} wrote something");
}

#[test]
fn phase_writes_the_settled_states() {
    let dithered = [
        "phase",
        "--dither",
        "square",
        "--amplitude-v",
        "0.1",
        "--time",
        "5",
        "--x",
        "delta_f",
        "--y",
        "steering_rate",
    ];
    let phase = written(&dithered);
    assert_eq!(phase.rows.len(), 5000);
    assert_eq!(phase.columns[0], "time_s");
    assert_eq!(phase.json["x"], "steering_angle_rad");
    let angle = phase.column("steering_angle_rad");
    let low = angle.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(phase.json["x_range"][0], low);
    assert!(phase.figure.contains("steering angle"));
    assert!(phase.figure.contains("square dither 0.1 V"));
}

#[test]
fn poincare_crossings_lie_on_the_section() {
    let section = ["poincare", "--rpm", "1840", "--time", "60", "--at", "0"];
    let section = written(&section);
    assert!(section.rows.len() > 40);
    for yaw_rate in section.column("yaw_rate_rad_per_s") {
        assert!(yaw_rate.abs() < 1e-12);
    }
    let times = section.column("time_s");
    let mean = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let said = section.json["mean_return_time_s"].as_f64();
    assert!((said.expect("a time") - mean).abs() < 1e-12);
}

#[test]
fn the_spectrum_shows_the_dithers_line() {
    let arguments = [
        "spectrum",
        "--dither",
        "square",
        "--amplitude-v",
        "0.1",
        "--time",
        "60",
    ];
    let spectrum = written(&arguments);
    let line = &spectrum.json["dither"];
    assert_eq!(line["frequency_rad_per_s"], 2000.0);
    let over = line["over_surroundings"].as_f64().expect("a number");
    assert!(over > 1000.0, "{over}");
    let density = spectrum.column("density_per_hz");
    let bin_hz = spectrum.json["bin_hz"].as_f64().expect("a number");
    let power = spectrum.json["power"].as_f64().expect("a number");
    assert!((density.iter().sum::<f64>() * bin_hz / power - 1.0).abs() < 1e-9);
    assert!(spectrum.figure.contains("2000 rad/s"));
    let undithered = written(&["spectrum", "--time", "50", "--segment", "10"]);
    assert!(undithered.json["dither"].is_null());
}

#[test]
fn tires_and_nonlinearities_have_all_curves() {
    let tires = written(&["tires"]);
    assert_eq!(tires.columns[..2], ["road", "axle"]);
    assert_eq!(tires.rows.len() % 4, 0);
    let folder = folder();
    let toml = folder.path().join("c.toml");
    fs::write(&toml, "[tires.front]\npeak_n = 3000.0\n").expect("the file can be written");
    let path = toml.to_str().expect("a plain path");
    let other = written(&["tires", "--config", path, "--slip-max", "0.2"]);
    assert!(other.figure.contains("configured road"));
    let of = ["nonlinearity", "--dither", "sine", "--amplitude-v", "1"];
    let of = written(&of);
    assert_eq!(of.json["waveform"], "sine");
    let torque = of.column("friction_effective_nm");
    assert!((torque[torque.len() - 1] - 6.5856).abs() < 1e-9);
}

#[test]
fn realisability_has_the_papers_torques() {
    let actuator = written(&["realisability"]);
    let demands = &actuator.json["demands"];
    assert_eq!(demands[0]["inertia_torque_nm"], 4.0e6);
    assert_eq!(demands[1]["response"]["frequency_rad_per_s"], 4000.0);
    let frequencies = actuator.column("frequency_rad_per_s");
    assert_eq!(frequencies[0], 1.0);
    assert!(actuator.column("reached_rad").is_sorted_by(|a, b| a > b));
    for label in ["square, 2000 rad/s", "sine, 4000 rad/s"] {
        assert!(actuator.figure.contains(label));
    }
}

#[test]
fn options_of_settled_runs_are_checked() {
    for command in ["phase", "poincare", "spectrum"] {
        let refused = |options: &[&str], parts: &[&str]| {
            let mut arguments = vec![command];
            arguments.extend(options);
            assert_refused(&arguments, parts);
        };
        refused(
            &["--transient", "-1"],
            &["--transient -1", "from 0 to 100000 s"],
        );
        refused(&["--transient", "NaN"], &["--transient NaN", "from 0"]);
        refused(&["--time", "0"], &["run.duration_s = 0"]);
        refused(&["--rpm", "0"], &["run.wheel_speed_rpm = 0", "from 1"]);
        refused(
            &["--dither", "square", "--amplitude-v", "13"],
            &["at most 9 V"],
        );
    }
    for command in ["phase", "spectrum"] {
        assert_refused(
            &[command, "--time", "50000"],
            &["--time 50000", "at most 20000 s"],
        );
    }
    for arguments in [
        ["phase", "--x", "speed"],
        ["phase", "--y", "speed"],
        ["poincare", "--section", "speed"],
        ["spectrum", "--component", "speed"],
    ] {
        assert_refused(
            &arguments,
            &["unknown component", "speed", "yaw_rate (gamma)"],
        );
    }
}

#[test]
fn impossible_sections_and_spectra_are_said() {
    assert_refused(
        &["poincare", "--at", "5", "--time", "5"],
        &["yaw_rate = 5 rad/s, rising", "never crossed", "ranges from"],
    );
    assert_refused(&["poincare", "--at", "inf"], &["--at inf", "finite"]);
    // A run much shorter than a cycle.
    assert_refused(
        &["poincare", "--at", "0", "--time", "0.01"],
        &["never crossed", "in 0.01 s"],
    );
    assert_refused(
        &["poincare", "--x", "gamma"],
        &["--x yaw_rate", "must not be the section's"],
    );
    assert_refused(
        &["poincare", "--x", "beta", "--y", "beta"],
        &["both sideslip"],
    );
    assert_refused(&["phase", "--x", "gamma"], &["both yaw_rate", "different"]);
    // At rest below the Hopf speed.
    for command in ["poincare", "spectrum"] {
        assert_refused(&[command, "--rpm", "1000"], &["at rest", "ranges from"]);
    }
    assert_refused(
        &["spectrum", "--time", "5", "--segment", "6"],
        &["--segment 6", "from 0.016 s", "--time 5 s"],
    );
    assert_refused(&["spectrum", "--segment", "0"], &["--segment 0", "from"]);
    assert_refused(
        &["spectrum", "--time", "0.01"],
        &["--segment", "16 samples", "--time 0.01"],
    );
}

#[test]
fn diverging_motions_are_said() {
    let folder = folder();
    let road_b = "[tires.front]\nstiffness_per_rad = 6.7651\nshape = 1.3\npeak_n = 6436.8\n\
                  [tires.rear]\nstiffness_per_rad = 9.0051\nshape = 1.3\npeak_n = 5430.0\n";
    let toml = folder.path().join("b.toml");
    fs::write(&toml, road_b).expect("the file can be written");
    let path = toml.to_str().expect("a plain path");
    for command in ["phase", "poincare", "spectrum"] {
        assert_refused(&[command, "--config", path], &["diverges"]);
    }
}

#[test]
fn empty_ranges_and_missing_dithers_are_refused() {
    for angle in ["0", "-0.1", "2", "NaN"] {
        assert_refused(
            &["tires", "--slip-max", angle],
            &[&format!("--slip-max {angle}"), "from 0.0001 to 1.5708"],
        );
        assert_refused(
            &[
                "nonlinearity",
                "--dither",
                "sine",
                "--amplitude-v",
                "1",
                "--max",
                angle,
            ],
            &[&format!("--max {angle}"), "from 0.0001"],
        );
    }
    assert_refused(&["nonlinearity"], &["no dither", "--dither square"]);
    assert_refused(
        &["nonlinearity", "--dither", "square"],
        &["no dither", "--amplitude-v"],
    );
    assert_refused(
        &["nonlinearity", "--dither", "triangle"],
        &["triangle", "none, square, sine"],
    );
    for option in ["--square-v", "--sine-v"] {
        assert_refused(
            &["realisability", option, "0"],
            &[&format!("{option} 0"), "at most 1000 V"],
        );
    }
}
