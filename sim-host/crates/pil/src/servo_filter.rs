//! What of the servo's voltage turns the motor, and what shakes it.

use shared_model::parameter::{Field, ParameterSet};

/// Parameters of the servo's separation of torque and dither. The paper has none; these are assumed.
///
/// A low corner keeps the square wave square, a high one keeps the driver out of the dither. Measured at a PWM of 10 kHz
/// (gains, shares in the torque and leakage of the default by a test):
///
/// | corner, rad/s | 40 | 100 (default) | 200 |
/// |---|---|---|---|
/// | square of 2000 rad/s: rms gain | 0.9998 | 0.9990 | 0.9958 |
/// | its droop about the mean, either way | 3.7 % | 8.7 % | 16.5 % |
/// | its greatest share in the torque's voltage | 3.7 % | 8.7 % | 16.5 % |
/// | sine of 4000 rad/s: rms gain | 0.99995 | 0.9997 | 0.9988 |
/// | its greatest share in the torque's voltage | 1.0 % | 2.5 % | 4.9 % |
/// | swing of the yaw rate at 1750 rpm, by the filter: square of 0.1 V | -0.12 % | -0.03 % | +0.37 % |
/// | the same: sine of 1.0 V | +0.01 % | +0.07 % | +0.28 % |
/// | leakage of a ramp of 10 A/s (3 V/s) into the dither | 75 mV | 30 mV | 15 mV |
///
/// The swing is that of the smoothed yaw rate against a corner of 1 rad/s. A step leaks whole at any corner, and fades with the
/// corner's time constant: a square dither's 1 rad/V makes 3 V an angle that only the limit keeps small.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoFilter {
    /// Corner of the low-pass for the torque and of the high-pass for the dither, rad/s.
    pub corner_rad_per_s: f64,
    /// Greatest angle that the dither adds ahead of the nonlinearities, rad: beyond it volts are no longer an angle. A step
    /// of the motor's voltage passes the high-pass whole, and would else be an angle of several rad.
    pub dither_limit_rad: f64,
}

impl Default for ServoFilter {
    fn default() -> Self {
        Self {
            corner_rad_per_s: 100.0,
            dither_limit_rad: 0.3,
        }
    }
}

impl ParameterSet<f64> for ServoFilter {
    const SECTION: &'static str = "manoeuvre.servo_filter";
    const FIELDS: &'static [Field<Self, f64>] = &[
        Field {
            name: "corner_rad_per_s",
            min: 1e-3,
            max: 1e5,
            accessor: |p| &mut p.corner_rad_per_s,
        },
        Field {
            name: "dither_limit_rad",
            min: 0.0,
            max: 10.0,
            accessor: |p| &mut p.dither_limit_rad,
        },
    ];
}

/// The two parts of the servo's voltage in one PWM period, each its mean over the period. Their sum is the voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parts {
    /// What drives the motor current, V.
    pub torque_v: f64,
    /// What acts as dither, V.
    pub dither_v: f64,
}

/// A first-order low-pass and its complement, exact for a voltage that is held over each period.
#[derive(Debug, Clone, Copy)]
pub struct Separation {
    voltage_v: f64,
    /// The high-pass's output at the period's end, V. Kept in place of the low-pass's, so that under a constant voltage it
    /// fades to nothing rather than to the voltage's last bits.
    dither_v: f64,
    /// What is left of it after a period.
    decay: f64,
    /// Its mean over a period, in units of its value at the period's start.
    mean: f64,
}

impl Separation {
    /// The separation at rest under `settled_at_v`.
    pub fn new(filter: &ServoFilter, period_s: f64, settled_at_v: f64) -> Self {
        let exponent = filter.corner_rad_per_s * period_s;
        Self {
            voltage_v: settled_at_v,
            dither_v: 0.0,
            decay: (-exponent).exp(),
            mean: -(-exponent).exp_m1() / exponent,
        }
    }

    /// One period under `voltage_v`.
    pub fn step(&mut self, voltage_v: f64) -> Parts {
        let start_v = self.dither_v + (voltage_v - self.voltage_v);
        self.voltage_v = voltage_v;
        self.dither_v = start_v * self.decay;
        let dither_v = start_v * self.mean;
        Parts {
            torque_v: voltage_v - dither_v,
            dither_v,
        }
    }
}
