//! Runs of the firmware's images in QEMU, for the tests.

pub mod golden;
pub mod python;
pub mod slurm;

use image::Image;
use qemu::log::LogDecoder;
use qemu::settings;
use qemu::telemetry::Recording;
use qemu::{self, Finished, Machine, RunError};
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Far more than any run of the tests takes.
pub const TIME_OUT: Duration = Duration::from_secs(120);
const USUAL_BOARD: &str = "mps2";
/// File of a run's telemetry in its folder.
pub const TELEMETRY: &str = "telemetry.bin";

/// An image of the firmware for the usual board.
///
/// # Panics
/// If it is not built: a test that cannot run has not passed.
pub fn image(name: &str) -> Image {
    board_image(USUAL_BOARD, name)
}

/// An image of the firmware for a board.
///
/// # Panics
/// If it is not built: a test that cannot run has not passed.
pub fn board_image(board: &str, name: &str) -> Image {
    // Every board but the usual one has a target folder of its own.
    match board {
        USUAL_BOARD => open(&target(), name),
        _ => open(&target().join("boards").join(board), name),
    }
}

/// The workspace's folder.
pub fn root() -> &'static Path {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests.parent().expect("the tests are in the workspace")
}

/// Where cargo puts what it builds.
fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

fn open(target: &Path, name: &str) -> Image {
    let path = target.join("thumbv7em-none-eabihf/firmware").join(name);
    Image::open(&path).unwrap_or_else(|error| panic!("{error} (or run `cargo xtask test`)"))
}

/// A short run with the dither from its first quarter on.
pub fn scenario(waveform: Waveform, application: Application) -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 2.0;
    scenario.dither.start_time_s = 0.5;
    scenario.dither.waveform = waveform;
    scenario.dither.application = application;
    // Without a waveform no amplitude may count.
    scenario.dither.amplitude_v = match waveform {
        Waveform::Sine => 1.0,
        Waveform::Square | Waveform::None => 0.1,
    };
    scenario
}

/// Runs an image with the settings in `folder`.
///
/// # Errors
/// If it cannot be run or does not end in time.
pub fn run(
    image: &Image,
    machine: Machine,
    settings: &[String],
    folder: &Path,
    limit: Duration,
) -> Result<Finished, RunError> {
    let log = LogDecoder::new(image).map_err(RunError::Log)?;
    qemu::run_with(&log, image, machine, settings, folder, limit, &|_| {})
}

/// Runs the ECU with a scenario to its end and reads its telemetry.
///
/// # Panics
/// If the firmware does not end with `exit_code`, or its telemetry is damaged.
pub fn record(scenario: &Scenario<f32>, machine: Machine, exit_code: i32) -> Recording {
    record_with(scenario, machine, exit_code, &[])
}

/// The same, with further settings.
///
/// # Panics
/// As [`record`].
pub fn record_with(
    scenario: &Scenario<f32>,
    machine: Machine,
    exit_code: i32,
    more: &[&str],
) -> Recording {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut settings = settings::of(scenario);
    settings.push(format!("telemetry={TELEMETRY}"));
    settings.extend(more.iter().map(|&setting| setting.to_owned()));
    let image = board_image(machine.board(), "bench");
    let finished = run(&image, machine, &settings, folder.path(), TIME_OUT)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(finished.exit_code, exit_code, "log: {:?}", finished.log);
    Recording::open(&folder.path().join(TELEMETRY)).unwrap_or_else(|error| panic!("{error}"))
}

/// The command-line program, which cargo builds beside the tests.
///
/// # Panics
/// If it is not there.
pub fn sim_host() -> PathBuf {
    let test = std::env::current_exe().expect("the test is a file");
    let program = test
        .ancestors()
        .nth(2)
        .expect("tests are in target/PROFILE/deps")
        .join("sim-host");
    assert!(
        program.exists(),
        "{} is not built: run `cargo xtask test`",
        program.display()
    );
    program
}

/// All files of a pattern that git tracks.
pub fn tracked(pattern: &str) -> Vec<String> {
    let git = Command::new("git")
        .args(["ls-files", pattern])
        .current_dir(root())
        .output()
        .expect("git starts");
    assert!(git.status.success(), "git ls-files: {}", git.status);
    let names = String::from_utf8(git.stdout).expect("names are UTF-8");
    names.lines().map(str::to_owned).collect()
}
