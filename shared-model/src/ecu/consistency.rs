//! Consistency of controller and gate: the gate must pass the controller's commands. Checked once,
//! before the first tick, so that an inconsistent scenario is refused with the name of the number,
//! and not by a later safe state.

use crate::dither::Waveform;
use crate::ecu_schedule::Table;
use crate::parameter::OutOfRange;
use crate::{Real, Scenario};

/// Tolerance for the rounding of f32, relative; the gate's own limits have the same.
const ROUNDING: f64 = 1e-6;

/// Checks the numbers of a valid scenario against each other.
///
/// # Errors
/// The first inconsistent number, with the range that the others leave.
pub(super) fn check<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let gate = &scenario.gate;
    require(
        "gate",
        "safe_wheel_speed_rpm",
        gate.safe_wheel_speed_rpm,
        T::zero(),
        gate.wheel_speed_rpm,
    )?;
    require(
        "gate",
        "wheel_speed_rpm",
        gate.wheel_speed_rpm,
        T::zero(),
        gate.wheel_speed_sensor_rpm,
    )?;
    check_motor(scenario)?;
    check_feedback(scenario)?;
    check_dither(scenario)?;
    check_least_dither(scenario)
}

fn check_motor<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let (policy, gate) = (&scenario.controller, &scenario.gate);
    let resistance_ohm = scenario.servo.winding_resistance_ohm;
    let a_per_v = T::from_f64(1.0 + ROUNDING) / resistance_ohm;
    let most_a = gate.motor_voltage_v * a_per_v;
    require(
        "controller",
        "motor_current_a",
        policy.motor_current_a,
        T::zero(),
        most_a,
    )?;
    let fastest = gate.motor_slew_v_per_s * a_per_v;
    require(
        "controller",
        "motor_slew_a_per_s",
        policy.motor_slew_a_per_s,
        T::zero(),
        fastest,
    )
}

/// The gate must pass the feedback, which must be able to make room for the driver's share.
fn check_feedback<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let (policy, gate) = (&scenario.controller, &scenario.gate);
    if !policy.suppression.has_feedback() {
        return Ok(());
    }
    let nm_per_v = T::from_f64(1.0 + ROUNDING) / scenario.motor_v_per_nm();
    require(
        "controller",
        "feedback_torque_nm",
        policy.feedback_torque_nm,
        T::zero(),
        gate.feedback_voltage_v * nm_per_v,
    )?;
    let slowest = policy.motor_slew_a_per_s * scenario.servo.winding_resistance_ohm * nm_per_v;
    require(
        "controller",
        "feedback_slew_nm_per_s",
        policy.feedback_slew_nm_per_s,
        slowest,
        gate.feedback_slew_v_per_s * nm_per_v,
    )
}

/// The gate's limits for a waveform.
struct DitherLimits<T> {
    frequency: (&'static str, T),
    most: (&'static str, T),
    least: (&'static str, T),
    safe: (&'static str, T),
}

impl<T: Real> DitherLimits<T> {
    /// `None` without dither.
    fn of(scenario: &Scenario<T>) -> Option<Self> {
        let (gate, dither) = (&scenario.gate, &scenario.dither);
        match scenario.suppressing_waveform() {
            Waveform::None => None,
            Waveform::Square => Some(Self {
                frequency: ("square_frequency_rad_per_s", dither.frequency_rad_per_s()),
                most: ("square_amplitude_v", gate.square_amplitude_v),
                least: ("square_least_amplitude_v", gate.square_least_amplitude_v),
                safe: ("square_safe_amplitude_v", gate.square_safe_amplitude_v),
            }),
            Waveform::Sine => Some(Self {
                frequency: ("sine_frequency_rad_per_s", dither.frequency_rad_per_s()),
                most: ("sine_amplitude_v", gate.sine_amplitude_v),
                least: ("sine_least_amplitude_v", gate.sine_least_amplitude_v),
                safe: ("sine_safe_amplitude_v", gate.sine_safe_amplitude_v),
            }),
        }
    }
}

/// The gate must pass the schedule's greatest amplitude and the dither's frequency, and have its own
/// amplitude of the safe state within its limits. The servo must be able to put them out beside the
/// motor's share.
fn check_dither<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let Some(limits) = DitherLimits::of(scenario) else {
        return Ok(());
    };
    let (gate, servo) = (&scenario.gate, &scenario.servo);
    let peak_v = Table::of(scenario.suppressing_waveform()).peak_v();
    let motor_v = scenario.controller.motor_current_a * servo.winding_resistance_ohm;
    let unlimited = T::from_f64(1e6);
    // With fewer samples in half a period not even their signs determine a frequency.
    let two_samples = T::from_f64(core::f64::consts::FRAC_PI_2) * scenario.run.pwm_rate_hz;
    let slowest = gate.dither_frequency_min_rad_per_s;
    let fastest = gate.dither_frequency_max_rad_per_s;
    require(
        "gate",
        "dither_frequency_max_rad_per_s",
        fastest,
        slowest,
        two_samples,
    )?;
    let ((most, most_v), (safe, safe_v)) = (limits.most, limits.safe);
    require("gate", most, most_v, peak_v, unlimited)?;
    require("gate", safe, safe_v, limits.least.1, most_v)?;
    let greatest_v = if safe_v > peak_v { safe_v } else { peak_v };
    require(
        "servo",
        "bus_voltage_v",
        servo.bus_voltage_v,
        motor_v + greatest_v,
        unlimited,
    )?;
    let (frequency, frequency_rad_per_s) = limits.frequency;
    require("dither", frequency, frequency_rad_per_s, slowest, fastest)
}

/// The gate must pass the scheduled amplitudes above its speed, and the ramp to them.
fn check_least_dither<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let Some(limits) = DitherLimits::of(scenario) else {
        return Ok(());
    };
    let (gate, policy) = (&scenario.gate, &scenario.controller);
    let unlimited = T::from_f64(1e6);
    let on_from_rpm = policy.dither_off_below_rpm + policy.hysteresis_rpm;
    let above_rpm = gate.dither_above_rpm;
    require(
        "gate",
        "dither_above_rpm",
        above_rpm,
        on_from_rpm,
        unlimited,
    )?;
    let table = Table::of(scenario.suppressing_waveform());
    let (least, least_v) = limits.least;
    require(
        "gate",
        least,
        least_v,
        T::zero(),
        table.least_above_v(above_rpm),
    )?;
    // A ramp to the greatest amplitude, and one tick for its start.
    let ramp_s = policy.dither_ramp_s + T::one() / scenario.run.control_rate_hz;
    require(
        "gate",
        "weak_dither_s",
        gate.weak_dither_s,
        ramp_s,
        unlimited,
    )
}

fn require<T: Real>(
    section: &'static str,
    name: &'static str,
    value: T,
    min: T,
    max: T,
) -> Result<(), OutOfRange> {
    if value >= min && value <= max {
        return Ok(());
    }
    Err(OutOfRange {
        section,
        name,
        value: value.to_f64(),
        min: min.to_f64(),
        max: max.to_f64(),
    })
}
