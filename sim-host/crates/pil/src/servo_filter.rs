//! Separation of the servo's voltage into torque and dither.

use shared_model::parameter::{Field, ParameterSet};

/// Parameters of the separation of torque and dither. The paper gives none; these are assumptions.
///
/// A low corner frequency preserves the square wave, a high one reduces leakage of the driver's
/// request into the dither. Values at a PWM rate of 10 kHz (a test checks gains, torque shares and
/// leakage of the default):
///
/// | corner, rad/s | 40 | 100 (default) | 200 |
/// |---|---|---|---|
/// | square of 2000 rad/s: rms gain | 0.9998 | 0.9990 | 0.9958 |
/// | its droop about the mean, in both directions | 3.7 % | 8.7 % | 16.5 % |
/// | its greatest share in the torque's voltage | 3.7 % | 8.7 % | 16.5 % |
/// | sine of 4000 rad/s: rms gain | 0.99995 | 0.9997 | 0.9988 |
/// | its greatest share in the torque's voltage | 1.0 % | 2.5 % | 4.9 % |
/// | effect on the peak-to-peak yaw rate at 1750 rpm: square of 0.1 V | -0.12 % | -0.03 % | +0.37 % |
/// | the same: sine of 1.0 V | +0.01 % | +0.07 % | +0.28 % |
/// | leakage of a ramp of 10 A/s (3 V/s) into the dither | 75 mV | 30 mV | 15 mV |
///
/// The peak-to-peak value is that of the smoothed yaw rate, relative to a corner of 1 rad/s. A step
/// leaks completely at any corner and decays with its time constant. At the 1 rad/V of a square
/// dither, a step of 3 V is an angle that only the limit keeps small.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoFilter {
    /// Corner of the low-pass for the torque and of the high-pass for the dither, rad/s.
    pub corner_rad_per_s: f64,
    /// Limit of the angle that the dither adds to the argument of the nonlinearities, rad. A step
    /// of the motor's voltage passes the high-pass completely, and would be an angle of
    /// several rad without the limit.
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
    const DESCRIPTIONS: &'static [(&'static str, &'static str)] = &[
        (
            "corner_rad_per_s",
            "Corner of the low-pass for the torque and of the high-pass for the dither, rad/s.",
        ),
        (
            "dither_limit_rad",
            "Limit of the angle that the dither adds to the argument of the nonlinearities, rad.",
        ),
    ];
}

/// Both parts of the servo's voltage, as means over a PWM period. Their sum is the voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parts {
    /// The part that drives the motor current, V.
    pub torque_v: f64,
    /// The part that acts as dither, V.
    pub dither_v: f64,
}

/// A first-order low-pass and its complement, exact for a voltage that is constant over each
/// period.
#[derive(Debug, Clone, Copy)]
pub struct Separation {
    voltage_v: f64,
    /// Output of the high-pass at the end of the period, V. Stored instead of the low-pass's
    /// output, so that it decays to zero under a constant voltage, without a rounding residue.
    dither_v: f64,
    /// Decay factor over a period.
    decay: f64,
    /// Its mean over a period, relative to its value at the start of the period.
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
