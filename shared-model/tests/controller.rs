//! The controller: the driver's request, the dither's switch, and how fast both may move.

use shared_model::Scenario;
use shared_model::controller::Controller;
use shared_model::dither::Waveform;
use shared_model::ecu_schedule::Table;
use shared_model::policy::Policy;
use shared_model::signal::Measurement;

const OHM: f32 = 0.3;
/// Change of the motor's share in a tick, V: 10 A/s at 1 kHz through 0.3 ohm.
const STEP_V: f32 = 3e-3;

fn scenario() -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.dither.waveform = Waveform::Square;
    scenario.dither.start_time_s = 0.0;
    scenario
}

fn measurement(wheel_speed_rpm: f32, current_request_a: f32) -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm,
        yaw_rate_rad_per_s: 0.0,
        steering_angle_rad: 0.0,
        steering_rate_rad_per_s: 0.0,
        current_request_a,
    }
}

/// Amplitude after `ticks` at a speed.
fn amplitude_v(controller: &mut Controller<f32>, wheel_speed_rpm: f32, ticks: u32) -> f32 {
    let commands = (0..ticks).map(|_| controller.run(&measurement(wheel_speed_rpm, 0.0), true));
    commands.last().unwrap().dither_amplitude_v
}

#[test]
fn the_request_becomes_a_voltage_within_its_limits() {
    for (request_a, settled_a) in [
        (10.0, 10.0),
        (14.0, 14.0),
        (14.1, 14.0),
        (1000.0, 14.0),
        (-14.0, -14.0),
        (-20.0, -14.0),
        (0.004, 0.004),
        (0.0, 0.0),
    ] {
        let mut controller = Controller::new(&scenario());
        let mut last_v = 0.0;
        for _ in 0..1401 {
            let now_v = controller
                .run(&measurement(1000.0, request_a), true)
                .motor_v;
            assert!((now_v - last_v).abs() <= STEP_V * 1.001);
            last_v = now_v;
        }
        assert_eq!(last_v, settled_a * OHM, "{request_a} A");
    }
}

#[test]
fn the_request_is_approached_in_even_steps_both_ways() {
    let mut controller = Controller::new(&scenario());
    for tick in 1..=1000 {
        let motor_v = controller.run(&measurement(1000.0, 10.0), true).motor_v;
        assert!((motor_v - STEP_V * tick as f32).abs() < 1e-4);
    }
    for tick in 1..=2000 {
        let motor_v = controller.run(&measurement(1000.0, -10.0), true).motor_v;
        assert!((motor_v - (3.0 - STEP_V * tick as f32)).abs() < 1e-4);
    }
    // A target within a step is reached at once.
    let target_a = -10.0 + 0.009;
    let motor_v = controller.run(&measurement(1000.0, target_a), true).motor_v;
    assert_eq!(motor_v, target_a * OHM);
}

#[test]
fn slew_is_by_time_not_by_tick() {
    let mut scenario = scenario();
    scenario.run.control_rate_hz = 100.0;
    let mut controller = Controller::new(&scenario);
    let command = controller.run(&measurement(1750.0, 10.0), true);
    assert!((command.motor_v - 10.0 * STEP_V).abs() < 1e-6);
    let peak_v = Table::<f32>::of(Waveform::Square).peak_v();
    assert!((command.dither_amplitude_v - peak_v / 50.0).abs() < 1e-6);
}

/// Half a second for the schedule's greatest amplitude, in and out.
#[test]
fn dither_is_ramped_in_and_out() {
    for waveform in [Waveform::Square, Waveform::Sine] {
        let mut scenario = scenario();
        scenario.dither.waveform = waveform;
        let table = Table::<f32>::of(waveform);
        let step_v = table.peak_v() / 500.0;
        let wanted_v = table.amplitude_v(1750.0);
        let ticks = (wanted_v / step_v).ceil() as u32;
        let mut controller = Controller::new(&scenario);
        for tick in 1..ticks {
            let amplitude_v = amplitude_v(&mut controller, 1750.0, 1);
            assert!((amplitude_v - step_v * tick as f32).abs() < 1e-4);
        }
        assert_eq!(amplitude_v(&mut controller, 1750.0, 2), wanted_v);
        for tick in 1..ticks {
            let amplitude_v = amplitude_v(&mut controller, 1000.0, 1);
            assert!((amplitude_v - (wanted_v - step_v * tick as f32)).abs() < 1e-4);
        }
        assert_eq!(amplitude_v(&mut controller, 1000.0, 2), 0.0);
    }
}

#[test]
fn no_waveform_is_no_dither() {
    let mut scenario = scenario();
    scenario.dither.waveform = Waveform::None;
    assert_eq!(
        amplitude_v(&mut Controller::new(&scenario), 1750.0, 1000),
        0.0
    );
}

#[test]
fn amplitude_follows_the_schedule() {
    let mut controller = Controller::new(&scenario());
    let table = Table::<f32>::of(Waveform::Square);
    for speed_rpm in [1750.0, 1900.0, 1999.0, 2400.0, 1600.0, 1551.0] {
        let settled_v = amplitude_v(&mut controller, speed_rpm, 600);
        assert_eq!(settled_v, table.amplitude_v(speed_rpm));
        assert!(settled_v > 0.1);
    }
}

/// On from 1550 rpm, off below 1530 rpm, between them as it was.
#[test]
fn dither_switches_with_hysteresis() {
    let is_on =
        |controller: &mut Controller<f32>, speed_rpm| amplitude_v(controller, speed_rpm, 600) > 0.0;
    let mut controller = Controller::new(&scenario());
    assert!(!is_on(&mut controller, 1530.0));
    assert!(!is_on(&mut controller, 1550.0_f32.next_down()));
    assert!(is_on(&mut controller, 1550.0));
    assert!(is_on(&mut controller, 1540.0));
    assert!(is_on(&mut controller, 1530.0));
    assert!(!is_on(&mut controller, 1530.0_f32.next_down()));
    assert!(!is_on(&mut controller, 1530.0));
    assert!(is_on(&mut controller, 1600.0));
    assert!(!is_on(&mut controller, 0.0));
}

#[test]
fn dither_waits_for_its_start() {
    for (start_time_s, ticks) in [(0.0, 0), (0.0004, 0), (0.0006, 1), (0.5, 500), (3.0, 3000)] {
        let mut scenario = scenario();
        scenario.dither.start_time_s = start_time_s;
        let mut controller = Controller::new(&scenario);
        for tick in 0..ticks {
            assert_eq!(amplitude_v(&mut controller, 1750.0, 1), 0.0, "tick {tick}");
        }
        assert!(amplitude_v(&mut controller, 1750.0, 1) > 0.0);
    }
}

#[test]
fn policies_map_to_other_arithmetics() {
    let policy = Policy::<f64>::reconstruction().map(&|value| value as f32);
    assert_eq!(policy, Policy::<f32>::reconstruction());
}
