//! Outputs of the command line: all checked before the work, written or refused, and never silently
//! lost.

mod common;

use common::{assert_ends, assert_refused, command, folder};
use std::fs::{self, File};
use std::path::Path;
use std::process::Stdio;

/// Each subcommand that writes files, with the options that name them. What they read need not be
/// there: outputs come first.
const WRITERS: [(&str, &[&str]); 24] = [
    ("simulate", &["--out", "--mdf4"]),
    ("lyapunov", &["--out", "--json", "--figure"]),
    (
        "averaging --dither square --amplitude-v 0.1",
        &["--out", "--json", "--figure"],
    ),
    ("convergence", &["--out", "--json", "--figure"]),
    ("orbit", &["--out", "--json", "--figure"]),
    ("regions", &["--out", "--json", "--figure"]),
    ("equilibria", &["--out", "--json", "--figure"]),
    ("basin", &["--out", "--json", "--figure"]),
    ("continue", &["--out", "--json", "--figure"]),
    ("feedback", &["--out", "--json", "--figure"]),
    ("feedback", &["--table"]),
    ("phase", &["--out", "--json", "--figure"]),
    ("poincare", &["--out", "--json", "--figure"]),
    ("spectrum", &["--out", "--json", "--figure"]),
    ("tires", &["--out", "--json", "--figure"]),
    (
        "nonlinearity --dither sine --amplitude-v 1",
        &["--out", "--json", "--figure"],
    ),
    ("map", &["--out", "--parquet", "--figure"]),
    ("map merge one", &["--out", "--parquet", "--figure"]),
    ("schedule", &["--out", "--csv", "--json", "--figure"]),
    ("realisability", &["--out", "--json", "--figure"]),
    ("faults", &["--out", "--json", "--figure"]),
    ("decode run.bin", &["--out", "--mdf4"]),
    (
        "pil",
        &[
            "--record",
            "--can-log",
            "--mdf4",
            "--out",
            "--json",
            "--figure",
        ],
    ),
    ("fmu ecu", &["--out"]),
];

fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split_whitespace()
}

#[test]
fn every_destination_is_checked_before_the_work() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("there"), "mine").unwrap();
    std::os::unix::fs::symlink("nowhere", at.join("link")).unwrap();
    for (line, options) in WRITERS {
        for option in options {
            for (path, part) in [
                ("none/x", "the folder none does not exist"),
                ("there", "there exists; give --force"),
                ("link", "link exists; give --force"),
                ("there/x", "there is not a folder"),
                (".", "a folder"),
            ] {
                assert_refused(at, words(&format!("{line} {option} {path}")), &[part]);
            }
        }
        for pair in options.windows(2) {
            for (one, other) in [("x", "./x"), ("-", "/dev/stdout")] {
                let line = format!("{line} {} {one} {} {other}", pair[0], pair[1]);
                assert_refused(at, words(&line), &["are the same file"]);
            }
        }
    }
    assert_eq!(fs::read_dir(at).unwrap().count(), 2, "nothing was written");
    assert_eq!(fs::read_to_string(at.join("there")).unwrap(), "mine");
}

#[test]
fn folders_are_checked_before_the_work() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("there"), "mine").unwrap();
    for line in [
        "reproduce --out there",
        "reproduce --out there/x",
        "map --figure x --work there",
    ] {
        assert_refused(at, words(line), &["there"]);
    }
    assert_refused(at, words("reproduce --out ."), &["other files", "--force"]);
    assert_refused(at, words("reproduce --out -"), &["standard output"]);
    assert_refused(at, words("map --out x --work x"), &["are the same file"]);
    assert_refused(at, words("map --out -"), &["--work"]);
    assert_eq!(fs::read_dir(at).unwrap().count(), 1);
}

/// In milliseconds, and not after minutes on the host.
#[test]
fn inputs_are_found_missing_before_the_work() {
    let folder = folder();
    let start = std::time::Instant::now();
    assert_refused(
        folder.path(),
        words("faults --firmware none.elf"),
        &["none.elf", "No such file"],
    );
    assert!(start.elapsed().as_secs() < 10);
}

#[test]
fn what_is_read_is_not_overwritten() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("c.toml"), "[run]\nwheel_speed_rpm = 1700.0\n").unwrap();
    for line in ["tires", "lyapunov", "phase", "map", "schedule"] {
        let line = format!("{line} --config c.toml --figure ./c.toml --force");
        assert_refused(at, words(&line), &["--config c.toml", "are the same file"]);
    }
    let kept = fs::read_to_string(at.join("c.toml")).unwrap();
    assert!(kept.starts_with("[run]"));
}

#[test]
fn standard_output_has_the_data_alone() {
    let folder = folder();
    let at = folder.path();
    assert_ends(
        &mut command(at, words("convergence --time 1 --out file.csv")),
        0,
    );
    let file = fs::read_to_string(at.join("file.csv")).unwrap();
    for name in ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"] {
        let line = format!("convergence --time 1 --out {name}");
        let output = assert_ends(&mut command(at, words(&line)), 0);
        assert_eq!(String::from_utf8_lossy(&output.stdout), file, "{name}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("step (s)"));
    }
    assert_eq!(fs::read_dir(at).unwrap().count(), 1);
    // A file behind standard output is written into, as the shell has opened it.
    let into = |name: &str| {
        File::options()
            .append(true)
            .create(true)
            .open(at.join(name))
            .unwrap()
    };
    fs::write(at.join("log"), "before\n").unwrap();
    let mut appended = command(at, words("convergence --time 1 --out /dev/stdout"));
    assert_ends(appended.stdout(into("log")).stderr(Stdio::piped()), 0);
    assert_eq!(
        fs::read_to_string(at.join("log")).unwrap(),
        format!("before\n{file}")
    );
    let mut both = command(at, words("convergence --time 1 --out log --force"));
    let output = assert_ends(both.stdout(into("log")).stderr(Stdio::piped()), 2);
    assert!(String::from_utf8_lossy(&output.stderr).contains("standard output"));
}

#[test]
fn a_full_disk_is_an_error_on_standard_output_too() {
    let folder = folder();
    for line in [
        "config",
        "--help",
        "tires --help",
        "--version",
        "tires",
        "convergence --time 1 --out -",
    ] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut command = command(folder.path(), words(line));
        let output = assert_ends(command.stdout(full).stderr(Stdio::piped()), 2);
        let message = String::from_utf8_lossy(&output.stderr);
        for part in ["standard output", "No space left on device"] {
            assert!(message.contains(part), "{line}: {message}");
        }
    }
}

/// A reader that has seen enough of the summary is no failure; one that takes not all of the data
/// is.
#[test]
fn a_closed_pipe() {
    let folder = folder();
    for (line, code) in [
        ("config", 0),
        ("--help", 0),
        ("convergence --time 1 --out -", 2),
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        assert_ends(
            command(folder.path(), words(line))
                .stdout(writer)
                .stderr(Stdio::piped()),
            code,
        );
    }
}

#[test]
fn a_file_without_parameters_gets_a_warning() {
    let folder = folder();
    let at = folder.path();
    let warned = |text: &str| {
        fs::write(at.join("c.toml"), text).unwrap();
        let output = assert_ends(&mut command(at, words("tires --config c.toml")), 0);
        String::from_utf8_lossy(&output.stderr).contains("warning: c.toml sets no parameter")
    };
    for text in ["", "\n", "# nothing\n", "[friction]\n"] {
        assert!(warned(text), "{text:?}");
    }
    assert!(!warned("[run]\nwheel_speed_rpm = 1700.0\n"));
    assert!(!warned("preset = \"printed\"\n"));
}

/// An interrupted or overwritten file keeps its mode, a link stays a link.
#[test]
fn force_overwrites_the_file_and_nothing_else() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("there"), "old").unwrap();
    fs::set_permissions(at.join("there"), fs::Permissions::from_mode(0o600)).unwrap();
    symlink("there", at.join("link")).unwrap();
    assert_ends(&mut command(at, words("tires --out link --force")), 0);
    assert_eq!(fs::read_link(at.join("link")).unwrap(), Path::new("there"));
    let mode = fs::metadata(at.join("there")).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    assert!(
        fs::read_to_string(at.join("there"))
            .unwrap()
            .starts_with("road,")
    );
    fs::hard_link(at.join("there"), at.join("other")).unwrap();
    assert_refused(
        at,
        words("tires --out there --force"),
        &["2 names (hard links)"],
    );
    assert_eq!(fs::read_dir(at).unwrap().count(), 3);
}
