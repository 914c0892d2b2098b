//! `sim-host convergence`, `sim-host averaging` and `sim-host reproduce` on the command line.

use std::path::Path;
use std::process::{Command, Output};

fn sim_host(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sim-host"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

#[test]
fn bad_input_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    std::fs::write(folder.path().join("file"), "precious").expect("the file can be written");
    let cases: [(&[&str], &[&str]); 9] = [
        (&["convergence", "--time", "0"], &["duration_s = 0"]),
        (
            &["convergence", "--time", "100"],
            &["--time 100", "0.01 to 60 s"],
        ),
        (
            &["convergence", "--out", "file"],
            &["file exists", "--force"],
        ),
        (&["averaging"], &["no dither to average", "--amplitude-v"]),
        (
            &[
                "averaging",
                "--dither",
                "square",
                "--amplitude-v",
                "0.1",
                "--from",
                "2000",
                "--to",
                "200",
            ],
            &["--from 2000 --to 200", "must be rising"],
        ),
        (
            &[
                "averaging",
                "--dither",
                "square",
                "--amplitude-v",
                "0.1",
                "--from",
                "nan",
            ],
            &["--from NaN"],
        ),
        (
            &[
                "averaging",
                "--dither",
                "square",
                "--amplitude-v",
                "0.1",
                "--points",
                "1",
            ],
            &["--points 1", "from 2 to 200"],
        ),
        (
            &["reproduce", "--config", "missing.toml"],
            &["missing.toml"],
        ),
        (
            &["reproduce", "--quick", "--out", "file"],
            &["cannot make file"],
        ),
    ];
    for (arguments, parts) in cases {
        let output = sim_host(folder.path(), arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        for part in parts {
            assert!(
                message.contains(part),
                "{arguments:?}: {message} lacks {part:?}"
            );
        }
    }
    let kept = std::fs::read_to_string(folder.path().join("file")).expect("it is there");
    assert_eq!(kept, "precious");
}

#[test]
fn results_are_written() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let averaging = [
        "averaging",
        "--dither",
        "sine",
        "--amplitude-v",
        "1",
        "--points",
        "2",
        "--out",
        "a.csv",
        "--json",
        "a.json",
        "--figure",
        "a.svg",
    ];
    let convergence = [
        "convergence",
        "--out",
        "c.csv",
        "--json",
        "c.json",
        "--figure",
        "c.svg",
    ];
    for arguments in [averaging.as_slice(), &convergence] {
        let output = sim_host(folder.path(), arguments);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("it is there");
    assert!(read("a.csv").starts_with("frequency_rad_per_s,period,averaged_period,"));
    assert!(read("c.csv").starts_with("step_s,error,order"));
    assert_eq!(read("c.csv").lines().count(), 8);
    assert!(read("a.svg").starts_with("<svg") && read("c.svg").starts_with("<svg"));
    assert!(!read("a.csv").contains("NaN") && !read("c.csv").contains("NaN"));
}

/// Each of the examples is a configuration that subcommands take, and what differs from the paper is said.
#[test]
fn the_examples_run() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    for (name, differs) in [
        ("paper", "the paper's"),
        ("heavier-vehicle", "vehicle.mass_kg"),
        ("high-friction-road", "tires.model"),
    ] {
        let file = examples.join(format!("{name}.toml"));
        let file = file.to_str().expect("the path is text");
        for command in [
            ["simulate", "--time", "5", "--out"].as_slice(),
            &["lyapunov", "--rpm", "1750", "--time", "400", "--out"],
            &[
                "orbit", "--from", "1700", "--to", "1720", "--step", "10", "--time", "250", "--out",
            ],
            &["tires", "--out"],
        ] {
            let out = format!("{name}-{}.csv", command[0]);
            let arguments = [command, &[out.as_str(), "--config", file]].concat();
            let output = sim_host(folder.path(), &arguments);
            let message = String::from_utf8_lossy(&output.stderr);
            assert_eq!(
                output.status.code(),
                Some(0),
                "{name} {}: {message}",
                command[0]
            );
            assert!(
                message.contains(differs),
                "{name} {}: {message}",
                command[0]
            );
            let csv = std::fs::read_to_string(folder.path().join(out)).expect("it is there");
            assert!(
                csv.lines().count() > 1 && !csv.contains("NaN"),
                "{name} {}",
                command[0]
            );
        }
    }
}
