//! Where things are in this checkout.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// The checkout's root.
pub fn root() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask
        .parent()
        .expect("xtask lies in the workspace's root")
        .to_owned()
}

/// The firmware's package, which builds with its own `.cargo/config.toml`.
pub fn firmware() -> PathBuf {
    root().join("firmware")
}

/// Cargo's output folder: CARGO_TARGET_DIR, as seen from where xtask was started, or `target`.
pub fn target_dir() -> Result<PathBuf> {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(folder) => Ok(std::path::absolute(folder)?),
        None => Ok(root().join("target")),
    }
}

/// The host's program, which is also the runner of the firmware's folder.
pub fn sim_host() -> Result<PathBuf> {
    Ok(target_dir()?.join("release").join("sim-host"))
}

/// The toolchain that `rust-toolchain.toml` pins.
pub fn pinned_channel() -> Result<String> {
    let file = root().join("rust-toolchain.toml");
    let text =
        fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    channel(&text)
        .map(str::to_owned)
        .with_context(|| format!("{} has no line `channel = \"...\"`", file.display()))
}

/// `--locked` wherever there is a lock file: host and firmware must see the same versions.
pub fn locked() -> Option<&'static str> {
    root().join("Cargo.lock").exists().then_some("--locked")
}

/// The channel in the text of a `rust-toolchain.toml`.
fn channel(text: &str) -> Option<&str> {
    text.lines().find_map(|line| {
        let value = line
            .trim_start()
            .strip_prefix("channel")?
            .trim_start()
            .strip_prefix('=')?
            .trim_start();
        let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        value[1..].split_once(quote).map(|(channel, _)| channel)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channel_is_found() {
        assert_eq!(
            channel("# channel = \"0.1\"\n[toolchain]\nchannel = \"1.95.0\"\n"),
            Some("1.95.0")
        );
        assert_eq!(
            channel("[toolchain]\n  channel='1.95.0' # pinned\n"),
            Some("1.95.0")
        );
    }

    #[test]
    fn no_channel_is_no_channel() {
        assert_eq!(channel("[toolchain]\nprofile = \"minimal\"\n"), None);
        assert_eq!(channel("channel = 1.95\n"), None);
        assert_eq!(channel("channels = \"1.95\"\n"), None);
    }

    #[test]
    fn this_checkout_pins_a_channel() {
        assert!(!pinned_channel().unwrap().is_empty());
    }
}
