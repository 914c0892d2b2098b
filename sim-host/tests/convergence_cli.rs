//! `sim-host convergence`, `sim-host averaging` and `sim-host reproduce` on the command line.

mod common;

use common::{assert_ends, assert_refused, command, folder};
use std::path::Path;

#[test]
fn bad_input_is_refused() {
    let folder = folder();
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
                "1e300",
            ],
            &["--from 2000 --to 1e300:", "from 50 to 100000 rad/s"],
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
            &["--points 1", "one point needs equal ends"],
        ),
        (
            &["reproduce", "--config", "missing.toml"],
            &["missing.toml"],
        ),
        (
            &["reproduce", "--quick", "--out", "file"],
            &["cannot write file", "is not a folder"],
        ),
    ];
    for (arguments, parts) in cases {
        assert_refused(folder.path(), arguments, parts);
    }
    let kept = std::fs::read_to_string(folder.path().join("file")).expect("it is there");
    assert_eq!(kept, "precious");
}

#[test]
fn results_are_written() {
    let folder = folder();
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
        assert_ends(&mut command(folder.path(), arguments), 0);
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("it is there");
    assert!(read("a.csv").starts_with("frequency_rad_per_s,period,averaged_period,"));
    assert!(read("c.csv").starts_with("step_s,error,order"));
    assert_eq!(read("c.csv").lines().count(), 8);
    assert!(read("a.svg").starts_with("<svg") && read("c.svg").starts_with("<svg"));
    assert!(!read("a.csv").contains("NaN") && !read("c.csv").contains("NaN"));
}

/// Each example is a valid configuration, and its differences from the paper are reported.
#[test]
fn the_examples_run() {
    let folder = folder();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    for (name, differs) in [
        ("paper", "the paper's"),
        ("heavier-vehicle", "vehicle.mass_kg"),
        ("high-friction-road", "tires.model"),
    ] {
        let file = examples.join(format!("{name}.toml"));
        let file = file.to_str().expect("the path is text");
        for analysis in [
            ["simulate", "--time", "5", "--out"].as_slice(),
            &["lyapunov", "--rpm", "1750", "--time", "400", "--out"],
            &[
                "orbit", "--from", "1700", "--to", "1720", "--step", "10", "--time", "250", "--out",
            ],
            &["tires", "--out"],
        ] {
            let out = format!("{name}-{}.csv", analysis[0]);
            let arguments = [analysis, &[out.as_str(), "--config", file]].concat();
            let output = assert_ends(&mut command(folder.path(), arguments), 0);
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(
                message.contains(differs),
                "{name} {}: {message}",
                analysis[0]
            );
            let csv = std::fs::read_to_string(folder.path().join(out)).expect("it is there");
            assert!(
                csv.lines().count() > 1 && !csv.contains("NaN"),
                "{name} {}",
                analysis[0]
            );
        }
    }
}
