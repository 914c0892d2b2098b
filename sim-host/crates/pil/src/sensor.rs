//! The sensors: what of the vehicle's motion reaches the ECU.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};
use shared_model::parameter::{Field, OutOfRange, ParameterSet};
use shared_model::signal::Measurement;
use std::collections::VecDeque;

/// Most control ticks that a measurement may be late.
const MAX_DELAY_TICKS: usize = 100;

/// One number for each sensor, in its unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PerSensor {
    /// Of the wheel speed, rpm.
    pub wheel_speed_rpm: f64,
    /// Of the yaw rate, rad/s.
    pub yaw_rate_rad_per_s: f64,
    /// Of the steering angle, rad.
    pub steering_angle_rad: f64,
    /// Of the steering rate, rad/s.
    pub steering_rate_rad_per_s: f64,
}

impl ParameterSet<f64> for PerSensor {
    const SECTION: &'static str = "manoeuvre.sensors";
    const FIELDS: &'static [Field<Self, f64>] = &[
        Field {
            name: "wheel_speed_rpm",
            min: 0.0,
            max: 1e5,
            accessor: |p| &mut p.wheel_speed_rpm,
        },
        Field {
            name: "yaw_rate_rad_per_s",
            min: 0.0,
            max: 100.0,
            accessor: |p| &mut p.yaw_rate_rad_per_s,
        },
        Field {
            name: "steering_angle_rad",
            min: 0.0,
            max: 10.0,
            accessor: |p| &mut p.steering_angle_rad,
        },
        Field {
            name: "steering_rate_rad_per_s",
            min: 0.0,
            max: 1000.0,
            accessor: |p| &mut p.steering_rate_rad_per_s,
        },
    ];
}

/// What is wrong with the sensors. By default nothing: they are ideal.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorSettings {
    /// Resolution: the step to whose multiples a sensor rounds; 0 rounds nothing.
    pub resolution: PerSensor,
    /// Standard deviation of the white, normally distributed noise ahead of that rounding.
    pub noise: PerSensor,
    /// Control ticks by which the whole measurement is late, up to 100. The first one is repeated until then.
    pub delay_ticks: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl SensorSettings {
    /// Checks every number.
    ///
    /// # Errors
    /// The first that is not in its range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        self.resolution
            .validate_as("manoeuvre.sensors.resolution")?;
        self.noise.validate_as("manoeuvre.sensors.noise")?;
        if self.delay_ticks <= MAX_DELAY_TICKS {
            return Ok(());
        }
        Err(OutOfRange {
            section: PerSensor::SECTION,
            name: "delay_ticks",
            value: self.delay_ticks as f64,
            min: 0.0,
            max: MAX_DELAY_TICKS as f64,
        })
    }
}

/// The vehicle's sensors.
///
/// ```
/// use shared_model::signal::Measurement;
/// use pil::sensor::{SensorSettings, Sensors};
/// let mut settings = SensorSettings::default();
/// settings.resolution.yaw_rate_rad_per_s = 0.25;
/// settings.delay_ticks = 1;
/// let mut sensors = Sensors::new(&settings);
/// let truth = |yaw_rate_rad_per_s| Measurement {
///     wheel_speed_rpm: 1750.0,
///     yaw_rate_rad_per_s,
///     steering_angle_rad: 0.1,
///     steering_rate_rad_per_s: 0.0,
///     current_request_a: 10.0,
/// };
/// let told = [0.6, 1.1, 1.6].map(|rate| sensors.sample(&truth(rate)).yaw_rate_rad_per_s);
/// assert_eq!(told, [0.5, 0.5, 1.0]);
/// ```
#[derive(Debug, Clone)]
pub struct Sensors {
    settings: SensorSettings,
    generator: Pcg64Mcg,
    /// Measurements on their way, the oldest first.
    late: VecDeque<Measurement<f32>>,
}

impl Sensors {
    /// The sensors of these settings, which must be valid.
    pub fn new(settings: &SensorSettings) -> Self {
        Self {
            settings: *settings,
            generator: Pcg64Mcg::seed_from_u64(settings.seed),
            late: VecDeque::new(),
        }
    }

    /// What the ECU is told at a control tick at which `truth` is so. The driver's request is no sensor's: it is as late as the
    /// rest, but neither noisy nor rounded.
    pub fn sample(&mut self, truth: &Measurement<f64>) -> Measurement<f32> {
        let now = self.measure(truth).map(&as_told);
        if self.late.is_empty() {
            self.late.resize(self.settings.delay_ticks, now);
        }
        self.late.push_back(now);
        self.late.pop_front().unwrap_or(now)
    }

    fn measure(&mut self, truth: &Measurement<f64>) -> Measurement<f64> {
        let SensorSettings {
            resolution, noise, ..
        } = self.settings;
        let mut sense = |value, noise, resolution| {
            // Drawn for ideal sensors too, so that one sensor's noise does not depend on whether another has any.
            let normal: f64 = StandardNormal.sample(&mut self.generator);
            rounded(value + noise * normal, resolution)
        };
        Measurement {
            wheel_speed_rpm: sense(
                truth.wheel_speed_rpm,
                noise.wheel_speed_rpm,
                resolution.wheel_speed_rpm,
            ),
            yaw_rate_rad_per_s: sense(
                truth.yaw_rate_rad_per_s,
                noise.yaw_rate_rad_per_s,
                resolution.yaw_rate_rad_per_s,
            ),
            steering_angle_rad: sense(
                truth.steering_angle_rad,
                noise.steering_angle_rad,
                resolution.steering_angle_rad,
            ),
            steering_rate_rad_per_s: sense(
                truth.steering_rate_rad_per_s,
                noise.steering_rate_rad_per_s,
                resolution.steering_rate_rad_per_s,
            ),
            current_request_a: truth.current_request_a,
        }
    }
}

fn rounded(value: f64, resolution: f64) -> f64 {
    if resolution > 0.0 {
        (value / resolution).round() * resolution
    } else {
        value
    }
}

/// As a sensor tells it: no sensor has the numbers so near zero that f32 holds them with fewer digits.
fn as_told(value: f64) -> f32 {
    let told = value as f32;
    if told.is_subnormal() { 0.0 } else { told }
}
