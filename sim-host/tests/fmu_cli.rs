//! `sim-host fmu`: bad input, and the place of the units' library.

mod common;
mod installed;

use common::{assert_ends, assert_refused, command, folder};
use fmu::archive::LIBRARY;
use installed::copy_program;
use std::fs;
use std::path::Path;
use std::process::Command;

const PROGRAM: &str = env!("CARGO_BIN_EXE_sim-host");

#[test]
fn bad_units_configurations_and_libraries_are_refused() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("text"), "not a library").unwrap();
    // Only the ECU's own check finds this one.
    let text = "[controller]\nmotor_current_a = 900.0\n";
    fs::write(at.join("c.toml"), text).unwrap();
    for (arguments, part) in [
        ("fmu", "<UNIT>"),
        ("fmu plane --out x.fmu", "[possible values: ecu, vehicle]"),
        ("fmu ecu", "--out <FILE>"),
        ("fmu ecu --out x.fmu --library none", "cannot read none"),
        (
            "fmu ecu --out x.fmu --library text",
            "text is not libdithersteer_fmu.so of this version",
        ),
        (
            "fmu ecu --out ./text --library text --force",
            "are the same file",
        ),
        ("fmu ecu --out x.fmu --config none.toml", "none.toml"),
        (
            "fmu ecu --out x.fmu --config c.toml",
            "controller.motor_current_a = 900: must be a finite number from 0 to 15",
        ),
    ] {
        assert_refused(at, arguments.split(' '), &[part]);
    }
    assert!(!at.join("x.fmu").exists(), "nothing is written");
}

/// As a release has it, and without it.
#[test]
fn an_installed_program_finds_the_library_beside_it() {
    let folder = folder();
    let at = folder.path();
    let installed = at.join("sim-host");
    copy_program(&installed);
    let run = || {
        let mut command = Command::new(&installed);
        command.args(["fmu", "ecu", "--out", "installed.fmu"]);
        command.current_dir(at).output().expect("it starts")
    };
    let missing = run();
    let message = String::from_utf8_lossy(&missing.stderr);
    assert_eq!(missing.status.code(), Some(2), "{message}");
    for part in ["no shared library of the units", LIBRARY, "--library"] {
        assert!(message.contains(part), "{message}");
    }
    let built = Path::new(PROGRAM).with_file_name("deps").join(LIBRARY);
    fs::copy(built, at.join(LIBRARY)).unwrap();
    let found = run();
    assert!(
        found.status.success(),
        "{}",
        String::from_utf8_lossy(&found.stderr)
    );
    assert_ends(&mut command(at, ["fmu", "ecu", "--out", "built.fmu"]), 0);
    let read = |name| fs::read(at.join(name)).unwrap();
    assert!(read("installed.fmu") == read("built.fmu"));
}
