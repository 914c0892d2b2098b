//! The compiler's target for the firmware, and whether a compiler supports it.

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

use crate::workspace;

/// The target of a Cortex-M4F and M7.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// Compiles and links only where the target's core library and a linker are there.
const EMPTY_PROGRAM: &[u8] = b"#![no_std] #![no_main]
#[panic_handler] fn panic(_: &core::panic::PanicInfo) -> ! { loop {} }
#[unsafe(no_mangle)] extern \"C\" fn _start() -> ! { loop {} }";

/// Whether a compiler builds and links an empty program for the target.
pub fn builds(mut rustc: Command) -> Result<bool> {
    let folder = workspace::target_dir()?.join("xtask");
    fs::create_dir_all(&folder).with_context(|| format!("cannot write to {}", folder.display()))?;
    rustc
        .args([
            "--target",
            TARGET,
            "--edition=2024",
            "-Cpanic=abort",
            "-",
            "-o",
        ])
        .arg(folder.join("probe.elf"));
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
        .write_all(EMPTY_PROGRAM);
    Ok(child.wait()?.success())
}
