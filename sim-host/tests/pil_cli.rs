//! `sim-host pil`, as a user meets it without an emulator: bad input, and recordings that are none.

mod common;

use common::{assert_ends, command, folder};
use pil::closed_loop::run;
use pil::ecu::Software;
use pil::manoeuvre::Manoeuvre;
use pil::recording::Recording;
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use std::path::Path;

fn assert_refused(folder: &Path, line: &str, parts: &[&str]) {
    common::assert_refused(folder, line.split_whitespace(), parts);
}

#[test]
fn bad_input_is_refused_before_any_work() {
    let folder = folder();
    let refused = |line, parts: &[&str]| assert_refused(folder.path(), line, parts);
    refused("pil --rpm nan", &["wheel_speed_rpm", "NaN"]);
    refused("pil --rpm 0", &["wheel_speed_rpm", "from 1"]);
    refused("pil --time 0", &["run.duration_s = 0"]);
    refused("pil --time inf", &["run.duration_s = inf"]);
    refused("pil --dither triangle", &["none, square, sine"]);
    refused("pil --link can", &["files, timed, uart"]);
    refused("pil --time-out 0", &["--time-out 0"]);
    refused(
        "pil --scenario missing.toml",
        &["missing.toml", "cannot read"],
    );
    refused(
        "pil --firmware missing.elf",
        &["missing.elf", "cargo xtask firmware"],
    );
    refused("pil --replay missing.loop", &["cannot read missing.loop"]);
    refused("pil --replay a --rpm 1750", &["cannot be used with"]);
}

#[test]
fn outputs_of_one_manoeuvre_are_refused_for_two_and_files_are_kept() {
    let folder = folder();
    let manoeuvre = "[manoeuvre]\nname = \"m\"\nwheel_speed_rpm = [[0.0, 1750.0]]\ncurrent_request_a = [[0.0, 10.0]]\n";
    for name in ["a.toml", "b.toml"] {
        std::fs::write(folder.path().join(name), manoeuvre).expect("it is written");
    }
    std::fs::write(folder.path().join("there.csv"), "kept").expect("it is written");
    let two = "pil --scenario a.toml b.toml --record r.loop";
    assert_refused(folder.path(), two, &["--record", "one manoeuvre"]);
    let there = "pil --scenario a.toml --out there.csv";
    assert_refused(folder.path(), there, &["there.csv exists", "--force"]);
    let kept = std::fs::read_to_string(folder.path().join("there.csv")).expect("it is there");
    assert_eq!(kept, "kept");
}

fn recording() -> Vec<u8> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.duration_s = 0.05;
    let manoeuvre = Manoeuvre::constant(1750.0, 0.1);
    let own = ecu_scenario(&scenario, &manoeuvre);
    let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
    let mut ecu = Software::new(&own).expect("it is valid");
    let recording = Recording {
        scenario: own,
        exchanges: run(&mut ecu, vehicle, &mut || {})
            .expect("on the host")
            .exchanges,
    };
    let mut bytes = Vec::new();
    recording.write(&mut bytes).expect("a buffer takes it");
    bytes
}

#[test]
fn recordings_are_replayed_and_damage_is_said() {
    let folder = folder();
    let arguments = ["pil", "--replay", "r.loop"];
    let write = |bytes: &[u8]| {
        std::fs::write(folder.path().join("r.loop"), bytes).expect("it is written");
    };
    let replay = |bytes: &[u8], code, part: &str| {
        write(bytes);
        let output = assert_ends(&mut command(folder.path(), arguments), code);
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains(part), "{said}");
    };
    let refused = |bytes: &[u8], parts: &[&str]| {
        write(bytes);
        common::assert_refused(folder.path(), arguments, parts);
    };
    let whole = recording();
    replay(&whole, 0, "actuator frames replayed: equal");
    for at in [9, whole.len() / 2, whole.len() - 1] {
        let mut damaged = whole.clone();
        damaged[at] ^= 1;
        refused(&damaged, &["r.loop", "checksum"]);
    }
    refused(&whole[..whole.len() - 54], &["checksum"]);
    refused(&whole[..8], &["checksum"]);
    refused(b"time_s,duty\n", &["is not a recording"]);
    refused(b"", &["is not a recording"]);

    // Another command in the recording, with a correct checksum: only the command differs.
    let mut other = Recording::read(&whole).expect("it is whole");
    other.exchanges[300].from_ecu.duty_code ^= 1;
    let mut bytes = Vec::new();
    other.write(&mut bytes).expect("a buffer takes it");
    replay(&bytes, 1, "1 from 300");
}
