//! `sim-host pil`, as a user meets it without an emulator: bad input, and recordings that are none.

use shared_model::Scenario;
use sim_host::closed_loop::drive::{Drive, ecu_scenario};
use sim_host::closed_loop::ecu::Software;
use sim_host::closed_loop::manoeuvre::Manoeuvre;
use sim_host::closed_loop::recording::Recording;
use sim_host::closed_loop::run::run;
use std::path::Path;
use std::process::{Command, Output};

fn sim_host(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sim-host"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

/// Expects the exit code and a message with all of `parts`.
fn assert_ends(folder: &Path, line: &str, code: i32, parts: &[&str]) {
    let output = sim_host(folder, line);
    let message = String::from_utf8_lossy(&output.stderr) + String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(code), "{line}: {message}");
    for part in parts {
        assert!(message.contains(part), "{line}: {message} lacks {part:?}");
    }
}

fn assert_refused(line: &str, parts: &[&str]) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    assert_ends(folder.path(), line, 2, parts);
}

#[test]
fn bad_input_is_refused_before_any_work() {
    assert_refused("pil --rpm nan", &["wheel_speed_rpm", "NaN"]);
    assert_refused("pil --rpm 0", &["wheel_speed_rpm", "from 1"]);
    assert_refused("pil --time 0", &["run.duration_s = 0"]);
    assert_refused("pil --time inf", &["run.duration_s = inf"]);
    assert_refused("pil --dither triangle", &["none, square, sine"]);
    assert_refused("pil --link can", &["files, timed, uart"]);
    assert_refused("pil --time-out 0", &["--time-out 0"]);
    assert_refused(
        "pil --scenario missing.toml",
        &["missing.toml", "cannot read"],
    );
    assert_refused(
        "pil --firmware missing.elf",
        &["missing.elf", "cargo xtask firmware"],
    );
    assert_refused("pil --replay missing.loop", &["cannot read missing.loop"]);
    assert_refused("pil --replay a --rpm 1750", &["cannot be used with"]);
}

#[test]
fn outputs_of_one_manoeuvre_are_refused_for_two_and_files_are_kept() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let manoeuvre = "[manoeuvre]\nname = \"m\"\nwheel_speed_rpm = [[0.0, 1750.0]]\ncurrent_request_a = [[0.0, 10.0]]\n";
    for name in ["a.toml", "b.toml"] {
        std::fs::write(folder.path().join(name), manoeuvre).expect("it is written");
    }
    std::fs::write(folder.path().join("there.csv"), "kept").expect("it is written");
    let two = "pil --scenario a.toml b.toml --record r.loop";
    assert_ends(folder.path(), two, 2, &["--record", "one manoeuvre"]);
    let there = "pil --scenario a.toml --out there.csv";
    assert_ends(folder.path(), there, 2, &["there.csv exists", "--force"]);
    let kept = std::fs::read_to_string(folder.path().join("there.csv")).expect("it is there");
    assert_eq!(kept, "kept");
}

fn recording() -> Vec<u8> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 0.05;
    let manoeuvre = Manoeuvre::constant(1750.0, 0.1);
    let own = ecu_scenario(&scenario, &manoeuvre);
    let drive = Drive::new(&scenario, &manoeuvre).expect("it is valid");
    let mut ecu = Software::new(&own).expect("it is valid");
    let recording = Recording {
        scenario: own,
        exchanges: run(&mut ecu, drive, || {}).expect("on the host").exchanges,
    };
    let mut bytes = Vec::new();
    recording.write(&mut bytes).expect("a buffer takes it");
    bytes
}

#[test]
fn recordings_are_replayed_and_damage_is_said() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let replay = |bytes: &[u8], code, parts: &[&str]| {
        std::fs::write(folder.path().join("r.loop"), bytes).expect("it is written");
        assert_ends(folder.path(), "pil --replay r.loop", code, parts);
    };
    let whole = recording();
    replay(&whole, 0, &["duties", "equal"]);
    for at in [9, whole.len() / 2, whole.len() - 1] {
        let mut damaged = whole.clone();
        damaged[at] ^= 1;
        replay(&damaged, 2, &["r.loop", "check sum"]);
    }
    replay(&whole[..whole.len() - 54], 2, &["check sum"]);
    replay(&whole[..8], 2, &["check sum"]);
    replay(b"time_s,duty\n", 2, &["is no recording"]);
    replay(b"", 2, &["is no recording"]);

    // Another command in the recording, and the check sum right: what differs is the command.
    let mut other = Recording::read(&whole).expect("it is whole");
    other.exchanges[300].from_ecu.duty_code ^= 1;
    let mut bytes = Vec::new();
    other.write(&mut bytes).expect("a buffer takes it");
    replay(&bytes, 1, &["1 from 300"]);
}
