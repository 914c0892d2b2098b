//! `sim-host firmware`: tools for an image of the firmware.

pub mod configure;
pub mod decode;
pub mod find;
pub mod image;
pub mod run;

use super::outcome::Outcome;
use clap::Subcommand;

/// Configure, analyse or run a firmware image, and decode its telemetry.
#[derive(Subcommand)]
pub enum Command {
    Image(image::Arguments),
    Run(run::Arguments),
    Decode(decode::Arguments),
    Configure(configure::Arguments),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Image(arguments) => image::run(arguments),
        Command::Run(arguments) => run::run(arguments),
        Command::Decode(arguments) => decode::run(arguments),
        Command::Configure(arguments) => configure::run(arguments),
    }
}
