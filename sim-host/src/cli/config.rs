//! `sim-host config`: the complete configuration.

use super::options::ConfigOptions;
use super::outcome::Outcome;
use dynamics::config::{to_commented_toml, validate};

/// Print a complete, validated configuration as TOML. Names include units; comments give the
/// allowed values.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host config > vehicle.toml        # the paper's vehicle, to edit
  sim-host config --preset printed      # the equations as printed
  sim-host config --config vehicle.toml # validate a file and complete it")]
pub struct Arguments {
    #[command(flatten)]
    config: ConfigOptions,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let scenario = arguments.config.load()?;
    validate(&scenario)?;
    say!("{}", to_commented_toml(&scenario).trim_end());
    Ok(Outcome::Success)
}
