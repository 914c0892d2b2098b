//! `cargo xtask doctor`: required tools, installed tools, steps of set-up.

use anyhow::{Result, bail};

use crate::setup::{browser, probe, python, qemu, slurm, target};
use crate::{rustup, workspace};

/// A required tool.
struct Item {
    need: String,
    /// The installed version, or else the steps that install it.
    state: Result<String, String>,
}

/// Prints the table; an error if something is missing.
pub fn run() -> Result<()> {
    let mut items = vec![
        toolchain()?,
        compiler_target(&probe::FIRMWARE)?,
        compiler_target(&probe::BROWSER)?,
        qemu(),
        runner()?,
        python()?,
        browser()?,
    ];
    if slurm::is_usable() {
        items.push(slurm());
    }
    let width = items
        .iter()
        .map(|item| item.need.len())
        .max()
        .unwrap_or_default();
    for Item { need, state } in &items {
        match state {
            Ok(found) => println!("ok       {need:width$}  {found}"),
            Err(cure) => println!("MISSING  {need:width$}  {cure}"),
        }
    }
    let missing = items.iter().filter(|item| item.state.is_err()).count();
    if missing > 0 {
        bail!(
            "{missing} of {} missing: run `cargo xtask setup`",
            items.len()
        );
    }
    println!("everything is there");
    Ok(())
}

fn toolchain() -> Result<Item> {
    let pinned = workspace::pinned_channel()?;
    let found = rustup::rustc_version(&pinned);
    let cure = || match rustup::rustup() {
        Ok(_) => format!("not by set-up: type `rustup toolchain install {pinned}`"),
        Err(error) => error.to_string(),
    };
    Ok(Item {
        need: format!("Rust {pinned}"),
        state: found.ok_or_else(cure),
    })
}

fn compiler_target(target: &probe::Target) -> Result<Item> {
    let pinned = workspace::pinned_channel()?;
    let state = if rustup::rustc_version(&pinned).is_none() {
        Err(format!("needs Rust {pinned} first"))
    } else {
        match target::toolchain(target, &pinned)? {
            Some(toolchain) => Ok(format!("builds with toolchain {toolchain}")),
            None => Err(format!("set-up would: {}", target::plan(target, &pinned)?)),
        }
    };
    Ok(Item {
        need: target.name.to_owned(),
        state,
    })
}

fn qemu() -> Item {
    let state = match qemu::found() {
        Some((path, version)) => Ok(format!("{version}, {}", path.display())),
        None => Err(qemu::plan()),
    };
    Item {
        need: qemu::PROGRAM.to_owned(),
        state,
    }
}

fn runner() -> Result<Item> {
    let path = workspace::sim_host()?;
    let found = path.is_file().then(|| path.display().to_string());
    let cure = || "set-up would: `cargo build --release --package sim-host`".to_owned();
    Ok(Item {
        need: "runner sim-host".to_owned(),
        state: found.ok_or_else(cure),
    })
}

fn python() -> Result<Item> {
    let state = match python::found()? {
        Some((path, version)) => Ok(format!("{version}, {}", path.display())),
        None => Err(python::plan()?),
    };
    Ok(Item {
        need: "Python packages of the tests".to_owned(),
        state,
    })
}

fn browser() -> Result<Item> {
    let state = match browser::found()? {
        Some(found) => Ok(found.to_string()),
        None => Err(browser::plan()),
    };
    Ok(Item {
        need: "browser of the page's test".to_owned(),
        state,
    })
}

fn slurm() -> Item {
    Item {
        need: "Slurm of the cluster's test".to_owned(),
        state: slurm::found().ok_or_else(slurm::plan),
    }
}
