//! Manual pages and completions of a release: `cargo test --package sim-host --features manuals --test
//! manuals`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn manuals(folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sim-host"))
        .arg("manuals")
        .arg(folder)
        .output()
        .expect("it starts")
}

#[test]
fn each_command_has_a_page_and_the_shells_complete_it() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let output = manuals(folder.path());
    assert!(output.status.success(), "{output:?}");
    let read = |name: &str| {
        fs::read_to_string(folder.path().join(name))
            .unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    for command in ["verify", "pil", "firmware-image", "fmu", "map-merge"] {
        assert!(
            read(&format!("man1/sim-host-{command}.1")).contains(".SH OPTIONS"),
            "{command}"
        );
    }
    assert!(read("man1/sim-host.1").contains("sim\\-host"));
    for file in ["sim-host.bash", "_sim-host", "sim-host.fish"] {
        let completions = read(&format!("completions/{file}"));
        assert!(
            completions.contains("reproduce") && completions.contains("sim-host"),
            "{file}"
        );
    }
}

#[test]
fn a_file_in_place_of_the_folder_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let file = folder.path().join("file");
    fs::write(&file, "kept").expect("it can be written");
    let output = manuals(&file);
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("cannot make the folder"), "{message}");
    assert_eq!(fs::read_to_string(&file).expect("it is there"), "kept");
}
