//! Bus logs of `sim-host pil`: the CAN database beside a log, and a long log replayed in constant
//! memory.

use shared_model::e2e::Sender;
use shared_model::frame::{SENSOR_DATA_ID, encode_measurement};
use shared_model::signal::Measurement;
use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;
use tests::{image, root, sim_host};

/// Runs `sim-host pil` with the firmware for a moment.
fn pil(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(sim_host());
    command.args(["pil", "--time", "0.05", "--firmware"]);
    command
        .arg(image("bench").path)
        .args(line.split_whitespace());
    let output = command.current_dir(folder).output();
    output.expect("it starts")
}

#[track_caller]
fn assert_ends(output: &Output, code: i32, parts: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    for part in parts {
        assert!(message.contains(part), "{message} lacks {part:?}");
    }
}

#[test]
fn the_database_is_written_beside_a_log_and_another_one_is_kept() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let at = folder.path();
    let database = at.join("drive.dbc");
    let own = fs::read(root().join("docs/dithersteer.dbc")).expect("it is there");
    let is_own = || fs::read(&database).expect("it is there") == own;

    assert_ends(&pil(at, "--can-log drive.log"), 0, &[]);
    assert!(is_own() && at.join("drive.log").is_file());
    // The same database serves another log.
    assert_ends(&pil(at, "--can-log drive.asc"), 0, &[]);
    assert!(is_own());

    fs::write(&database, "mine").expect("it is written");
    fs::remove_file(at.join("drive.log")).expect("it is there");
    let refused = pil(at, "--can-log drive.log");
    assert_ends(&refused, 2, &["drive.dbc exists; give --force"]);
    assert_eq!(fs::read(&database).expect("it is there"), b"mine");
    assert!(!at.join("drive.log").exists());
    assert_ends(&pil(at, "--can-log drive.log --force"), 0, &[]);
    assert!(is_own());

    // Two outputs in one file; and a stream, which has no place beside it.
    let same = pil(at, "--can-log drive.dbc --force");
    assert_ends(&same, 2, &["drive.dbc are the same file"]);
    let files = || fs::read_dir(at).expect("it is a folder").count();
    let before = files();
    let stream = pil(at, "--can-log -");
    assert_ends(&stream, 0, &[]);
    assert!(stream.stdout.starts_with(b"(") && files() == before);
}

/// Greatest resident memory that a process has had, kB.
fn peak_kb(child: &Child) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).expect("Linux");
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let number = peak.and_then(|peak| peak.split_whitespace().next());
    number
        .and_then(|number| number.parse().ok())
        .expect("a number")
}

/// Replays a log of at least that many bytes, made while it is read, with every control tick as CSV.
/// Returns the peak of the memory when all but the pipe's last bytes are read.
fn replay_peak_kb(bytes: usize) -> u64 {
    let mut child = Command::new(sim_host())
        .args(["pil", "--replay", "/dev/stdin", "--out", "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut pipe = child.stdin.take().expect("it is piped");
    let measurement = Measurement {
        wheel_speed_rpm: 1750.0,
        yaw_rate_rad_per_s: 0.5,
        steering_angle_rad: 0.1,
        steering_rate_rad_per_s: 0.0,
        current_request_a: 0.0,
    };
    let mut sender = Sender::new(SENSOR_DATA_ID);
    let (mut written, mut ticks) = (0, 0_u64);
    let mut line = String::new();
    while written < bytes {
        line.clear();
        // A thousand frames, one per millisecond.
        for _ in 0..1000 {
            let (seconds, milliseconds) = (ticks / 1000, ticks % 1000);
            write!(line, "({seconds:010}.{milliseconds:03}000) can0 100##1").expect("a text");
            for byte in encode_measurement(&measurement, 0, &mut sender) {
                write!(line, "{byte:02X}").expect("a text");
            }
            line.push('\n');
            ticks += 1;
        }
        pipe.write_all(line.as_bytes()).expect("it is read");
        written += line.len();
    }
    // The pipe holds a thousandth of the shortest log.
    std::thread::sleep(Duration::from_millis(200));
    let peak_kb = peak_kb(&child);
    drop(pipe);
    let output = child.wait_with_output().expect("it is a child");
    let summary = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{summary}");
    let read = format!("{ticks} control ticks, {ticks} sensor frames: 0 damaged");
    assert!(summary.starts_with(&read), "{summary}");
    peak_kb
}

/// Expects the same peak as of a log of 1 MB, but for what the allocator leaves unused.
fn assert_constant_memory(bytes: usize) {
    const SPARE_KB: u64 = 1000;
    let [short_kb, long_kb] = [1_000_000, bytes].map(replay_peak_kb);
    println!(
        "peak: {short_kb} kB for 1 MB, {long_kb} kB for {} MB",
        bytes / 1_000_000
    );
    assert!(
        long_kb <= short_kb + SPARE_KB,
        "{short_kb} kB, {long_kb} kB"
    );
}

#[test]
fn a_long_log_is_replayed_in_constant_memory() {
    assert_constant_memory(50_000_000);
}

/// Minutes of work: `cargo test --release -p tests --test bus_logs -- --ignored --nocapture`.
#[test]
#[ignore = "minutes"]
fn a_log_of_a_gigabyte_is_replayed_in_constant_memory() {
    assert_constant_memory(1_000_000_000);
}
