//! Puts the board's memory map where the linker finds it, and asks for the linker scripts.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// What cargo puts in front of the name of a board whose feature is on.
const BOARD_FEATURE: &str = "CARGO_FEATURE_BOARD_";

fn main() {
    let chosen = env::vars().filter_map(|(name, _)| {
        let board = name.strip_prefix(BOARD_FEATURE)?;
        Some(board.to_lowercase())
    });
    let chosen: Vec<String> = chosen.collect();
    let [board] = chosen.as_slice() else {
        println!(
            "cargo::error=choose exactly one board, not {chosen:?}: `--no-default-features --features board-NAME`"
        );
        return;
    };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let map = format!("src/board/{board}/memory.x");
    fs::copy(&map, out.join("board-memory.x")).expect("the board's memory map is readable");
    println!("cargo:rerun-if-changed={map}");
    println!("cargo:rerun-if-changed=../memory.x");
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    // Not for `panic-free`: defmt's script keeps its panic handler in the image, reachable or not.
    for image in ["ecu", "fault-drill", "cost"] {
        println!("cargo:rustc-link-arg-bin={image}=-Tdefmt.x");
    }
    if env::var_os("CARGO_FEATURE_C_TWIN").is_some() {
        build_twin(&out);
    }
    // Without a level at build time, defmt drops everything below errors.
    println!("cargo:rustc-env=DEFMT_LOG=info");
}

const C_COMPILER: &str = "arm-none-eabi-gcc";
/// Single precision in hardware, and no multiplication contracted with an addition: bits as in Rust.
const C_FLAGS: [&str; 10] = [
    "-std=c11",
    "-O3",
    "-mthumb",
    "-mcpu=cortex-m4",
    "-mfpu=fpv4-sp-d16",
    "-mfloat-abi=hard",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Werror",
];

/// Compiles the twin in C and links it into the image `cost`.
fn build_twin(out: &Path) {
    println!("cargo:rerun-if-changed=c-twin");
    for unit in ["model", "pwm", "control"] {
        let object = out.join(unit).with_extension("o");
        let compiled = Command::new(C_COMPILER)
            .args(C_FLAGS)
            .args(["-c", &format!("c-twin/{unit}.c"), "-o"])
            .arg(&object)
            .status();
        match compiled {
            Ok(status) if status.success() => {
                println!("cargo:rustc-link-arg-bin=cost={}", object.display());
            }
            Ok(status) => println!("cargo::error={C_COMPILER} failed on {unit}.c: {status}"),
            Err(error) => println!("cargo::error={C_COMPILER} does not start: {error}"),
        }
    }
}
