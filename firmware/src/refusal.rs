//! The reason why a scenario is refused, in the log.

use shared_model::stability::{MAX_STEP_TIMES_RATE, min_rate_hz};
use shared_model::{InvalidScenario, MAX_RATIO};

/// Logs the reason.
pub fn log_invalid_scenario(error: &InvalidScenario) {
    // In the words of its `Display`, whose formatting would take flash and panics; a test holds the
    // two together.
    match *error {
        InvalidScenario::OutOfRange(error) => defmt::error!(
            "scenario refused: {=str}.{=str} = {=f64}: must be a finite number from {=f64} to {=f64}",
            error.section,
            error.name,
            error.value,
            error.min,
            error.max
        ),
        InvalidScenario::Rates { control_hz, pwm_hz } => defmt::error!(
            "scenario refused: run.pwm_rate_hz = {=f64} and run.control_rate_hz = {=f64}: both must be whole numbers, the first a multiple of the second, at most {=u32} times it",
            pwm_hz,
            control_hz,
            MAX_RATIO
        ),
        InvalidScenario::TimerPeriod { counts } => defmt::error!(
            "scenario refused: servo.timer_clock_hz over run.pwm_rate_hz is {=u32} counts: must be from 2 to {=u16}",
            counts,
            u16::MAX
        ),
        InvalidScenario::Duration {
            duration_s,
            min_s,
            max_s,
        } => defmt::error!(
            "scenario refused: run.duration_s = {=f64}: must be from {=f64} (one step) to {=f64}",
            duration_s,
            min_s,
            max_s
        ),
        InvalidScenario::DitherFrequency {
            frequency_rad_per_s,
            max_rad_per_s,
        } => defmt::error!(
            "scenario refused: dither frequency {=f64} rad/s: must be at most {=f64} rad/s, half of run.pwm_rate_hz",
            frequency_rad_per_s,
            max_rad_per_s
        ),
        InvalidScenario::OverVoltage {
            motor_v,
            dither_v,
            bus_v,
        } => defmt::error!(
            "scenario refused: dither.amplitude_v = {=f64}: with {=f64} V for the motor current it exceeds servo.bus_voltage_v = {=f64}; at most {=f64} V are left for the dither",
            dither_v,
            motor_v,
            bus_v,
            InvalidScenario::left_for_dither_v(motor_v, bus_v)
        ),
        InvalidScenario::StepTooLong {
            field,
            rate_hz,
            fastest_rate_per_s,
        } => defmt::error!(
            "scenario refused: {=str} = {=f64}: the step is too long; {=f64} s times the model's fastest rate, {=f64} 1/s, is {=f64}, and must be at most {=f64}: at least {=f64} Hz",
            field,
            rate_hz,
            1.0 / rate_hz,
            fastest_rate_per_s,
            fastest_rate_per_s / rate_hz,
            MAX_STEP_TIMES_RATE,
            min_rate_hz(fastest_rate_per_s)
        ),
    }
}
