//! Compiles the C sources and links them into the image.

use std::env;
use std::path::PathBuf;
use std::process::Command;

const C_COMPILER: &str = "arm-none-eabi-gcc";
/// Single precision in hardware, and no multiplication contracted with an addition: bits as in
/// Rust.
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

fn main() {
    println!("cargo:rerun-if-changed=c");
    println!("cargo:rerun-if-changed=../../memory.x");
    if env::var_os("CARGO_FEATURE_GCC").is_none() {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for unit in ["model", "pwm", "control"] {
        let object = out.join(unit).with_extension("o");
        let compiled = Command::new(C_COMPILER)
            .args(C_FLAGS)
            .args(["-c", &format!("c/{unit}.c"), "-o"])
            .arg(&object)
            .status();
        match compiled {
            Ok(status) if status.success() => {
                println!("cargo:rustc-link-arg-bins={}", object.display());
            }
            Ok(status) => println!("cargo::error={C_COMPILER} failed on {unit}.c: {status}"),
            Err(error) => println!("cargo::error={C_COMPILER} does not start: {error}"),
        }
    }
    // The board's memory map is in the link path of the firmware's library.
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    // Without a level at build time, defmt drops everything below errors.
    println!("cargo:rustc-env=DEFMT_LOG=info");
}
