//! The compiler's target for the firmware: from rustup, or where rustup cannot download, from
//! Debian's packages.

use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::debian;
use super::probe::{TARGET, builds};
use crate::process::{self, Ended};
use crate::rustup;

/// rustup tries again for many minutes where downloads are blocked.
const RUSTUP_LIMIT: Duration = Duration::from_secs(90);

/// The toolchain that can build the firmware, the pinned one first.
pub fn toolchain(pinned: &str) -> Result<Option<String>> {
    for toolchain in [pinned, debian::TOOLCHAIN] {
        if has_target(toolchain)? {
            return Ok(Some(toolchain.to_owned()));
        }
    }
    Ok(None)
}

/// Makes sure that there is a toolchain that can build the firmware, and returns it.
pub fn ensure() -> Result<String> {
    let pinned = rustup::require_pinned()?;
    let toolchain = match toolchain(&pinned)? {
        Some(toolchain) => toolchain,
        None if add_through_rustup(&pinned)? => pinned,
        None => {
            debian::install(&pinned).with_context(|| missing(&pinned))?;
            if !has_target(debian::TOOLCHAIN)? {
                bail!(
                    "the toolchain {} does not build for {TARGET}; {}",
                    debian::TOOLCHAIN,
                    missing(&pinned)
                );
            }
            debian::TOOLCHAIN.to_owned()
        }
    };
    if toolchain == debian::TOOLCHAIN {
        debian::use_in_firmware_folder()?;
    }
    Ok(toolchain)
}

/// The steps of set-up for a missing target.
pub fn plan(pinned: &str) -> Result<String> {
    let debian = debian::plan();
    Ok(match is_linked(pinned)? {
        true => format!(
            "install {debian} ({pinned} only links to another toolchain, which stays as it is)"
        ),
        false => format!(
            "`{}`; where that cannot download, install {debian}",
            add_line(pinned)
        ),
    })
}

/// That the target is missing, with the line to type.
pub fn missing(pinned: &str) -> String {
    format!(
        "{TARGET} is missing: run `{}` where its downloads are reachable, then this again",
        add_line(pinned)
    )
}

fn add_line(pinned: &str) -> String {
    format!("rustup target add --toolchain {pinned} {TARGET}")
}

/// A toolchain whose folder is a link belongs to another name, or another owner: nothing is written
/// into it.
fn is_linked(pinned: &str) -> Result<bool> {
    Ok(rustup::folder(pinned)?.is_symlink())
}

fn add_through_rustup(pinned: &str) -> Result<bool> {
    if is_linked(pinned)? {
        println!("setup: rustup's {pinned} only links to another toolchain, which stays as it is");
        return Ok(false);
    }
    println!(
        "setup: adding {TARGET} to rustup's toolchain {pinned}, in {}",
        rustup::folder(pinned)?.display()
    );
    let mut command = rustup::rustup()?;
    // A blocked download is expected on some machines; rustup's own stack trace would not explain
    // it.
    command
        .args(["target", "add", "--toolchain", pinned, TARGET])
        .env_remove("RUST_BACKTRACE");
    match process::stream(&mut command, Some(RUSTUP_LIMIT))? {
        Ended::With(status) if status.success() => return has_target(pinned),
        Ended::With(status) => println!("setup: rustup ended with {status}"),
        Ended::TimedOut => println!(
            "setup: rustup was stopped after {} s",
            RUSTUP_LIMIT.as_secs()
        ),
    }
    Ok(false)
}

/// Whether a toolchain of rustup builds for the target.
fn has_target(toolchain: &str) -> Result<bool> {
    builds(rustup::tool(toolchain, "rustc")?)
}
