//! Options shared by several subcommands: the scenario's parameters, and time-outs.

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

/// Source of a scenario's parameters.
#[derive(Args)]
pub struct ConfigOptions {
    /// Preset: `reconstruction` (the reading that reproduces the paper) or `printed` (the
    /// equations as printed)
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// TOML file with parameters that replace the preset's; `sim-host config` prints a complete
    /// file
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

    /// The input file, if any.
    pub fn input(&self) -> Option<Named<'_>> {
        named("--config", &self.config)
    }
}

/// The scenario of a file. Reports the parameters that differ from the paper's, and a file without
/// parameters.
pub fn load_file(file: &Path, preset: Option<&str>) -> Result<Scenario<f64>, ConfigError> {
    let over = read(file)?;
    if sets_nothing(&over) {
        eprintln!(
            "warning: {} sets no parameter; all values are from the preset. `sim-host config` prints a complete file",
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

/// Whether a file is empty or has only empty sections.
pub fn sets_nothing(table: &toml::Table) -> bool {
    table
        .values()
        .all(|value| value.as_table().is_some_and(sets_nothing))
}

/// Advice for a trajectory that ends early.
pub fn advice(reason: Reason) -> &'static str {
    match reason {
        Reason::Diverges => {
            "Set B of Table 1 with the cubic tyre diverges, and so does a negative peak_n"
        }
        _ => "Raise run.control_rate_hz, and run.pwm_rate_hz with it",
    }
}

/// The most frequent parameters of a run.
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
    /// The validated scenario.
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

/// A scenario's parameters, as those of the paper and what differs from them.
pub fn parameters_in_words(scenario: &Scenario<f64>) -> String {
    match &differences(scenario)[..] {
        [] => "the paper's (preset `reconstruction`)".to_owned(),
        differences => format!("the paper's but for {}", differences.join(", ")),
    }
}
