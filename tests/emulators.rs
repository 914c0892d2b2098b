//! Programs that are called as the emulator and are none, or fail as one may: the host neither
//! believes nor waits for them, and leaves nothing of them behind.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tests::{TIME_OUT, image, sim_host};

/// Far longer than any run here may take.
const ASLEEP_S: &str = "600";
const MEMORY_KB: u64 = 300_000;

/// A folder with a program in the emulator's place: a script of the shell.
fn fake(script: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let program = folder.path().join("qemu-system-arm");
    fs::write(&program, format!("#!/bin/sh\n{script}\n")).expect("it can be written");
    let mode = fs::Permissions::from_mode(0o755);
    fs::set_permissions(&program, mode).expect("it can be made a program");
    folder
}

/// The program, with that folder's emulator, at work in the folder.
fn command(folder: &TempDir, arguments: &[&str]) -> Command {
    let path = std::env::var("PATH").unwrap_or_default();
    let mut command = Command::new(sim_host());
    command
        .args(arguments)
        .current_dir(folder.path())
        .env("PATH", format!("{}:{path}", folder.path().display()))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

fn run(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String) {
    let output = command(folder, arguments).output();
    ended(&output.expect("the program starts"))
}

fn ended(output: &Output) -> (Option<i32>, String) {
    let message = String::from_utf8_lossy(&output.stderr);
    (output.status.code(), message.into_owned())
}

fn ecu() -> String {
    image("bench").path.to_string_lossy().into_owned()
}

#[track_caller]
fn assert_could_not_run(ended: (Option<i32>, String), parts: &[&str]) {
    let (code, message) = ended;
    assert_eq!(code, Some(2), "{message}");
    for part in parts {
        assert!(message.contains(part), "{message} lacks {part:?}");
    }
}

/// Whether a process has `marker` in its command line.
fn is_running(marker: &str) -> bool {
    let processes = fs::read_dir("/proc").expect("the system lists its processes");
    processes.flatten().any(|process| {
        let command_line = fs::read(process.path().join("cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&command_line).contains(marker)
    })
}

#[track_caller]
fn assert_gone(marker: &str) {
    let start = Instant::now();
    while is_running(marker) {
        assert!(start.elapsed() < TIME_OUT, "{marker} is left behind");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A number of seconds to sleep that no other process has: the marker by which it is found.
fn asleep(test: u32) -> String {
    format!("{ASLEEP_S}.{}{test}", std::process::id())
}

#[test]
fn exit_code_0_alone_is_no_run() {
    let parts = ["exit code 0", "\"run complete\""];
    let liar = fake("exit 0");
    assert_could_not_run(run(&liar, &["firmware", "run", &ecu()]), &parts);
    assert_could_not_run(
        run(&liar, &["firmware", "run", &ecu(), "telemetry=t.bin"]),
        &parts,
    );
    let garbage = fake("head -c 100000 /dev/urandom; echo run complete; exit 0");
    assert_could_not_run(run(&garbage, &["firmware", "run", &ecu()]), &parts);
    // In the loop its end comes in the middle of a run.
    let in_loop = ["pil", "--time", "0.1", "--firmware", &ecu()];
    assert_could_not_run(run(&liar, &in_loop), &["left the loop with exit code 0"]);
}

#[test]
fn a_signal_that_ends_the_emulator_is_named() {
    let crash = fake("echo not well >&2; kill -SEGV $$");
    let parts = ["itself failed", "SIGSEGV", "not well"];
    assert_could_not_run(run(&crash, &["firmware", "run", &ecu()]), &parts);
    let in_loop = ["pil", "--time", "0.1", "--firmware", &ecu()];
    assert_could_not_run(run(&crash, &in_loop), &parts);
    let verify = ["verify", "--out", "report", "--firmware", &ecu()];
    assert_could_not_run(run(&crash, &verify), &parts);
    let faults = ["faults", "--quick", "--firmware", &ecu()];
    assert_could_not_run(run(&crash, &faults), &parts);
}

#[test]
fn a_wrapper_whose_child_keeps_the_pipe_is_not_waited_for() {
    for (test, script) in [
        (1, "sleep $T & wait"),
        (2, "sleep $T & exit 0"),
        (3, "setsid sleep $T & wait"),
    ] {
        let marker = asleep(test);
        let wrapper = fake(&script.replace("$T", &marker));
        let start = Instant::now();
        let (code, message) = run(&wrapper, &["firmware", "run", "--time-out", "1", &ecu()]);
        assert!(start.elapsed() < TIME_OUT, "{script}");
        assert_eq!(code, Some(2), "{script}: {message}");
        // A session of its own is beyond the group; it is let go, not waited for.
        if !script.contains("setsid") {
            assert_gone(&marker);
        }
    }
}

#[test]
fn an_emulator_that_says_nothing_in_the_loop_is_a_time_out() {
    let marker = asleep(4);
    let silent = fake(&format!("sleep {marker} & wait"));
    let in_loop = [
        "pil",
        "--time",
        "0.1",
        "--time-out",
        "1",
        "--firmware",
        &ecu(),
    ];
    assert_could_not_run(run(&silent, &in_loop), &["did not end within 1 s"]);
    assert_gone(&marker);
}

#[test]
fn a_flood_of_output_takes_little_memory() {
    for flood in ["cat /dev/zero", "yes", "yes | tr '\\n' '\\0'", "yes >&2"] {
        let endless = fake(flood);
        let mut child = command(&endless, &["firmware", "run", "--time-out", "2", &ecu()])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        let mut most_kb = 0;
        while child.try_wait().expect("it is a child").is_none() {
            most_kb = most_kb.max(peak_kb(&child).unwrap_or(0));
            std::thread::sleep(Duration::from_millis(20));
        }
        let status = child.wait().expect("it is a child");
        assert_eq!(status.code(), Some(2), "{flood}");
        assert!((1..MEMORY_KB).contains(&most_kb), "{flood}: {most_kb} kB");
    }
}

/// Most memory that a process has had.
fn peak_kb(child: &Child) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// A signal reaches this program alone; the emulator ends with it nevertheless.
#[test]
fn the_emulator_ends_with_this_program() {
    for (test, arguments) in [
        (5, vec!["firmware", "run", "IMAGE"]),
        (6, vec!["pil", "--time", "1", "--firmware", "IMAGE"]),
    ] {
        for (signal, script) in [
            ("INT", "sleep $T & wait"),
            ("TERM", "sleep $T & wait"),
            ("KILL", "exec sleep $T"),
        ] {
            let marker = asleep(test);
            let wrapper = fake(&script.replace("$T", &marker));
            let ecu = ecu();
            let arguments: Vec<&str> = arguments
                .iter()
                .map(|&argument| {
                    if argument == "IMAGE" {
                        ecu.as_str()
                    } else {
                        argument
                    }
                })
                .collect();
            let child = command(&wrapper, &arguments)
                .spawn()
                .expect("the program starts");
            let start = Instant::now();
            while !is_running(&marker) {
                assert!(start.elapsed() < TIME_OUT, "it does not start");
                std::thread::sleep(Duration::from_millis(10));
            }
            let sent = Command::new("kill")
                .args([&format!("-{signal}"), &child.id().to_string()])
                .status();
            assert!(sent.expect("there is kill").success());
            let (code, message) = ended(&child.wait_with_output().expect("it is a child"));
            if signal != "KILL" {
                assert_eq!(code, Some(2), "{message}");
                assert!(message.contains("interrupted"), "{message}");
            }
            assert_gone(&marker);
        }
    }
}

/// `strip` removes the sections' table; the emulator needs none.
#[test]
fn an_image_without_symbols_runs_without_log() {
    let real = tempfile::tempdir().expect("a temporary folder can be made");
    let mut bytes = image("bench").bytes;
    // e_shoff, then e_shnum and e_shstrndx of an ELF of 32 bits.
    bytes[0x20..0x24].fill(0);
    bytes[0x30..0x34].fill(0);
    fs::write(real.path().join("stripped"), bytes).expect("it can be written");
    let short = [
        "firmware",
        "run",
        "--force",
        "stripped",
        "run.duration_s=0.1",
        "telemetry=t.bin",
    ];
    let output = command(&real, &short).output().expect("the program starts");
    let (code, message) = ended(&output);
    assert_eq!(code, Some(0), "{message}");
    assert_eq!(output.stdout, b"", "no raw bytes");
    assert!(message.contains("no defmt symbols"), "{message}");
    // It is unknown whether this run is complete.
    let in_loop = ["pil", "--time", "0.1", "--firmware", "stripped"];
    assert_could_not_run(run(&real, &in_loop), &["no defmt symbols"]);
    let verify = ["verify", "--out", "report", "--firmware", "stripped"];
    assert_could_not_run(run(&real, &verify), &["no defmt symbols"]);
    // A telemetry file of an earlier run is none of this one.
    let liar = fake("exit 0");
    for file in ["stripped", "t.bin"] {
        fs::copy(real.path().join(file), liar.path().join(file)).expect("it can be copied");
    }
    assert_could_not_run(run(&liar, &short), &["did not write its telemetry t.bin"]);
}

#[test]
fn what_is_no_setting_is_refused_before_anything_starts() {
    let marker = "started";
    let started = |folder: &TempDir| Path::new(folder.path()).join(marker).exists();
    for (setting, part) in [
        ("--time-out", "options go before the image"),
        ("-h", "options go before the image"),
        ("run.wheel_speed_rpm", "must be key=value"),
        (
            "run.weel_speed_rpm=1600",
            "did you mean run.wheel_speed_rpm?",
        ),
        ("run.wheel_speed_rpm=fast", "must be a number"),
        ("friction.law=sticky", "coulomb_rate"),
        ("preset=papre", "reconstruction, printed"),
        ("=1", "unknown key"),
        ("run.duration_s=1 x=2", "must not contain spaces"),
    ] {
        let folder = fake(&format!("touch {marker}; exit 0"));
        let arguments = [
            "firmware",
            "run",
            &ecu(),
            "run.sideslip_rad=0.1",
            setting,
            "5",
        ];
        assert_could_not_run(run(&folder, &arguments), &[part, setting]);
        assert!(!started(&folder), "{setting}: it was started");
    }
}
