//! The sensors: resolution, noise and delay.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};
use shared_model::parameter::{Field, OutOfRange, ParameterSet};
use shared_model::signal::Measurement;
use std::collections::VecDeque;

/// Maximum delay of a measurement, control ticks.
pub const MAX_DELAY_TICKS: usize = 100;

/// One value per sensor, in its unit.
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
    const DESCRIPTIONS: &'static [(&'static str, &'static str)] = &[
        ("wheel_speed_rpm", "Of the wheel speed, rpm."),
        ("yaw_rate_rad_per_s", "Of the yaw rate, rad/s."),
        ("steering_angle_rad", "Of the steering angle, rad."),
        ("steering_rate_rad_per_s", "Of the steering rate, rad/s."),
    ];
}

/// Errors of the sensors. By default the sensors are ideal.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorSettings {
    /// Resolution: a sensor rounds to multiples of it; 0 means no rounding.
    pub resolution: PerSensor,
    /// Standard deviation of the white Gaussian noise before rounding.
    pub noise: PerSensor,
    /// Delay of the whole measurement, control ticks, up to 100. The first measurement is repeated
    /// until then.
    pub delay_ticks: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl SensorSettings {
    /// Checks every number.
    ///
    /// # Errors
    /// The first number that is out of range.
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
/// let measured = [0.6, 1.1, 1.6].map(|rate| sensors.sample(&truth(rate)).yaw_rate_rad_per_s);
/// assert_eq!(measured, [0.5, 0.5, 1.0]);
/// ```
#[derive(Debug, Clone)]
pub struct Sensors {
    settings: SensorSettings,
    generator: Pcg64Mcg,
    /// Delayed measurements, the oldest first.
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

    /// The measurement that the ECU receives at a control tick with the true values `truth`. The
    /// driver's request has the same delay, but neither noise nor rounding.
    pub fn sample(&mut self, truth: &Measurement<f64>) -> Measurement<f32> {
        let now = self.measure(truth).map(&to_f32);
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
            // Drawn for ideal sensors too, so that the noise of one sensor does not depend on that
            // of another.
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

/// Rounds to f32; a subnormal result becomes 0, because no sensor resolves it.
fn to_f32(value: f64) -> f32 {
    let rounded = value as f32;
    if rounded.is_subnormal() { 0.0 } else { rounded }
}
