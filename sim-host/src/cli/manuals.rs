//! `sim-host manuals`: manual pages and completions of the shells, for a release.

use super::outcome::Outcome;
use anyhow::Context;
use clap::{Args, Command};
use clap_complete::Shell;
use std::fs;
use std::path::PathBuf;

/// Write manual pages and completions of bash, zsh and fish.
#[derive(Args)]
#[command(after_help = "Examples:
  cargo run --release --package sim-host --features manuals -- manuals dist")]
pub struct Arguments {
    /// Folder in which `man1` and `completions` are written
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

pub fn run(arguments: &Arguments, mut command: Command) -> anyhow::Result<Outcome> {
    let pages = arguments.folder.join("man1");
    let completions = arguments.folder.join("completions");
    for folder in [&pages, &completions] {
        fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    clap_mangen::generate_to(command.clone(), &pages)
        .with_context(|| format!("cannot write into {}", pages.display()))?;
    let name = command.get_name().to_owned();
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        clap_complete::generate_to(shell, &mut command, &name, &completions)
            .with_context(|| format!("cannot write into {}", completions.display()))?;
    }
    Ok(Outcome::Success)
}
