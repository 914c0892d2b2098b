//! Does the gate let the controller's commands through? Asked once, before the first tick, so that a scenario which does not fit
//! is refused by name and not by a safe state at some later time.

use crate::dither::Waveform;
use crate::ecu_schedule::Table;
use crate::parameter::OutOfRange;
use crate::{Real, Scenario};

/// What a number may be off by the rounding of f32; the gate's own limits have the same room.
const ROUNDING: f64 = 1e-6;

/// Checks the numbers of a valid scenario against each other.
///
/// # Errors
/// The first number that does not fit, with the range that the others leave it.
pub(super) fn check<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let gate = &scenario.gate;
    fits(
        "gate",
        "safe_wheel_speed_rpm",
        gate.safe_wheel_speed_rpm,
        T::zero(),
        gate.wheel_speed_rpm,
    )?;
    check_motor(scenario)?;
    check_dither(scenario)
}

fn check_motor<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let (policy, gate) = (&scenario.policy, &scenario.gate);
    let resistance_ohm = scenario.servo.winding_resistance_ohm;
    let a_per_v = T::from_f64(1.0 + ROUNDING) / resistance_ohm;
    let most_a = gate.motor_voltage_v * a_per_v;
    fits(
        "policy",
        "motor_current_a",
        policy.motor_current_a,
        T::zero(),
        most_a,
    )?;
    let fastest = gate.motor_slew_v_per_s * a_per_v;
    fits(
        "policy",
        "motor_slew_a_per_s",
        policy.motor_slew_a_per_s,
        T::zero(),
        fastest,
    )
}

fn check_dither<T: Real>(scenario: &Scenario<T>) -> Result<(), OutOfRange> {
    let (gate, servo) = (&scenario.gate, &scenario.servo);
    let (amplitude, frequency, limit_v) = match scenario.dither.waveform {
        Waveform::None => return Ok(()),
        Waveform::Square => (
            "square_amplitude_v",
            "square_frequency_rad_per_s",
            gate.square_amplitude_v,
        ),
        Waveform::Sine => (
            "sine_amplitude_v",
            "sine_frequency_rad_per_s",
            gate.sine_amplitude_v,
        ),
    };
    let peak_v = Table::of(scenario.dither.waveform).peak_v();
    let motor_v = scenario.policy.motor_current_a * servo.winding_resistance_ohm;
    let unlimited = T::from_f64(1e6);
    // Of fewer samples in half a period not even their signs tell a frequency.
    let two_samples = T::from_f64(core::f64::consts::FRAC_PI_2) * scenario.run.pwm_rate_hz;
    let slowest = gate.dither_frequency_min_rad_per_s;
    let fastest = gate.dither_frequency_max_rad_per_s;
    fits(
        "gate",
        "dither_frequency_max_rad_per_s",
        fastest,
        slowest,
        two_samples,
    )?;
    fits("gate", amplitude, limit_v, peak_v, unlimited)?;
    fits(
        "servo",
        "bus_voltage_v",
        servo.bus_voltage_v,
        motor_v + peak_v,
        unlimited,
    )?;
    let frequency_rad_per_s = scenario.dither.frequency_rad_per_s();
    fits("dither", frequency, frequency_rad_per_s, slowest, fastest)
}

fn fits<T: Real>(
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
