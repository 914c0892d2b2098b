//! Cargo and rustc of a chosen toolchain, through rustup.
//!
//! xtask itself was started by a cargo, which put its own toolchain and package into the
//! environment. The programs that it starts must not inherit that.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::{process, workspace};

/// rustup where its installer puts it, else on PATH.
fn program() -> Option<PathBuf> {
    let home = env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(env::home_dir()?.join(".cargo")));
    let usual = home.map(|home| home.join("bin").join("rustup"));
    usual
        .filter(|path| path.is_file())
        .or_else(|| process::find("rustup"))
}

/// A `rustup` command line.
pub fn rustup() -> Result<Command> {
    let program = program()
        .context("rustup is missing: install it (https://rustup.rs), then run this again")?;
    Ok(clean(Command::new(program)))
}

/// A toolchain's own program: unlike rustup's proxies, `rustup run` never downloads a toolchain.
pub fn tool(toolchain: &str, name: &str) -> Result<Command> {
    let mut command = rustup()?;
    command.args(["run", toolchain, name]);
    Ok(command)
}

/// A toolchain's cargo, with the target directory that xtask reports.
pub fn cargo(toolchain: &str) -> Result<Command> {
    let mut command = tool(toolchain, "cargo")?;
    command.current_dir(workspace::root());
    if env::var_os("CARGO_TARGET_DIR").is_some() {
        command.env("CARGO_TARGET_DIR", workspace::target_dir()?);
    }
    Ok(command)
}

/// The version line of a toolchain's rustc; `None` if the toolchain is not installed.
pub fn rustc_version(toolchain: &str) -> Option<String> {
    process::capture(tool(toolchain, "rustc").ok()?.arg("--version"))
}

/// The folder of a toolchain in rustup's home.
pub fn folder(toolchain: &str) -> Result<PathBuf> {
    let rustc = process::capture(rustup()?.args(["which", "--toolchain", toolchain, "rustc"]));
    let rustc =
        PathBuf::from(rustc.with_context(|| format!("rustup has no toolchain {toolchain}"))?);
    let folder = rustc.parent().and_then(Path::parent);
    Ok(folder
        .with_context(|| format!("{} is not inside a toolchain", rustc.display()))?
        .to_owned())
}

/// An error with the line to type unless the pinned toolchain is installed.
pub fn require_pinned() -> Result<String> {
    rustup()?;
    let pinned = workspace::pinned_channel()?;
    if rustc_version(&pinned).is_none() {
        bail!("Rust {pinned} is missing: run `rustup toolchain install {pinned}`, then this again");
    }
    Ok(pinned)
}

/// Removes the starting cargo's variables, and those of xtask's package, from a command's
/// environment.
fn clean(mut command: Command) -> Command {
    for (name, _) in env::vars_os() {
        if name.to_str().is_some_and(describes_xtask) {
            command.env_remove(name);
        }
    }
    command
}

fn describes_xtask(variable: &str) -> bool {
    matches!(variable, "CARGO" | "RUSTUP_TOOLCHAIN")
        || variable.starts_with("CARGO_MANIFEST_")
        || variable.starts_with("CARGO_PKG_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_cargos_own_variables_are_dropped() {
        for dropped in [
            "CARGO",
            "RUSTUP_TOOLCHAIN",
            "CARGO_MANIFEST_DIR",
            "CARGO_PKG_NAME",
        ] {
            assert!(describes_xtask(dropped), "{dropped}");
        }
        for kept in [
            "CARGO_HOME",
            "CARGO_TARGET_DIR",
            "CARGO_NET_OFFLINE",
            "RUSTUP_HOME",
            "RUSTUP_AUTO_INSTALL",
            "PATH",
        ] {
            assert!(!describes_xtask(kept), "{kept}");
        }
    }
}
