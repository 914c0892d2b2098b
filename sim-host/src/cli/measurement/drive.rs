//! A drive with the ECU in the loop: vehicle and actuator frame at each control tick, the duties in
//! each PWM period. The lead-in, in which the vehicle is held, is not part of it.

use super::channels::{channel, friction_mode, name};
use mdf4::{Channel, Group, Samples};
use pil::closed_loop::{Exchange, Run};
use pil::record::Record;
use shared_model::ecu::Warning;
use shared_model::gate::Fault;
use shared_model::signal::{Actuation, Mode};
use std::path::Path;

/// Code of the mode before the first actuator frame.
const NO_FRAME: u8 = u8::MAX;

/// Writes a drive. `lead_in_periods` are the PWM periods before it.
pub fn write(
    run: &Run,
    lead_in_periods: usize,
    pwm_rate_hz: f64,
    comment: String,
    path: &Path,
    force: bool,
) -> anyhow::Result<()> {
    let mut channels = vehicle(&run.records);
    channels.extend(actuator_frame(&run.actuations));
    let ticks = Group {
        name: "control tick".into(),
        records: run.records.len(),
        time_s: Box::new(|k| run.records[k].time_s),
        channels,
    };
    let exchanges = run.exchanges.get(lead_in_periods..).unwrap_or_default();
    let periods = Group {
        name: "PWM period".into(),
        records: exchanges.len(),
        time_s: Box::new(move |n| n as f64 / pwm_rate_hz),
        channels: pins(exchanges),
    };
    super::write(path, force, comment, vec![ticks, periods])
}

/// The vehicle at each control tick.
fn vehicle(records: &[Record]) -> Vec<Channel<'_>> {
    let number = |name, text, of: fn(&Record) -> f64| {
        let samples = Samples::F64(Box::new(move |k| of(&records[k])));
        channel(name, text, samples)
    };
    vec![
        number("wheel_speed_rpm", "Wheel speed N.", |now| {
            now.wheel_speed_rpm
        }),
        number("sideslip_rad", "Sideslip angle beta.", |now| {
            now.sideslip_rad
        }),
        number("yaw_rate_rad_per_s", "Yaw rate gamma.", |now| {
            now.yaw_rate_rad_per_s
        }),
        number(
            "steering_angle_rad",
            "Front steering angle delta_f.",
            |now| now.steering_angle_rad,
        ),
        number("steering_rate_rad_per_s", "Steering rate.", |now| {
            now.steering_rate_rad_per_s
        }),
        friction_mode(|k| records[k].friction_mode),
        number(
            "current_request_a",
            "Motor current that the driver requests.",
            |now| now.current_request_a,
        ),
        number(
            "motor_current_a",
            "Motor current of the last PWM period.",
            |now| now.motor_current_a,
        ),
        number(
            "dither_rad",
            "Dither ahead of the nonlinearities in the last PWM period.",
            |now| now.dither_rad,
        ),
    ]
}

/// The content of the ECU's last valid actuator frame at each control tick.
fn actuator_frame(actuations: &[Option<Actuation<f32>>]) -> Vec<Channel<'_>> {
    let number = |name, text, of: fn(&Actuation<f32>) -> f32| {
        let samples = move |k: usize| actuations[k].as_ref().map_or(f32::NAN, of);
        channel(name, text, Samples::F32(Box::new(samples)))
    };
    let modes = Mode::ALL.map(|mode| (mode as u8, name(&mode)));
    let mut modes = modes.to_vec();
    modes.push((NO_FRAME, "no frame yet".into()));
    let mode = move |k: usize| actuations[k].map_or(NO_FRAME, |now| now.mode as u8);
    let bits = |text, names: Vec<&str>| format!("{text}, from bit 0 on: {}.", names.join(", "));
    let faults = bits(
        "Faults that put the ECU into its safe state, one bit each",
        Fault::ALL.iter().map(|fault| fault.name()).collect(),
    );
    let warnings = bits(
        "Events since the last frame that are tolerated, one bit each",
        Warning::ALL.iter().map(|warning| warning.name()).collect(),
    );
    vec![
        channel(
            "mode",
            "Operating mode of the ECU.",
            Samples::Name(Box::new(mode), modes),
        ),
        channel(
            "faults",
            &faults,
            Samples::U32(Box::new(|k| actuations[k].map_or(0, |now| now.faults))),
        ),
        channel(
            "warnings",
            &warnings,
            Samples::U16(Box::new(|k| actuations[k].map_or(0, |now| now.warnings))),
        ),
        number(
            "motor_voltage_v",
            "Motor's share of the servo voltage.",
            |now| now.motor_voltage_v,
        ),
        number(
            "dither_amplitude_v",
            "Amplitude of the dither on the servo voltage.",
            |now| now.dither_amplitude_v,
        ),
        number(
            "wheel_speed_limit_rpm",
            "Wheel speed that the vehicle must not exceed.",
            |now| now.wheel_speed_limit_rpm,
        ),
    ]
}

/// The pins of the servo in each PWM period.
fn pins(exchanges: &[Exchange]) -> Vec<Channel<'_>> {
    vec![
        channel(
            "duty_code",
            "Duty that the ECU commands, counts of the PWM timer.",
            Samples::U16(Box::new(|n| exchanges[n].from_ecu.duty_code)),
        ),
        channel(
            "captured_duty_code",
            "Duty that is measured on the pin of the servo, counts of the PWM timer.",
            Samples::U16(Box::new(|n| exchanges[n].to_ecu.duty_code)),
        ),
        channel(
            "bridge_on",
            "1 while the bridge of the servo is on.",
            Samples::U8(Box::new(|n| exchanges[n].from_ecu.bridge_on.into())),
        ),
    ]
}
