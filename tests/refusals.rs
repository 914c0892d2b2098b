//! The firmware checks its scenario on the target and refuses a bad one with a named error and an exit code.

use sim_host::pil::qemu::Machine;
use tests::{TIME_OUT, image, run};

const BAD_SCENARIO: i32 = 10;
const TELEMETRY_FAILED: i32 = 11;

/// Exit code and last log line of the ECU with the given settings.
fn outcome(settings: &[&str]) -> (i32, String) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let settings: Vec<String> = settings.iter().map(|&setting| setting.into()).collect();
    let finished = run(
        &image("ecu"),
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
            &["250000 timer counts", "2 to 65535"],
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
            &["dither frequency 40000", "half the PWM rate"],
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

#[test]
fn unwritable_telemetry_ends_the_run() {
    let (exit_code, line) = outcome(&["telemetry=missing/folder/t.bin", "run.duration_s=1"]);
    assert_eq!(exit_code, TELEMETRY_FAILED, "{line}");
    assert!(line.contains("cannot write the telemetry file"), "{line}");
}
