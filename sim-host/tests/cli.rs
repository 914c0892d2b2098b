//! The command line as a user meets it: bad input gets a clear message with the value and its
//! bounds, exit code 2, and nothing is lost or overwritten.

mod common;

use common::{assert_ends, assert_refused, command, folder};
use shared_model::friction::FrictionMode;
use shared_model::telemetry::{Header, Record, Trailer};
use shared_model::vehicle::State;
use std::fs;
use std::path::{Path, PathBuf};

/// As [`assert_refused`], for a configuration file with the given text.
fn assert_config_refused(toml: &str, parts: &[&str]) {
    let folder = folder();
    fs::write(folder.path().join("c.toml"), toml).expect("the file can be written");
    let arguments = ["simulate", "--config", "c.toml", "--out", "t.csv"];
    assert_refused(folder.path(), arguments, parts);
    assert!(!folder.path().join("t.csv").exists(), "nothing is written");
}

#[test]
fn configuration_files_are_checked() {
    assert_config_refused(
        "[vehicle]\nmas_kg = 1",
        &[
            "unknown key vehicle.mas_kg",
            "did you mean vehicle.mass_kg?",
        ],
    );
    assert_config_refused("[engine]\npower = 1", &["unknown key engine"]);
    assert_config_refused(
        "[vehicle]\nmass_kg = nan",
        &["vehicle.mass_kg = NaN", "from 1 to 100000"],
    );
    assert_config_refused(
        "[vehicle]\nmass_kg = -1500",
        &["vehicle.mass_kg = -1500", "from 1 to 100000"],
    );
    assert_config_refused(
        "[vehicle]\nmass_kg = \"heavy\"",
        &["vehicle.mass_kg", "heavy", "must be a number"],
    );
    assert_config_refused(
        "[run]\nwheel_speed_rpm = 0",
        &["run.wheel_speed_rpm = 0", "from 1"],
    );
    assert_config_refused(
        "[run]\ncontrol_rate_hz = 0",
        &["run.control_rate_hz = 0", "from 10"],
    );
    assert_config_refused(
        "[run]\ncontrol_rate_hz = -1000",
        &["run.control_rate_hz = -1000"],
    );
    assert_config_refused("[run]\npwm_rate_hz = inf", &["run.pwm_rate_hz = inf"]);
    assert_config_refused("[run]\ncontrol_rate_hz = 3000", &["multiple"]);
    assert_config_refused(
        "[friction]\nlaw = \"sticky\"",
        &["friction.law", "sticky", "coulomb_rate"],
    );
    assert_config_refused(
        "[friction]\ndithered = 1",
        &["friction.dithered = 1", "true or false"],
    );
    assert_config_refused(
        "preset = \"papre\"",
        &["unknown preset \"papre\"", "reconstruction, printed"],
    );
    assert_config_refused("preset = 3", &["preset = 3", "must be a name"]);
    assert_config_refused("[vehicle\n", &["not TOML", "line 1"]);
    assert_config_refused("vehicle = 3", &["vehicle = 3", "must be a table"]);
}

#[test]
fn options_are_checked() {
    let folder = folder();
    let cases: [(&[&str], &[&str]); 8] = [
        (&["--rpm", "0"], &["run.wheel_speed_rpm = 0"]),
        (&["--rpm", "NaN"], &["run.wheel_speed_rpm = NaN"]),
        (&["--time", "0"], &["run.duration_s = 0", "from 0.0001"]),
        (&["--time", "-3"], &["run.duration_s = -3"]),
        (
            &["--dither", "square", "--amplitude-v", "13"],
            &["amplitude_v = 13", "bus_voltage_v = 12", "at most 9 V"],
        ),
        (
            &["--dither", "sine", "--amplitude-v", "-1"],
            &["dither.amplitude_v = -1", "from 0"],
        ),
        (
            &["--dither", "triangle"],
            &["triangle", "none, square, sine"],
        ),
        (&["--preset", "papre"], &["unknown preset \"papre\""]),
    ];
    for (options, parts) in cases {
        let mut arguments = vec!["simulate", "--out", "t.csv"];
        arguments.extend(options);
        assert_refused(folder.path(), &arguments, parts);
        assert!(!folder.path().join("t.csv").exists(), "nothing is written");
    }
    assert_refused(
        folder.path(),
        ["simulate", "--config", "none.toml", "--out", "t.csv"],
        &["none.toml"],
    );
}

/// What a step cannot follow is refused when the scenario is accepted, or named when the run shows
/// it; never as a motion that diverges.
#[test]
fn a_step_that_is_too_long_is_no_divergence() {
    assert_config_refused(
        "[steering]\ninertia_kg_m2 = 0.05",
        &[
            "run.control_rate_hz = 1000: the step is too long",
            "at most 2.6",
            "at least 1544 Hz",
        ],
    );
    let folder = folder();
    let write = |name: &str, toml: &str| fs::write(folder.path().join(name), toml).expect("a file");
    write("far.toml", "[run]\nsideslip_rad = 8.0");
    let simulate = ["simulate", "--config", "far.toml", "--out", "t.csv"];
    assert_refused(
        folder.path(),
        simulate,
        &["the step is too long", "Raise run.control_rate_hz"],
    );
    let lyapunov = [
        "lyapunov", "--config", "far.toml", "--method", "all", "--time", "350",
    ];
    let output = assert_ends(&mut command(folder.path(), lyapunov), 0);
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(table.contains("untested: the step is too long"), "{table}");
    assert!(!table.contains("diverges"), "{table}");
    assert_refused(
        folder.path(),
        ["simulate", "--rpm", "1", "--out", "t.csv"],
        &["the step is too long"],
    );
}

/// Friction of no torque: the steering comes to rest smoothly, and all methods and analyses agree
/// on it.
#[test]
fn a_smooth_rest_without_friction_is_an_equilibrium() {
    let folder = folder();
    fs::write(
        folder.path().join("mu0.toml"),
        "[friction]\ncoefficient = 0.0",
    )
    .expect("a file");
    let run = |arguments: &str| {
        let arguments = arguments.split_whitespace().chain(["--config", "mu0.toml"]);
        let output = assert_ends(&mut command(folder.path(), arguments), 0);
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let table =
        run("lyapunov --rpm 1750 --dither square --amplitude-v 0.14 --method all --time 500");
    let rates = table.lines().filter(|line| line.contains("1750"));
    let rates: Vec<f64> = rates
        .map(|line| {
            line.split_whitespace()
                .nth(3)
                .expect(line)
                .parse()
                .expect(line)
        })
        .collect();
    assert_eq!(rates.len(), 3, "{table}");
    assert!(
        rates.iter().all(|rate| (rate + 0.22).abs() < 0.01),
        "{table}"
    );
    run(
        "map --dither square --from 1740 --to 1750 --speeds 2 --square-to 0.14 --amplitudes 2 --out map.csv",
    );
    let map = fs::read_to_string(folder.path().join("map.csv")).expect("the map");
    let rests: Vec<_> = map.lines().filter(|row| row.contains(",0.14,")).collect();
    assert_eq!(rests.len(), 2, "{map}");
    assert!(
        rests.iter().all(|row| row.contains(",equilibrium,0,,-0.2")),
        "{map}"
    );
    let regions = run(
        "regions --rpm 1750 --dither square --over amplitude --from 0.14 --to 0.15 --step 0.005",
    );
    assert!(
        regions.contains("equilibrium") && !regions.contains("diverges"),
        "{regions}"
    );
}

#[test]
fn a_diverging_motion_is_said_and_not_written() {
    let folder = folder();
    let road_b = "[tires.front]\nstiffness_per_rad = 6.7651\nshape = 1.3\npeak_n = 6436.8\n\
                  [tires.rear]\nstiffness_per_rad = 9.0051\nshape = 1.3\npeak_n = 5430.0\n";
    fs::write(folder.path().join("b.toml"), road_b).expect("the file can be written");
    let arguments = ["simulate", "--config", "b.toml", "--out", "t.csv"];
    assert_refused(folder.path(), arguments, &["diverges at"]);
    assert!(!folder.path().join("t.csv").exists(), "nothing is written");
}

#[test]
fn outputs_are_not_overwritten_unasked() {
    let folder = folder();
    let out = folder.path().join("t.csv");
    fs::write(&out, "precious").expect("the file can be written");
    let arguments = ["simulate", "--time", "1", "--out", "t.csv"];
    assert_refused(folder.path(), arguments, &["t.csv exists", "--force"]);
    assert_eq!(fs::read_to_string(&out).expect("it is there"), "precious");
    let forced = ["simulate", "--time", "1", "--out", "t.csv", "--force"];
    assert_ends(&mut command(folder.path(), forced), 0);
    let csv = fs::read_to_string(&out).expect("it is there");
    assert!(csv.starts_with("time_s,sideslip_rad,yaw_rate_rad_per_s,"));
    assert_eq!(csv.lines().count(), 1001);
    // A folder that is not there, or is a file.
    for (out, part) in [
        ("missing/t.csv", "the folder missing does not exist"),
        ("t.csv/u.csv", "t.csv is not a folder"),
    ] {
        assert_refused(
            folder.path(),
            ["simulate", "--time", "1", "--out", out],
            &["cannot write", out, part],
        );
    }
}

#[test]
fn configurations_are_complete_and_read_back() {
    let folder = folder();
    for preset in ["reconstruction", "printed"] {
        let printed = assert_ends(
            &mut command(folder.path(), ["config", "--preset", preset]),
            0,
        );
        fs::write(folder.path().join("c.toml"), &printed.stdout).expect("the file can be written");
        let again = assert_ends(
            &mut command(folder.path(), ["config", "--config", "c.toml"]),
            0,
        );
        assert_eq!(again.stdout, printed.stdout);
    }
}

const COMMANDS: [&str; 27] = [
    "verify",
    "pil",
    "simulate",
    "reproduce",
    "lyapunov",
    "averaging",
    "convergence",
    "orbit",
    "continue",
    "regions",
    "feedback",
    "equilibria",
    "basin",
    "phase",
    "poincare",
    "spectrum",
    "tires",
    "nonlinearity",
    "map",
    "schedule",
    "realisability",
    "faults",
    "config",
    "fmu",
    "firmware image",
    "firmware run",
    "firmware decode",
];

#[test]
fn help_has_examples() {
    let folder = folder();
    for name in COMMANDS {
        let help = assert_ends(
            &mut command(folder.path(), name.split(' ').chain(["--help"])),
            0,
        );
        let text = String::from_utf8_lossy(&help.stdout);
        assert!(
            text.contains("Example") && text.contains(&format!("sim-host {name}")),
            "{text}"
        );
    }
}

/// A small image that is no firmware, or none at all.
#[test]
fn images_are_checked() {
    let folder = folder();
    fs::write(folder.path().join("text"), "not an image").expect("the file can be written");
    for command in [["firmware", "run"], ["verify", "--firmware"]] {
        let with = |image| [command.as_slice(), &[image]].concat();
        assert_refused(
            folder.path(),
            with("missing"),
            &["missing", "cargo xtask firmware"],
        );
        assert_refused(folder.path(), with("text"), &["text is not an ELF file"]);
        // This program itself: an ELF for another machine.
        assert_refused(
            folder.path(),
            with(env!("CARGO_BIN_EXE_sim-host")),
            &["not for a 32-bit Arm Cortex-M"],
        );
    }
    assert!(!folder.path().join("target").exists(), "no report is begun");
}

/// The smallest file that passes for an image: an ELF header for 32-bit Arm.
fn arm_elf(folder: &Path) -> PathBuf {
    let mut bytes = vec![0; 52];
    bytes[..7].copy_from_slice(&[0x7F, b'E', b'L', b'F', 1, 1, 1]);
    bytes[16] = 2; // executable
    bytes[18] = 40; // Arm
    bytes[20] = 1; // version
    bytes[40] = 52; // length of this header
    let path = folder.join("arm.elf");
    fs::write(&path, bytes).expect("the file can be written");
    path
}

#[test]
fn a_missing_emulator_is_said() {
    let folder = folder();
    let image = arm_elf(folder.path());
    let mut command = command(folder.path(), ["firmware", "run"]);
    let output = assert_ends(command.arg(image).env("PATH", folder.path()), 2);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        message.contains("qemu-system-arm is not installed"),
        "{message}"
    );
    assert!(message.contains("cargo xtask setup"), "{message}");
}

#[test]
fn verify_checks_its_options_first() {
    let folder = folder();
    let image = arm_elf(folder.path());
    let image = image.to_str().expect("the path is text");
    let verify = |more: &[&'static str], parts: &[&str]| {
        let mut arguments = vec!["verify", "--firmware", image];
        arguments.extend(more);
        assert_refused(folder.path(), &arguments, parts);
    };
    verify(
        &["--duration-s", "0"],
        &["--duration-s 0", "from 60 to 3600"],
    );
    verify(&["--duration-s", "nan"], &["--duration-s NaN"]);
    verify(&["--time-out", "0"], &["--time-out 0", "from 0.1"]);
    verify(&["--preset", "papre"], &["unknown preset"]);
    fs::create_dir(folder.path().join("r")).expect("the folder can be made");
    fs::write(folder.path().join("r/index.html"), "precious").expect("the file can be written");
    verify(&["--out", "r"], &["index.html exists", "--force"]);
    verify(
        &["--out", "arm.elf/r"],
        &["cannot write arm.elf/r", "Not a directory"],
    );
    let kept = fs::read_to_string(folder.path().join("r/index.html")).expect("it is there");
    assert_eq!(kept, "precious");
}

/// A telemetry stream of three records.
fn telemetry() -> Vec<u8> {
    telemetry_of([1562, 1563].as_slice())
}

/// The same, of records with these duty codes.
fn telemetry_of(duties: &[u16]) -> Vec<u8> {
    let state = State {
        x: [0.1_f32, -0.2, 0.3, -0.4].into(),
        friction: FrictionMode::Negative,
    };
    let header = Header {
        samples_per_step: duties.len() as u16,
        step_rate_hz: 1000,
        pwm_period: 2500,
        cost_clock_hz: 25_000_000,
        instruction_rate_hz: 31_250_000,
        initial: state,
    };
    let mut stream = Vec::new();
    let mut buffer = [0; 64];
    let length = header.encode(&mut buffer);
    stream.extend(&buffer[..length]);
    for index in 1..=3 {
        let record = Record {
            index,
            state,
            control_cost: 300,
            pwm_cost: 60,
        };
        let length = record.encode(duties.iter().copied(), &mut buffer);
        stream.extend(&buffer[..length]);
    }
    let trailer = Trailer {
        exit_code: 0,
        records: 3,
        overruns: 0,
        stack_bytes: 1000,
        final_duty: 1250,
        neutral_duty: 1250,
        min_interval: 2499,
        max_interval: 2501,
    };
    let length = trailer.encode(&mut buffer);
    stream.extend(&buffer[..length]);
    stream
}

#[test]
fn damaged_telemetry_is_refused() {
    let folder = folder();
    let path = folder.path().join("t.bin");
    let whole = telemetry();
    let decode = ["firmware", "decode", "t.bin", "--out", "t.csv"];
    for length in 0..whole.len() {
        fs::write(&path, &whole[..length]).expect("the file can be written");
        assert_refused(
            folder.path(),
            decode,
            &["telemetry is damaged", "cut short"],
        );
    }
    for byte in (0..whole.len()).step_by(7) {
        let mut flipped = whole.clone();
        flipped[byte] ^= 0x10;
        fs::write(&path, flipped).expect("the file can be written");
        assert_refused(folder.path(), decode, &["telemetry is"]);
    }
    assert!(!folder.path().join("t.csv").exists(), "nothing is written");
    assert_refused(
        folder.path(),
        ["firmware", "decode", "none.bin"],
        &["none.bin"],
    );
    // Whole, with check sums that fit, and no duty code a step.
    let parts = ["samples_per_step = 0", "from 1 to 1000"];
    fs::write(&path, telemetry_of(&[])).expect("the file can be written");
    assert_refused(folder.path(), decode, &parts);
    // No timer of that period holds such a code.
    fs::write(&path, telemetry_of(&[1250, 2501])).expect("the file can be written");
    let parts = ["record 1", "duty code 2501", "2500 counts"];
    assert_refused(folder.path(), decode, &parts);

    fs::write(&path, &whole).expect("the file can be written");
    assert_ends(&mut command(folder.path(), decode), 0);
    let csv = fs::read_to_string(folder.path().join("t.csv")).expect("it is there");
    assert_eq!(csv.lines().count(), 4);
    assert!(
        csv.lines()
            .nth(1)
            .expect("a row")
            .ends_with(",negative,1563")
    );
}
