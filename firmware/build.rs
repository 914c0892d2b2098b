//! Puts the board's memory map where the linker finds it, and selects the linker scripts.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// Prefix of cargo's variable for a board whose feature is on.
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
    if env::var_os("CARGO_FEATURE_CAN").is_some()
        && !Path::new(&format!("src/board/{board}/can.rs")).exists()
    {
        println!(
            "cargo::error=the board {board} has no CAN: build without the feature `can`, or write src/board/{board}/can.rs"
        );
        return;
    }
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
    for image in ["ecu", "bench"] {
        println!("cargo:rustc-link-arg-bin={image}=-Tdefmt.x");
    }
    // The product's configuration in a section of its own.
    let script = "src/product/configuration.x";
    fs::copy(script, out.join("configuration.x")).expect("the script is readable");
    println!("cargo:rerun-if-changed={script}");
    println!("cargo:rustc-link-arg-bin=ecu=-Tconfiguration.x");
    // Without a level at build time, defmt drops everything below errors.
    println!("cargo:rustc-env=DEFMT_LOG=info");
}
