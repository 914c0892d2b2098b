//! The firmware checks its scenario on the target and refuses a bad one with a named error and an
//! exit code.

use qemu::Machine;
use shared_model::Scenario;
use tests::{TIME_OUT, image, run};

const BAD_SCENARIO: i32 = 10;
const TELEMETRY_FAILED: i32 = 11;

/// Exit code and last log line of the ECU with the given settings.
fn outcome(settings: &[&str]) -> (i32, String) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let settings: Vec<String> = settings.iter().map(|&setting| setting.into()).collect();
    let finished = run(
        &image("bench"),
        Machine::Mps2An386,
        &settings,
        folder.path(),
        TIME_OUT,
    )
    .unwrap_or_else(|error| panic!("{error}"));
    let entries = std::fs::read_dir(folder.path()).expect("the folder is there");
    assert_eq!(entries.count(), 0, "a refused run writes nothing");
    (
        finished.exit_code,
        finished.log.last().cloned().unwrap_or_default(),
    )
}

#[test]
fn bad_scenarios_are_refused_by_name() {
    let cases: [(&[&str], &[&str]); 15] = [
        (
            &["run.wheel_speed_rpm=0"],
            &["run.wheel_speed_rpm = 0", "from 1"],
        ),
        (&["vehicle.mass_kg=-1500"], &["vehicle.mass_kg = -1500"]),
        (&["vehicle.mass_kg=nan"], &["vehicle.mass_kg = NaN"]),
        (&["run.sideslip_rad=inf"], &["run.sideslip_rad = inf"]),
        (&["run.duration_s=0"], &["run.duration_s = 0"]),
        (&["run.control_rate_hz=-1"], &["run.control_rate_hz = -1"]),
        (&["run.control_rate_hz=0"], &["run.control_rate_hz = 0"]),
        (&["run.pwm_rate_hz=10500"], &["multiple"]),
        (
            &["run.pwm_rate_hz=100", "run.control_rate_hz=100"],
            &["run.pwm_rate_hz is 250000 counts", "2 to 65535"],
        ),
        (
            &["dither.waveform=square", "dither.amplitude_v=11"],
            &["amplitude_v = 11", "bus_voltage_v = 12"],
        ),
        (
            &[
                "dither.waveform=square",
                "dither.square_frequency_rad_per_s=40000",
            ],
            &["dither frequency 40000", "half of run.pwm_rate_hz"],
        ),
        (
            &["run.weel_speed_rpm=1600"],
            &["run.weel_speed_rpm=1600", "no parameter of that name"],
        ),
        (&["run.wheel_speed_rpm=fast"], &["not a number"]),
        (
            &["friction.law=sticky"],
            &["friction.law=sticky", "none of the parameter's names"],
        ),
        (&["run.wheel_speed_rpm"], &["must be key=value"]),
    ];
    for (settings, parts) in cases {
        let (exit_code, line) = outcome(settings);
        assert_eq!(exit_code, BAD_SCENARIO, "{settings:?}: {line}");
        assert!(line.contains("scenario refused"), "{settings:?}: {line}");
        for part in parts {
            assert!(line.contains(part), "{settings:?}: {line} lacks {part}");
        }
    }
}

/// The host's message for the same settings, which it parses by the same code in the same
/// arithmetic.
fn host(settings: &[String]) -> Option<String> {
    let mut scenario = Scenario::<f32>::reconstruction();
    for setting in settings {
        scenario.apply(setting).expect("they are settings");
    }
    scenario.validate().err().map(|error| error.to_string())
}

/// A sentence word by word, numbers as the nearest of f64, however they are written.
fn words(sentence: &str) -> Vec<String> {
    let word = |word: &str| {
        let bare = word.trim_end_matches([':', ',', ';']);
        let number = bare.parse::<f64>().map(|number| number.to_string());
        number.unwrap_or_else(|_| bare.into())
    };
    sentence.split_whitespace().map(word).collect()
}

/// The settings that the host refuses are those that the firmware refuses, in the same words with
/// the same values and bounds.
#[test]
fn host_and_firmware_refuse_the_same_in_the_same_words() {
    let mut cases: Vec<Vec<String>> = Vec::new();
    // Every number there is, just and far outside its range.
    for setting in qemu::settings::of(&Scenario::<f32>::reconstruction()) {
        let (key, value) = setting.split_once('=').expect("it is a setting");
        if value.parse::<f32>().is_ok() && key != "servo.timer_clock_hz" {
            cases.extend(["-1e30", "3e38", "nan"].map(|bad| vec![format!("{key}={bad}")]));
        }
    }
    // Every way in which numbers do not fit together.
    let together: [&[&str]; 8] = [
        &["run.pwm_rate_hz=10500"],
        &["run.pwm_rate_hz=10000.5"],
        &["run.control_rate_hz=10", "run.pwm_rate_hz=20000"],
        &["run.pwm_rate_hz=100", "run.control_rate_hz=100"],
        &["run.duration_s=1e6"],
        &["run.duration_s=1e-4"],
        &[
            "dither.waveform=square",
            "dither.square_frequency_rad_per_s=40000",
        ],
        &["dither.waveform=square", "dither.amplitude_v=11.25"],
    ];
    cases.extend(together.map(|case| case.iter().map(|&setting| setting.into()).collect()));
    assert!(cases.len() > 150, "{}", cases.len());
    for case in cases {
        let expected = host(&case).unwrap_or_else(|| panic!("{case:?}: the host takes it"));
        let settings: Vec<&str> = case.iter().map(String::as_str).collect();
        let (exit_code, line) = outcome(&settings);
        assert_eq!(exit_code, BAD_SCENARIO, "{case:?}: {line}");
        let (_, message) = line.split_once("scenario refused: ").unwrap_or(("", &line));
        assert_eq!(words(message), words(&expected), "{case:?}");
    }
}

#[test]
fn unwritable_telemetry_ends_the_run() {
    let (exit_code, line) = outcome(&["telemetry=missing/folder/t.bin", "run.duration_s=1"]);
    assert_eq!(exit_code, TELEMETRY_FAILED, "{line}");
    assert!(line.contains("cannot write the telemetry file"), "{line}");
}
