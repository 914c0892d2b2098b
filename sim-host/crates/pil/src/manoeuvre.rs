//! Manoeuvres: what driver and road do, and how good the sensors are, as files.
//!
//! A manoeuvre's file is a configuration like any other (a preset and what differs from it), with a table `[manoeuvre]` for
//! what the vehicle's parameters do not say. The dither's waveform, frequency and start are the configuration's; its amplitude
//! is the ECU's to choose.

use super::profile::{InvalidProfile, Profile};
use super::sensor::SensorSettings;
use super::servo_filter::ServoFilter;
use dynamics::config::{self, ConfigError};
use serde::Deserialize;
use shared_model::parameter::{Field, OutOfRange, ParameterSet};
use shared_model::{Real, Scenario};
use std::f64::consts::TAU;
use std::path::Path;
use toml::{Table, Value};

/// Key of the manoeuvre's own table in a file.
const TABLE: &str = "manoeuvre";
/// Keys of the configuration that a manoeuvre says itself.
const OWN: [(&str, &str); 2] = [("run", "wheel_speed_rpm"), ("steering", "motor_current_a")];
/// Range of the wheel speed, rpm, and of the current request, A: those of the scenario's own parameters.
pub(super) const SPEED_RANGE_RPM: (f64, f64) = (1.0, 1e5);
const CURRENT_RANGE_A: (f64, f64) = (-1000.0, 1000.0);

/// A sine of the driver's current request.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RequestSine {
    /// Amplitude, A.
    pub amplitude_a: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Time at which it sets in, at phase zero, s.
    pub start_time_s: f64,
}

impl RequestSine {
    /// Its share of the request at `time_s`, A.
    pub fn at(&self, time_s: f64) -> f64 {
        let since_s = time_s - self.start_time_s;
        if since_s <= 0.0 {
            return 0.0;
        }
        // By libm, so that every machine has the same bits.
        self.amplitude_a * Real::sin(TAU * (self.frequency_hz * since_s).fract())
    }
}

impl ParameterSet<f64> for RequestSine {
    const SECTION: &'static str = "manoeuvre.current_request_sine";
    const FIELDS: &'static [Field<Self, f64>] = &[
        Field {
            name: "amplitude_a",
            min: 0.0,
            max: CURRENT_RANGE_A.1,
            accessor: |p| &mut p.amplitude_a,
        },
        Field {
            name: "frequency_hz",
            min: 0.0,
            max: 1000.0,
            accessor: |p| &mut p.frequency_hz,
        },
        Field {
            name: "start_time_s",
            min: 0.0,
            max: 1e5,
            accessor: |p| &mut p.start_time_s,
        },
    ];
}

/// A manoeuvre.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manoeuvre {
    /// Name, for headings.
    pub name: String,
    /// Wheel speed N over time, rpm, from 1 to 100000.
    pub wheel_speed_rpm: Profile,
    /// Motor current that the driver asks for over time, A, from -1000 to 1000.
    pub current_request_a: Profile,
    /// A sine on top of it.
    pub current_request_sine: Option<RequestSine>,
    /// The vehicle keeps to the wheel speed limit that the ECU demands, and changes its speed by no more than this, rpm/s, up
    /// to 1e6; it follows a steeper profile late. With 0, as without it, it follows its profile and heeds no limit.
    #[serde(default)]
    pub obey_speed_limit_rpm_per_s: f64,
    /// What is wrong with the sensors.
    #[serde(default)]
    pub sensors: SensorSettings,
    /// How the servo tells torque and dither apart.
    #[serde(default)]
    pub servo_filter: ServoFilter,
}

impl Manoeuvre {
    /// Constant speed and request, ideal sensors.
    pub fn constant(wheel_speed_rpm: f64, current_request_a: f64) -> Self {
        Self {
            name: format!("{wheel_speed_rpm} rpm, {current_request_a} A"),
            wheel_speed_rpm: Profile::constant(wheel_speed_rpm),
            current_request_a: Profile::constant(current_request_a),
            current_request_sine: None,
            obey_speed_limit_rpm_per_s: 0.0,
            sensors: SensorSettings::default(),
            servo_filter: ServoFilter::default(),
        }
    }

    /// Motor current that the driver asks for at `time_s`, A.
    pub fn current_request_at(&self, time_s: f64) -> f64 {
        let sine = self.current_request_sine;
        self.current_request_a.at(time_s) + sine.map_or(0.0, |sine| sine.at(time_s))
    }

    /// The scenario at the manoeuvre's initial speed and current request.
    pub fn begin(&self, scenario: &Scenario<f64>) -> Scenario<f64> {
        let mut scenario = *scenario;
        scenario.run.wheel_speed_rpm = self.wheel_speed_rpm.at(0.0);
        scenario.steering.motor_current_a = self.current_request_at(0.0);
        scenario
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first fault found.
    pub fn validate(&self) -> Result<(), InvalidManoeuvre> {
        let profile = |name, profile: &Profile, (min, max)| {
            let checked = profile.validate(min, max);
            checked.map_err(|source| InvalidManoeuvre::Profile { name, source })
        };
        profile("wheel_speed_rpm", &self.wheel_speed_rpm, SPEED_RANGE_RPM)?;
        profile(
            "current_request_a",
            &self.current_request_a,
            CURRENT_RANGE_A,
        )?;
        if let Some(sine) = self.current_request_sine {
            sine.validate()?;
        }
        validate_rate(self.obey_speed_limit_rpm_per_s)?;
        self.sensors.validate()?;
        Ok(self.servo_filter.validate()?)
    }
}

fn validate_rate(rpm_per_s: f64) -> Result<(), OutOfRange> {
    let (min, max) = (0.0, 1e6);
    if (min..=max).contains(&rpm_per_s) {
        return Ok(());
    }
    Err(OutOfRange {
        section: TABLE,
        name: "obey_speed_limit_rpm_per_s",
        value: rpm_per_s,
        min,
        max,
    })
}

/// Why a manoeuvre cannot be driven.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidManoeuvre {
    /// A number is not finite or not in its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A profile over time is none.
    #[error("manoeuvre.{name}, {source}")]
    Profile {
        /// Name in the file.
        name: &'static str,
        /// What is wrong.
        source: InvalidProfile,
    },
}

/// Why a manoeuvre's file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ManoeuvreError {
    /// The file, or what it says of the scenario.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The file has no manoeuvre.
    #[error("no table [{TABLE}]: must be there beside the configuration")]
    Missing,
    /// The manoeuvre's table has an unknown key, lacks one, or has a value of the wrong kind.
    #[error("[{TABLE}]: {0}")]
    Table(#[source] Box<toml::de::Error>),
    /// A key of the configuration that the manoeuvre says itself.
    #[error("{section}.{name}: must be left out, the manoeuvre's profile says it")]
    SaidTwice {
        /// The key's table.
        section: &'static str,
        /// The key.
        name: &'static str,
    },
    /// The manoeuvre cannot be driven.
    #[error(transparent)]
    Invalid(#[from] InvalidManoeuvre),
}

/// Reads a manoeuvre's file: the scenario at the manoeuvre's start, and the manoeuvre, both checked.
///
/// # Errors
/// If the file cannot be read, has an unknown key or lacks one, or a number is not in its range.
pub fn load(path: &Path) -> Result<(Scenario<f64>, Manoeuvre), ManoeuvreError> {
    parse(config::read(path)?)
}

/// Reads the text of a manoeuvre's file, as [`load`] does.
///
/// # Errors
/// As [`load`].
pub fn from_text(text: &str) -> Result<(Scenario<f64>, Manoeuvre), ManoeuvreError> {
    let file = text.parse::<Table>();
    parse(file.map_err(|error| ManoeuvreError::Table(Box::new(error)))?)
}

fn parse(mut file: Table) -> Result<(Scenario<f64>, Manoeuvre), ManoeuvreError> {
    let own = file.remove(TABLE).ok_or(ManoeuvreError::Missing)?;
    let manoeuvre: Manoeuvre = own
        .try_into()
        .map_err(|error| ManoeuvreError::Table(Box::new(error)))?;
    manoeuvre.validate()?;
    for (section, name) in OWN {
        if file
            .get(section)
            .and_then(|table: &Value| table.get(name))
            .is_some()
        {
            return Err(ManoeuvreError::SaidTwice { section, name });
        }
    }
    let scenario = manoeuvre.begin(&config::over_preset(file, None)?);
    config::validate(&scenario)?;
    Ok((scenario, manoeuvre))
}
