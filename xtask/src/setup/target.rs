//! The compiler's targets beside the host: from rustup, or where rustup cannot download, from
//! Debian's packages.

use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::debian;
use super::probe::{Target, builds};
use crate::process::{self, Ended};
use crate::rustup;

/// rustup tries again for many minutes where downloads are blocked.
const RUSTUP_LIMIT: Duration = Duration::from_secs(90);

/// The toolchain that can build for the target, the pinned one first.
pub fn toolchain(target: &Target, pinned: &str) -> Result<Option<String>> {
    for toolchain in [pinned, target.debian_toolchain] {
        if has_target(target, toolchain)? {
            return Ok(Some(toolchain.to_owned()));
        }
    }
    Ok(None)
}

/// Makes sure that there is a toolchain that can build for the target, and returns it.
pub fn ensure(target: &Target) -> Result<String> {
    let pinned = rustup::require_pinned()?;
    if let Some(toolchain) = toolchain(target, &pinned)? {
        return Ok(toolchain);
    }
    if add_through_rustup(target, &pinned)? {
        return Ok(pinned);
    }
    debian::install(target, &pinned).with_context(|| missing(target, &pinned))?;
    let toolchain = target.debian_toolchain;
    if !has_target(target, toolchain)? {
        bail!(
            "the toolchain {toolchain} does not build for {}; {}",
            target.name,
            missing(target, &pinned)
        );
    }
    Ok(toolchain.to_owned())
}

/// Lets plain `cargo` in firmware/ use the toolchain that builds the firmware, where it is not the
/// pinned one.
pub fn use_for_firmware(toolchain: &str) -> Result<()> {
    if toolchain == rustup::require_pinned()? {
        return Ok(());
    }
    debian::use_in_firmware_folder(toolchain)
}

/// The steps of set-up for a missing target.
pub fn plan(target: &Target, pinned: &str) -> Result<String> {
    let debian = debian::plan(target);
    Ok(match is_linked(pinned)? {
        true => format!(
            "install {debian} ({pinned} only links to another toolchain, which stays as it is)"
        ),
        false => format!(
            "`{}`; where that cannot download, install {debian}",
            add_line(target, pinned)
        ),
    })
}

/// That the target is missing, with the line to type.
pub fn missing(target: &Target, pinned: &str) -> String {
    format!(
        "{} is missing: run `{}` where its downloads are reachable, then this again",
        target.name,
        add_line(target, pinned)
    )
}

fn add_line(target: &Target, pinned: &str) -> String {
    format!("rustup target add --toolchain {pinned} {}", target.name)
}

/// A toolchain whose folder is a link belongs to another name, or another owner: nothing is written
/// into it.
fn is_linked(pinned: &str) -> Result<bool> {
    Ok(rustup::folder(pinned)?.is_symlink())
}

fn add_through_rustup(target: &Target, pinned: &str) -> Result<bool> {
    if is_linked(pinned)? {
        println!("setup: rustup's {pinned} only links to another toolchain, which stays as it is");
        return Ok(false);
    }
    println!(
        "setup: adding {} to rustup's toolchain {pinned}, in {}",
        target.name,
        rustup::folder(pinned)?.display()
    );
    let mut command = rustup::rustup()?;
    // A blocked download is expected on some machines; rustup's own stack trace would not explain
    // it.
    command
        .args(["target", "add", "--toolchain", pinned, target.name])
        .env_remove("RUST_BACKTRACE");
    match process::stream(&mut command, Some(RUSTUP_LIMIT))? {
        Ended::With(status) if status.success() => return has_target(target, pinned),
        Ended::With(status) => println!("setup: rustup ended with {status}"),
        Ended::TimedOut => println!(
            "setup: rustup was stopped after {} s",
            RUSTUP_LIMIT.as_secs()
        ),
    }
    Ok(false)
}

/// Whether a toolchain of rustup builds for the target.
fn has_target(target: &Target, toolchain: &str) -> Result<bool> {
    builds(target, rustup::tool(toolchain, "rustc")?)
}
