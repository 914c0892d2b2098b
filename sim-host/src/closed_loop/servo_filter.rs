//! What of the servo's voltage turns the motor, and what shakes it.

use shared_model::parameter::{Field, ParameterSet};

/// Parameters of the servo's separation of torque and dither. The paper has none; these are assumed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ServoFilter {
    /// Corner of the low-pass for the torque and of the high-pass for the dither, rad/s.
    pub corner_rad_per_s: f64,
}

impl Default for ServoFilter {
    fn default() -> Self {
        Self {
            corner_rad_per_s: 40.0,
        }
    }
}

impl ParameterSet<f64> for ServoFilter {
    const SECTION: &'static str = "manoeuvre.servo_filter";
    const FIELDS: &'static [Field<Self, f64>] = &[Field {
        name: "corner_rad_per_s",
        min: 1e-3,
        max: 1e5,
        place: |p| &mut p.corner_rad_per_s,
    }];
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
