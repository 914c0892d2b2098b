//! The program finds the firmware's image from any working directory.

mod common;
mod installed;

use common::{assert_ends, assert_refused, folder};
use installed::copy_program;
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn an_image_that_the_option_names_must_be_there() {
    let place = folder();
    let arguments = ["pil", "--firmware", "missing.elf"];
    assert_refused(place.path(), arguments, &["missing.elf", "No such file"]);
}

/// A copy of the program in `place/bin`, as if it were installed there.
fn installed(place: &Path) -> Command {
    let bin = place.join("bin");
    fs::create_dir_all(&bin).expect("a folder can be made");
    let program = bin.join("sim-host");
    copy_program(&program);
    let mut command = Command::new(program);
    command
        .args(["pil", "--time", "1"])
        .current_dir(place)
        .env_remove("DITHERSTEER_FIRMWARE");
    command
}

/// A file that is no image, so that the error names which one was taken.
fn put(file: &Path) {
    fs::create_dir_all(file.parent().expect("it is in a folder")).expect("a folder can be made");
    fs::write(file, "no image").expect("a file can be written");
}

fn refusal(command: &mut Command) -> String {
    let output = assert_ends(command, 2);
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_image_is_found_beside_the_program_in_its_checkout_or_in_the_working_directory() {
    let place = folder();
    let place = place.path();
    let nowhere = refusal(&mut installed(place));
    for part in [
        "no firmware image",
        "bin/firmware/bench",
        "cargo xtask firmware",
        "--firmware",
    ] {
        assert!(nowhere.contains(part), "{nowhere} lacks {part:?}");
    }
    // The later ones take precedence over the earlier ones.
    for built in [
        "target/thumbv7em-none-eabihf/firmware",
        "thumbv7em-none-eabihf/firmware",
        "bin/firmware",
    ] {
        put(&place.join(built).join("bench"));
        let taken = refusal(&mut installed(place));
        assert!(
            taken.contains(&format!("{built}/bench is not an ELF file")),
            "{taken}"
        );
    }
    let uart = refusal(installed(place).args(["--link", "uart"]));
    assert!(uart.contains("bin/firmware/ecu"), "{uart}");
}

#[test]
fn the_variable_names_the_only_folder_and_the_option_the_image() {
    let place = folder();
    let place = place.path();
    put(&place.join("bin/firmware/bench"));
    let mut command = installed(place);
    command.env("DITHERSTEER_FIRMWARE", place.join("images"));
    let missing = refusal(&mut command);
    assert!(missing.contains("there is no "), "{missing}");
    assert!(missing.contains("images/bench;"), "{missing}");
    put(&place.join("images/bench"));
    let taken = refusal(&mut command);
    assert!(taken.contains("images/bench is not an ELF file"), "{taken}");
    put(&place.join("own.elf"));
    let own = refusal(command.args(["--firmware", "own.elf"]));
    assert!(own.contains("own.elf is not an ELF file"), "{own}");
    // Empty is as good as not set.
    let empty = refusal(installed(place).env("DITHERSTEER_FIRMWARE", ""));
    assert!(
        empty.contains("bin/firmware/bench is not an ELF file"),
        "{empty}"
    );
}
