//! Manoeuvres as files: driver, wheel speed and sensors.
//!
//! A manoeuvre's file is a configuration (a preset and the parameters that differ from it) with an
//! additional table `[manoeuvre]`. The configuration gives the dither's waveform, frequency and
//! start; the ECU chooses its amplitude.

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

/// Key of the manoeuvre's table in a file.
const TABLE: &str = "manoeuvre";
/// Keys of the configuration that the manoeuvre's profiles replace.
const OWN: [(&str, &str); 2] = [("run", "wheel_speed_rpm"), ("steering", "motor_current_a")];
/// Ranges of the wheel speed (rpm) and the current request (A), equal to those of the scenario's
/// parameters.
pub const SPEED_RANGE_RPM: (f64, f64) = (1.0, 1e5);
/// See [`SPEED_RANGE_RPM`].
pub const CURRENT_RANGE_A: (f64, f64) = (-1000.0, 1000.0);
/// Range of the greatest rate of change of the wheel speed, rpm/s.
pub const SPEED_RATE_RANGE_RPM_PER_S: (f64, f64) = (0.0, 1e6);

/// A sine of the driver's current request.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RequestSine {
    /// Amplitude, A.
    pub amplitude_a: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Start time, at phase zero, s.
    pub start_time_s: f64,
}

impl RequestSine {
    /// Its contribution to the request at `time_s`, A.
    pub fn at(&self, time_s: f64) -> f64 {
        let since_s = time_s - self.start_time_s;
        if since_s <= 0.0 {
            return 0.0;
        }
        // From libm, which gives the same bits on every machine.
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
    const DESCRIPTIONS: &'static [(&'static str, &'static str)] = &[
        ("amplitude_a", "Amplitude, A."),
        ("frequency_hz", "Frequency, Hz."),
        ("start_time_s", "Start time, at phase zero, s."),
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
    /// Motor current that the driver requests over time, A, from -1000 to 1000.
    pub current_request_a: Profile,
    /// A sine added to it.
    pub current_request_sine: Option<RequestSine>,
    /// Greatest rate of change of the wheel speed, rpm/s, up to 1e6, for a vehicle that obeys the
    /// wheel speed limit of the ECU; it follows a steeper profile with a lag. With 0 (the
    /// default) the vehicle follows its profile and ignores the limit.
    #[serde(default)]
    pub obey_speed_limit_rpm_per_s: f64,
    /// Errors of the sensors.
    #[serde(default)]
    pub sensors: SensorSettings,
    /// The servo's separation of torque and dither.
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

    /// Motor current that the driver requests at `time_s`, A.
    pub(crate) fn current_request_at(&self, time_s: f64) -> f64 {
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
    /// The first invalid number.
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
    let (min, max) = SPEED_RATE_RANGE_RPM_PER_S;
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

/// An invalid manoeuvre.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidManoeuvre {
    /// A number is not finite or not in its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A profile over time is invalid.
    #[error("manoeuvre.{name}, {source}")]
    Profile {
        /// Name in the file.
        name: &'static str,
        /// What is wrong.
        source: InvalidProfile,
    },
}

/// An error of reading a manoeuvre's file.
#[derive(Debug, thiserror::Error)]
pub enum ManoeuvreError {
    /// The file or its scenario is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The file has no manoeuvre.
    #[error(
        "no table [{TABLE}]: a manoeuvre's file must contain one in addition to the configuration"
    )]
    Missing,
    /// The manoeuvre's table has an unknown or missing key, or a value of the wrong type.
    #[error("[{TABLE}]: {0}")]
    Table(#[source] Box<toml::de::Error>),
    /// A key of the configuration that the manoeuvre's profile replaces.
    #[error("{section}.{name}: must be omitted, because the manoeuvre's profile gives it")]
    GivenTwice {
        /// The key's table.
        section: &'static str,
        /// The key.
        name: &'static str,
    },
    /// The manoeuvre is invalid.
    #[error(transparent)]
    Invalid(#[from] InvalidManoeuvre),
}

/// Reads a manoeuvre's file: the scenario at the manoeuvre's start, and the manoeuvre, both
/// validated.
///
/// # Errors
/// If the file cannot be read, has an unknown or missing key, or a number is out of range.
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
            return Err(ManoeuvreError::GivenTwice { section, name });
        }
    }
    let scenario = manoeuvre.begin(&config::over_preset(file, None)?);
    config::validate(&scenario)?;
    Ok((scenario, manoeuvre))
}
