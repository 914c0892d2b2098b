//! Options that several subcommands share: the scenario's parameters, and time-outs.

use super::output::{Named, named};
use clap::Args;
use dynamics::config::{ConfigError, differences, over_preset, read, validate};
use dynamics::words::Short;
use engine::Reason;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::settings::Choice;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Where a scenario's parameters come from.
#[derive(Args)]
pub struct ConfigOptions {
    /// Preset: `reconstruction` (the reading that reproduces the paper) or `printed` (the equations as printed)
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// TOML file over the preset; `sim-host config` prints a complete one
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

impl ConfigOptions {
    /// The scenario.
    pub fn load(&self) -> Result<Scenario<f64>, ConfigError> {
        match &self.config {
            Some(file) => load_file(file, self.preset.as_deref()),
            None => over_preset(toml::Table::new(), self.preset.as_deref()),
        }
    }

    /// The file that is read, if any.
    pub fn input(&self) -> Option<Named<'_>> {
        named("--config", &self.config)
    }

    /// As they are given on a command line, each with a blank before it.
    pub fn words(&self) -> String {
        let preset = self.preset.iter().map(|name| format!(" --preset {name}"));
        let config = self.config.iter();
        let config = config.map(|file| format!(" --config {}", file.display()));
        preset.chain(config).collect()
    }
}

/// The scenario of a file. It is said in which parameters it differs from the paper's, and if the file holds none.
pub fn load_file(file: &Path, preset: Option<&str>) -> Result<Scenario<f64>, ConfigError> {
    let over = read(file)?;
    if sets_nothing(&over) {
        eprintln!(
            "warning: {} sets no parameter, so all are the preset's; `sim-host config` prints a complete file",
            file.display()
        );
    }
    let scenario = over_preset(over, preset)?;
    let differences = differences(&scenario);
    if differences.is_empty() {
        eprintln!("parameters: the paper's");
    } else {
        eprintln!(
            "parameters that differ from the paper's: {}",
            differences.join(", ")
        );
    }
    Ok(scenario)
}

/// Whether a file holds nothing, or sections with nothing in them.
pub fn sets_nothing(table: &toml::Table) -> bool {
    table
        .values()
        .all(|value| value.as_table().is_some_and(sets_nothing))
}

/// What to do about a motion that ends early.
pub fn advice(reason: Reason) -> &'static str {
    match reason {
        Reason::Diverges => {
            "Set B of Table 1 with the cubic tyre diverges, and so does a negative peak_n"
        }
        _ => "Raise run.control_rate_hz, and run.pwm_rate_hz with it",
    }
}

/// Parameters of a run that are set most often.
#[derive(Args)]
pub struct RunOptions {
    #[command(flatten)]
    pub config: ConfigOptions,
    /// Wheel speed, rpm
    #[arg(long, value_name = "RPM", allow_negative_numbers = true)]
    pub rpm: Option<f64>,
    /// Waveform of the dither: none, square or sine
    #[arg(long, value_name = "WAVEFORM", value_parser = waveform)]
    pub dither: Option<Waveform>,
    /// Amplitude of the dither, V
    #[arg(long, value_name = "VOLTS", allow_negative_numbers = true)]
    pub amplitude_v: Option<f64>,
    /// Length of the run, s
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub time: Option<f64>,
}

impl RunOptions {
    /// The scenario, checked.
    pub fn scenario(&self) -> Result<Scenario<f64>, ConfigError> {
        let mut scenario = self.config.load()?;
        let run = &mut scenario.run;
        run.wheel_speed_rpm = self.rpm.unwrap_or(run.wheel_speed_rpm);
        run.duration_s = self.time.unwrap_or(run.duration_s);
        let dither = &mut scenario.dither;
        dither.waveform = self.dither.unwrap_or(dither.waveform);
        dither.amplitude_v = self.amplitude_v.unwrap_or(dither.amplitude_v);
        validate(&scenario)?;
        Ok(scenario)
    }
}

pub fn waveform(name: &str) -> Result<Waveform, String> {
    let names = || Waveform::ALL.map(Waveform::name).join(", ");
    Waveform::from_name(name).ok_or_else(|| format!("must be one of {}", names()))
}

/// Least and greatest time-out, s.
const TIME_OUTS_S: std::ops::RangeInclusive<f64> = 0.1..=86_400.0;

pub fn time_out(seconds: f64) -> anyhow::Result<Duration> {
    anyhow::ensure!(
        TIME_OUTS_S.contains(&seconds),
        "--time-out {}: must be from {} to {} s",
        Short(seconds),
        TIME_OUTS_S.start(),
        TIME_OUTS_S.end()
    );
    Ok(Duration::from_secs_f64(seconds))
}
