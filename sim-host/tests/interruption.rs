//! SIGTERM ends every long job, wherever it is: none of these would end by itself within the hour.

use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// A job is in its loops by then.
const RUNNING: Duration = Duration::from_millis(400);
/// It ends within a second; the test waits longer only to report a failure on a slow machine as
/// one.
const PATIENCE: Duration = Duration::from_secs(20);

fn start(arguments: &[&str], folder: &std::path::Path) -> Child {
    Command::new(env!("CARGO_BIN_EXE_sim-host"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

/// Exit code and last line after a SIGTERM.
fn end(mut child: Child) -> (Option<i32>, String) {
    thread::sleep(RUNNING);
    let id = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(id, rustix::process::Signal::TERM).expect("it runs");
    let sent = Instant::now();
    while child.try_wait().expect("it can be waited for").is_none() {
        if sent.elapsed() > PATIENCE {
            child.kill().expect("it runs");
        }
        thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().expect("it has ended");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    (
        output.status.code(),
        text.lines().last().unwrap_or_default().into(),
    )
}

#[test]
fn sigterm_ends_every_long_job() {
    let folder = tempfile::tempdir().expect("a folder");
    let signal = "[dither]\nwaveform = \"square\"\namplitude_v = 0.1\napplication = \"signal\"\n";
    std::fs::write(folder.path().join("signal.toml"), signal).expect("a file");
    for arguments in [
        &["simulate", "--time", "100000", "--out", "a.csv"][..],
        &["lyapunov", "--rpm", "1750", "--time", "400000"],
        &[
            "lyapunov", "--rpm", "1750", "--time", "400000", "--method", "twin",
        ],
        &[
            "lyapunov",
            "--rpm",
            "1750",
            "--time",
            "10000",
            "--method",
            "synchronisation",
        ],
        &["orbit", "--time", "400000", "--out", "orbit.csv"],
        &["continue", "--transient", "100000", "--out", "branches.csv"],
        &["regions", "--time", "400000", "--out", "regions.csv"],
        &["basin", "--time", "400000", "--out", "basin.csv"],
        &["feedback", "--time", "100000", "--out", "feedback.csv"],
        &["phase", "--transient", "100000", "--out", "phase.csv"],
        &["poincare", "--time", "400000", "--out", "section.csv"],
        &[
            "poincare",
            "--time",
            "10000",
            "--config",
            "signal.toml",
            "--out",
            "true.csv",
        ],
        &["spectrum", "--time", "10000", "--out", "spectrum.csv"],
        &["map", "--time", "100000", "--out", "map.csv"],
        &["schedule", "--time", "100000", "--transient", "50000"],
        &["reproduce", "--out", "reproduce"],
    ] {
        let (code, last) = end(start(arguments, folder.path()));
        assert_eq!(code, Some(2), "{arguments:?}: {last}");
        assert!(
            last.contains("interrupted") || last.contains("stopped"),
            "{arguments:?}: {last}"
        );
    }
}

/// A log without a sensor frame from a pipe that never ends, and one of empty lines.
#[test]
fn sigterm_ends_the_replay_of_an_endless_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe.log");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo starts").success());
    for line in ["(1.0) can0 7DF#00", ""] {
        let mut writer = Command::new("sh")
            .args(["-c", "exec yes \"$1\" > pipe.log", "sh", line])
            .current_dir(folder.path())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell");
        let arguments = ["pil", "--replay", "pipe.log", "--out", "o.csv"];
        let (code, message) = end(start(&arguments, folder.path()));
        writer.wait().expect("it ends with the pipe");
        assert_eq!(
            (code, message.as_str()),
            (Some(2), "error: interrupted"),
            "{line:?}"
        );
        assert!(!folder.path().join("o.csv").exists());
    }
}
