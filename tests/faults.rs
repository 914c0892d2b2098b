//! Faults of the firmware: the PWM goes neutral first, then a distinct exit code; the runner never
//! hangs and leaves no emulator behind.

use qemu::telemetry::Recording;
use qemu::{Machine, RunError};
use shared_model::Scenario;
use shared_model::tire::TireModel;
use std::process::Command;
use std::time::{Duration, Instant};
use tests::{TIME_OUT, image, record, run, sim_host};

const OVERRUN: i32 = 12;
const WATCHDOG: i32 = 15;

#[test]
fn sr16_each_fault_neutralises_the_pwm_and_has_its_exit_code() {
    for (fault, exit_code) in [
        ("panic", 13),
        ("hard-fault", 14),
        ("stack-overflow", 14),
        ("watchdog", 15),
    ] {
        for machine in [Machine::Mps2An386, Machine::Mps2An500] {
            let folder = tempfile::tempdir().expect("a temporary folder can be made");
            let finished = run(
                &image("bench"),
                machine,
                &[format!("fault={fault}")],
                folder.path(),
                TIME_OUT,
            )
            .unwrap_or_else(|error| panic!("{fault}: {error}"));
            assert_eq!(finished.exit_code, exit_code, "{fault}");
            let recording = Recording::open(&folder.path().join("drill.bin"))
                .unwrap_or_else(|error| panic!("{fault}: {error}"));
            let trailer = recording.trailer;
            assert_eq!(trailer.exit_code, exit_code as u32, "{fault}");
            // The drill drives the PWM to full duty before the fault.
            assert_eq!(trailer.final_duty, trailer.neutral_duty, "{fault}");
            assert_eq!(
                trailer.neutral_duty,
                recording.header.pwm_period / 2,
                "{fault}"
            );
        }
    }
}

#[test]
fn a_firmware_that_hangs_is_stopped_and_gone() {
    let marker = format!("marker-{}", std::process::id());
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let limit = Duration::from_secs(2);
    let start = Instant::now();
    let settings = ["fault=hang".into(), marker.clone()];
    let error = run(
        &image("bench"),
        Machine::Mps2An386,
        &settings,
        folder.path(),
        limit,
    )
    .expect_err("it hangs");
    assert!(matches!(error, RunError::TimedOut { .. }), "{error}");
    assert!(start.elapsed() >= limit);
    assert!(!is_running(&marker), "the emulator is left behind");
}

#[test]
fn the_runner_says_that_a_firmware_hangs_and_passes_exit_codes_on() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let drill = |arguments: &[&str]| {
        let output = Command::new(sim_host())
            .args(["firmware", "run", "--time-out", "2"])
            .arg(image("bench").path)
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .expect("the program starts");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), message)
    };
    let (code, message) = drill(&["fault=hang"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("did not end within 2 s"), "{message}");
    let (code, message) = drill(&["fault=hard-fault"]);
    assert_eq!(code, Some(14), "{message}");
    assert!(
        message.contains("hard fault; the PWM was put to neutral"),
        "{message}"
    );
}

/// Whether a process has `marker` in its command line.
fn is_running(marker: &str) -> bool {
    let processes = std::fs::read_dir("/proc").expect("the system lists its processes");
    let own = std::process::id().to_string();
    processes.flatten().any(|process| {
        let command_line = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
        process.file_name() != *own && String::from_utf8_lossy(&command_line).contains(marker)
    })
}

#[test]
fn a_task_that_misses_its_period_fails_the_run() {
    let mut scenario = Scenario::<f32>::reconstruction();
    // A plain step fits the period of 40 us, one that is split at a friction event does not.
    scenario.run.pwm_rate_hz = 25_000.0;
    scenario.run.control_rate_hz = 25_000.0;
    scenario.run.duration_s = 5.0;
    let recording = record(&scenario, Machine::Mps2An386, OVERRUN);
    assert!(recording.trailer.overruns > 0);
    assert_eq!(recording.trailer.final_duty, recording.trailer.neutral_duty);
}

#[test]
fn a_task_that_leaves_no_time_for_anything_else_meets_the_watchdog() {
    let mut scenario = Scenario::<f32>::reconstruction();
    scenario.tires.model = TireModel::MagicFormula;
    scenario.run.pwm_rate_hz = 20_000.0;
    scenario.run.control_rate_hz = 20_000.0;
    let recording = record(&scenario, Machine::Mps2An386, WATCHDOG);
    assert!(recording.trailer.overruns > 0);
    assert_eq!(recording.trailer.final_duty, recording.trailer.neutral_duty);
}

#[test]
fn a_complete_run_ends_neutral_without_overruns() {
    let mut scenario = Scenario::<f32>::reconstruction();
    scenario.run.duration_s = 0.5;
    let recording = record(&scenario, Machine::Mps2An386, 0);
    assert_eq!(recording.trailer.overruns, 0);
    assert_eq!(recording.records.len(), 500);
    assert_eq!(recording.trailer.final_duty, recording.trailer.neutral_duty);
}
