//! The loop closed on the host: what the dither does to the vehicle when an ECU that only sees
//! frames puts it out as duty.

use dynamics::extrema::Extrema;
use dynamics::period::{Period, period_of_maxima};
use pil::closed_loop::{Run, run};
use pil::comparison::{Depth, compare};
use pil::ecu::{Ecu, Model, Software};
use pil::manoeuvre::{Manoeuvre, load};
use pil::vehicle_node::{VehicleNode, ecu_scenario};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::ecu_schedule::Table;
use shared_model::signal::Mode;
use std::path::Path;

const TICK_S: f64 = 1e-3;

fn drive(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Run {
    let mut ecu = Software::new(&ecu_scenario(scenario, manoeuvre)).expect("it is valid");
    let vehicle = VehicleNode::new(scenario, manoeuvre).expect("it is valid");
    run(&mut ecu, vehicle, &mut || {}).expect("a program on the host is reached")
}

/// The motion's period over the run's second half.
fn period(run: &Run) -> Period {
    let mut extrema = Extrema::default();
    for record in &run.records[run.records.len() / 2..] {
        extrema.push(record.time_s, TICK_S, record.yaw_rate_rad_per_s);
    }
    period_of_maxima(&extrema.maxima(), extrema.range(), 0.02)
}

fn example(file: &str) -> (Scenario<f64>, Manoeuvre) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/manoeuvres");
    load(&folder.join(file)).expect("the example is valid")
}

#[test]
fn the_ecu_suppresses_the_chaos_by_its_duty_alone() {
    for rpm in [1700.0, 1750.0, 1800.0, 1880.0] {
        let manoeuvre = Manoeuvre::constant(rpm, 10.0);
        let mut scenario = Scenario::reconstruction();
        scenario.run.duration_s = 120.0;
        let chaos = period(&drive(&scenario, &manoeuvre));
        assert!(
            matches!(chaos, Period::Aperiodic { .. }),
            "{rpm} rpm: {chaos}"
        );
        for waveform in [Waveform::Square, Waveform::Sine] {
            scenario.dither.waveform = waveform;
            let run = drive(&scenario, &manoeuvre);
            assert_eq!(period(&run).maxima(), Some(1), "{rpm} rpm, {waveform:?}");
            let last = run
                .actuations
                .last()
                .copied()
                .flatten()
                .expect("it has told");
            let scheduled = Table::<f32>::of(waveform).amplitude_v(rpm as f32);
            assert_eq!((last.mode, last.faults), (Mode::Active, 0));
            assert_eq!(
                last.dither_amplitude_v, scheduled,
                "as scheduled, from 3 s on"
            );
        }
    }
}

#[test]
fn the_amplitude_follows_the_speed_without_a_jump() {
    let (scenario, manoeuvre) = example("speed-ramp.toml");
    let run = drive(&scenario, &manoeuvre);
    let table = Table::<f32>::of(scenario.dither.waveform);
    let step_v = f64::from(table.peak_v()) * TICK_S / scenario.controller.dither_ramp_s;
    let mut last_v = 0.0;
    for (record, actuation) in run.records.iter().zip(&run.actuations) {
        let amplitude_v = f64::from(actuation.expect("it has told").dither_amplitude_v);
        assert!(
            (amplitude_v - last_v).abs() <= 1.001 * step_v,
            "at {} s",
            record.time_s
        );
        last_v = amplitude_v;
        let ramp_s = 2.0 * scenario.controller.dither_ramp_s;
        if record.time_s > scenario.dither.start_time_s + ramp_s && record.wheel_speed_rpm > 1600.0
        {
            assert!(amplitude_v > 0.1, "{amplitude_v} V at {} s", record.time_s);
        }
    }
    let first = &run.records[0];
    let last = run.records.last().expect("there are ticks");
    for end in [first, last] {
        let off_below = scenario.controller.dither_off_below_rpm;
        assert!(
            end.wheel_speed_rpm < off_below,
            "the ramp begins and ends without dither"
        );
    }
    assert_eq!(last_v, 0.0);
}

#[test]
fn the_vehicle_is_held_until_the_request_is_reached() {
    let (scenario, manoeuvre) = example("constant-speed.toml");
    let run = drive(&scenario, &manoeuvre);
    let first = &run.records[0];
    assert!((first.time_s - TICK_S).abs() < 1e-12);
    assert!((first.steering_angle_rad - scenario.run.steering_angle_rad).abs() < 1e-4);
    let motor_v = run.actuations[0].expect("it has told").motor_voltage_v;
    assert!((f64::from(motor_v) - scenario.motor_voltage_v()).abs() < 1e-6);
    assert_eq!(run.records.len(), 20_000);
    // The dither sets in by the manoeuvre's clock.
    let on = run
        .actuations
        .iter()
        .position(|told| told.is_some_and(|told| told.dither_amplitude_v > 0.0));
    let on_s = on.expect("it sets in") as f64 * TICK_S;
    assert!(
        (on_s - scenario.dither.start_time_s).abs() < 5.0 * TICK_S,
        "{on_s} s"
    );
}

/// A measurement of a slow sensor in a frame that is sent in time.
#[test]
fn a_delayed_measurement_is_not_a_stale_frame() {
    for delay_ticks in [11, 40, 100] {
        let (mut scenario, mut manoeuvre) = example("delay-2.toml");
        scenario.run.duration_s = 2.0;
        manoeuvre.sensors.delay_ticks = delay_ticks;
        let run = drive(&scenario, &manoeuvre);
        for actuation in run.actuations.iter().flatten() {
            assert_eq!((actuation.mode, actuation.faults), (Mode::Active, 0));
            assert_eq!(actuation.warnings, 0, "{delay_ticks} ticks");
        }
    }
}

/// MIL and SIL agree under noise, coarse sensors and delays, which change the inputs of the ECU.
#[test]
fn mil_and_sil_agree_with_any_sensors() {
    for file in [
        "low-resolution-noise.toml",
        "delay-2.toml",
        "sine-steer.toml",
    ] {
        let (mut scenario, manoeuvre) = example(file);
        scenario.run.duration_s = 6.0;
        let own = ecu_scenario(&scenario, &manoeuvre);
        let drive_with = |ecu: &mut dyn Ecu| {
            let vehicle = VehicleNode::new(&scenario, &manoeuvre).expect("it is valid");
            run(ecu, vehicle, &mut || {})
                .expect("it is on the host")
                .exchanges
        };
        let model = drive_with(&mut Model::new(&own).expect("it is valid"));
        let software = drive_with(&mut Software::new(&own).expect("it is valid"));
        // The frames too: challenges, warnings, counters.
        let comparison = compare(&model, &software, Depth::Bytes);
        assert!(comparison.is_equal(), "{file}: {comparison:?}");
        assert!(comparison.duties >= 60_000 && comparison.frames >= 6_000);
    }
}
