//! The compiler's targets beside the host, and whether a compiler supports one.

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

use crate::workspace;

/// A target and the libraries that programs for it need.
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// Its libraries, where they are built from source.
    pub libraries: &'static str,
    /// Name in rustup of a toolchain made for it from Debian's packages.
    pub debian_toolchain: &'static str,
    /// Folder of that toolchain.
    pub debian_folder: &'static str,
    /// Compiles and links only where these libraries and a linker are there.
    empty_program: &'static str,
}

/// The target of a Cortex-M4F and M7.
pub const FIRMWARE: Target = Target {
    name: "thumbv7em-none-eabihf",
    libraries: "core,alloc",
    debian_toolchain: "dithersteer-thumb",
    debian_folder: "debian-thumb",
    empty_program: "#![no_std] #![no_main]
#[panic_handler] fn panic(_: &core::panic::PanicInfo) -> ! { loop {} }
#[unsafe(no_mangle)] extern \"C\" fn _start() -> ! { loop {} }",
};

/// The target of a browser.
pub const BROWSER: Target = Target {
    name: "wasm32-unknown-unknown",
    libraries: "std,panic_abort",
    debian_toolchain: "dithersteer-wasm",
    debian_folder: "debian-wasm",
    empty_program: "fn main() {}",
};

/// Whether a compiler builds and links an empty program for the target.
pub fn builds(target: &Target, mut rustc: Command) -> Result<bool> {
    let folder = workspace::target_dir()?.join("xtask");
    fs::create_dir_all(&folder).with_context(|| format!("cannot write to {}", folder.display()))?;
    rustc
        .args([
            "--target",
            target.name,
            "--edition=2024",
            "-Cpanic=abort",
            "-",
            "-o",
        ])
        .arg(folder.join(format!("probe-{}", target.name)));
    let Ok(mut child) = rustc
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
    else {
        return Ok(false);
    };
    // A rustup without that toolchain reads nothing; its exit status is the answer.
    let _ = child
        .stdin
        .take()
        .expect("stdin is piped")
        .write_all(target.empty_program.as_bytes());
    Ok(child.wait()?.success())
}
