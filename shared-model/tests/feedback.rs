//! The controller's delayed feedback and the gate's view of it.

use proptest::prelude::*;
use shared_model::controller::{Command, Controller};
use shared_model::delayed_feedback::table::{DITHERED, UNDITHERED};
use shared_model::delayed_feedback::{LINE_LEN, SHORTEST_LINE_S, Tuning, spacing_ticks};
use shared_model::dither::Waveform;
use shared_model::ecu::Ecu;
use shared_model::gate::{Fault, Faults, Observation, Supervisor};
use shared_model::policy::Suppression;
use shared_model::signal::{Measurement, Mode};
use shared_model::{Real, Scenario};
use std::f64::consts::TAU;

const TICKS_PER_S: u32 = 1000;
/// The request that the tables are made for.
const REQUEST_A: f32 = UNDITHERED.motor_current_a;
const CLOCK_HZ: u32 = 25_000_000;
/// Ticks after which the line reaches every period of the table back.
const FULL_TICKS: u32 = 2300;
/// Voltage of a torque, V/(N m).
const V_PER_NM: f32 = 0.3 / 1.638;

fn scenario() -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.controller.suppression = Suppression::DelayedFeedback;
    scenario.controller.feedback_adaptation_s3_per_rad2 = 0.0;
    scenario.dither.start_time_s = 0.0;
    scenario
}

fn at(wheel_speed_rpm: f32, yaw_rate_rad_per_s: f32, current_request_a: f32) -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm,
        yaw_rate_rad_per_s,
        steering_angle_rad: 0.1,
        steering_rate_rad_per_s: 0.0,
        current_request_a,
    }
}

fn tuning(wheel_speed_rpm: f32) -> Tuning<f32> {
    UNDITHERED.at(wheel_speed_rpm).unwrap()
}

/// A yaw rate of that period.
fn yaw_rate(tick: u32, period_s: f32) -> f32 {
    Real::sin(TAU * f64::from(tick) / (f64::from(TICKS_PER_S) * f64::from(period_s))) as f32
}

/// A controller after enough ticks of a periodic yaw rate, and the next tick.
fn on_an_orbit(scenario: &Scenario<f32>, wheel_speed_rpm: f32) -> (Controller<f32>, u32) {
    let mut controller = Controller::new(scenario);
    let period_s = UNDITHERED
        .at(wheel_speed_rpm)
        .map_or(1.7, |tuning| tuning.period_s);
    for tick in 0..2 * FULL_TICKS {
        controller.run(
            &at(wheel_speed_rpm, yaw_rate(tick, period_s), REQUEST_A),
            true,
        );
    }
    (controller, 2 * FULL_TICKS)
}

#[test]
fn the_tables_are_whole_and_fit_the_line() {
    for table in [UNDITHERED, DITHERED] {
        assert_eq!(table.validate(SHORTEST_LINE_S as f32), Ok(()));
        assert!(table.first_rpm < 1640.0 && table.last_rpm() >= 1960.0);
    }
    // The line reaches as far at every control rate.
    for rate_hz in 10..3000_u32 {
        let values_s = f64::from(spacing_ticks(rate_hz)) / f64::from(rate_hz);
        assert!(
            values_s * (LINE_LEN - 3) as f64 >= SHORTEST_LINE_S,
            "{rate_hz}"
        );
    }
}

/// Once the line is full there is no torque on an orbit, but for the interpolation.
#[test]
fn a_periodic_motion_needs_no_torque() {
    for speed_rpm in [1650.0, 1755.0, 1900.0] {
        let (mut controller, start) = on_an_orbit(&scenario(), speed_rpm);
        for tick in start..start + 2000 {
            let yaw_rate = yaw_rate(tick, tuning(speed_rpm).period_s);
            let command = controller.run(&at(speed_rpm, yaw_rate, REQUEST_A), true);
            assert!(
                command.feedback_v.abs() < 2e-4 * V_PER_NM * 10.0,
                "{command:?}"
            );
        }
        // K (gamma(t - T) - gamma(t)), 0.1 rad/s too much.
        let yaw_rate = yaw_rate(start + 2000, tuning(speed_rpm).period_s) + 0.1;
        let command = controller.run(&at(speed_rpm, yaw_rate, REQUEST_A), true);
        let wanted_v = -0.1 * tuning(speed_rpm).gain * V_PER_NM;
        let step_v = 100.0 / TICKS_PER_S as f32 * V_PER_NM;
        assert!(
            (command.feedback_v - wanted_v.max(-step_v)).abs() < 2e-3,
            "{command:?}"
        );
    }
}

/// Before the line is full, before the start, at speeds without an entry, and with other suppressions.
#[test]
fn there_is_no_torque_without_a_past_a_tuning_or_a_start() {
    let disturbed = |tick: u32| (tick % 97) as f32 / 97.0;
    let run = |scenario: &Scenario<f32>, speed_rpm: f32, ticks: u32| {
        let mut controller = Controller::new(scenario);
        (0..ticks).all(|tick| {
            let command = controller.run(&at(speed_rpm, disturbed(tick), REQUEST_A), true);
            command.feedback_v == 0.0
        })
    };
    let least_s = tuning(1750.0).period_s;
    assert!(run(
        &scenario(),
        1750.0,
        (least_s * TICKS_PER_S as f32) as u32
    ));
    assert!(!run(&scenario(), 1750.0, FULL_TICKS));
    for speed_rpm in [
        0.0,
        1000.0,
        UNDITHERED.first_rpm - 0.1,
        UNDITHERED.last_rpm() + 0.1,
        4000.0,
    ] {
        assert!(run(&scenario(), speed_rpm, 2 * FULL_TICKS), "{speed_rpm}");
    }
    // Switched on within the table by the hysteresis.
    assert!(run(
        &scenario(),
        UNDITHERED.first_rpm + 19.0,
        2 * FULL_TICKS
    ));
    let mut late = scenario();
    late.dither.start_time_s = 3.0;
    assert!(run(&late, 1750.0, 3000) && !run(&late, 1750.0, 3010));
    for suppression in [Suppression::None, Suppression::Dither] {
        let mut other = scenario();
        other.controller.suppression = suppression;
        assert!(run(&other, 1750.0, 2 * FULL_TICKS));
    }
    let mut without_torque = scenario();
    without_torque.controller.feedback_torque_nm = 0.0;
    assert!(run(&without_torque, 1750.0, 2 * FULL_TICKS));
}

/// Feedback and dither are each there only if they are to be.
#[test]
fn the_suppression_chooses_dither_and_feedback() {
    for (suppression, dither, feedback) in [
        (Suppression::None, false, false),
        (Suppression::Dither, true, false),
        (Suppression::DelayedFeedback, false, true),
        (Suppression::Both, true, true),
    ] {
        let mut scenario = scenario();
        scenario.controller.suppression = suppression;
        scenario.dither.waveform = Waveform::Square;
        let mut controller = Controller::new(&scenario);
        let commands: Vec<Command<f32>> = (0..FULL_TICKS)
            .map(|tick| controller.run(&at(1750.0, (tick % 97) as f32 / 97.0, REQUEST_A), true))
            .collect();
        assert_eq!(commands.iter().any(|c| c.dither_amplitude_v > 0.0), dither);
        assert_eq!(commands.iter().any(|c| c.feedback_v != 0.0), feedback);
    }
}

/// Leaving the table's speeds and coming back, the torque goes and comes in steps of its slew.
#[test]
fn switching_is_without_a_jump_in_saturation_too() {
    let mut controller = Controller::new(&scenario());
    let step_v = 100.0 / TICKS_PER_S as f32 * V_PER_NM * 1.001;
    let limit_v = 6.0 * V_PER_NM * 1.001;
    let (mut last_v, mut greatest_v) = (0.0_f32, 0.0_f32);
    for tick in 0..20_000_u32 {
        // Half a second in which it is off, every second.
        let speed_rpm = if tick % 1000 < 500 { 1750.0 } else { 1400.0 };
        // Far from any orbit, so that the torque is at its limit.
        let command = controller.run(&at(speed_rpm, yaw_rate(tick, 0.37) * 3.0, REQUEST_A), true);
        assert!(
            (command.feedback_v - last_v).abs() <= step_v,
            "{tick}: {command:?}"
        );
        greatest_v = greatest_v.max(command.feedback_v.abs());
        last_v = command.feedback_v;
        if tick % 1000 == 999 {
            assert_eq!(last_v, 0.0, "{tick}");
        }
    }
    assert!(
        (greatest_v / limit_v - 1.0).abs() < 0.01,
        "{greatest_v} {limit_v}"
    );
}

/// Both shares together keep the limit of the motor's current, on the side of the driver's and on the other.
#[test]
fn the_feedback_has_what_the_driver_leaves() {
    let mut scenario = scenario();
    scenario.controller.motor_current_a = 11.0;
    let resistance_ohm = scenario.servo.winding_resistance_ohm;
    let mut controller = Controller::new(&scenario);
    let (mut least_v, mut greatest_v) = (0.0_f32, 0.0_f32);
    for tick in 0..6000 {
        // Far from any orbit, so that the torque is at its limit.
        let command = controller.run(&at(1750.0, 3.0 * yaw_rate(tick, 0.37), REQUEST_A), true);
        least_v = least_v.min(command.feedback_v);
        greatest_v = greatest_v.max(command.feedback_v);
    }
    let room_v = (11.0 - REQUEST_A) * resistance_ohm;
    assert!((greatest_v - room_v).abs() < 1e-5, "{greatest_v} {room_v}");
    assert!((least_v + 6.0 * V_PER_NM).abs() < 0.01, "{least_v}");
}

/// While frames are missing the torque stays.
#[test]
fn without_a_new_measurement_the_torque_is_frozen() {
    let (mut controller, start) = on_an_orbit(&scenario(), 1750.0);
    let yaw_rate = yaw_rate(start, tuning(1750.0).period_s) + 0.05;
    let before = controller.run(&at(1750.0, yaw_rate, REQUEST_A), true);
    assert!(before.feedback_v != 0.0);
    for _ in 0..9 {
        let frozen = controller.run(&at(1750.0, yaw_rate, REQUEST_A), false);
        assert_eq!(frozen.feedback_v, before.feedback_v);
    }
}

/// An adapting delay becomes the period of a motion that is 12 ms longer than the table's: by a factor of e in 150 s
/// at this amplitude.
#[test]
fn the_delay_adapts() {
    let run = |adaptation: f32| {
        let mut scenario = scenario();
        scenario.controller.feedback_adaptation_s3_per_rad2 = adaptation;
        let mut controller = Controller::new(&scenario);
        let period_s = tuning(1750.0).period_s + 0.012;
        let command = |tick| controller.run(&at(1750.0, yaw_rate(tick, period_s), REQUEST_A), true);
        let last = (0..900_000).map(command).skip(898_000);
        last.fold(0.0_f32, |greatest, c| greatest.max(c.feedback_v.abs()))
    };
    let (fixed_v, adapted_v) = (run(0.0), run(1e-3));
    assert!(fixed_v > 0.2 * V_PER_NM, "{fixed_v}");
    assert!(adapted_v < 0.01 * fixed_v, "{adapted_v}");
}

fn observed(command: &Command<f32>, measurement: Measurement<f32>) -> Observation<f32> {
    Observation {
        elapsed_counts: CLOCK_HZ / TICKS_PER_S,
        measurement: Some(measurement),
        measurement_age_ticks: 1,
        motor_v: command.motor_v,
        feedback_v: command.feedback_v,
        dither_amplitude_v: command.dither_amplitude_v,
        found_outside: Faults::NONE,
    }
}

/// Near the tables', and any.
fn requests_a() -> impl Strategy<Value = f32> {
    prop_oneof![REQUEST_A - 0.6..REQUEST_A + 0.6, -20.0_f32..20.0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// The gate passes the feedback beside any request, at any speeds, with and without dither.
    #[test]
    fn the_gate_passes_the_controllers_feedback(
        legs in prop::collection::vec((1400.0_f32..2100.0, requests_a(), 0.2_f32..3.0, 0_u32..1500), 1..10),
        has_dither: bool,
        start_time_s in 0.0_f32..3.0,
    ) {
        let mut scenario = scenario();
        scenario.dither.waveform = Waveform::Square;
        if has_dither {
            scenario.controller.suppression = Suppression::Both;
        }
        scenario.dither.start_time_s = start_time_s;
        prop_assert!(Ecu::new(&scenario, CLOCK_HZ).is_ok());
        let mut controller = Controller::new(&scenario);
        let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
        let (mut speed_rpm, mut tick) = (1400.0_f32, 0);
        let motor_limit_v = 14.0 * 0.3 * 1.000_01;
        for (target_rpm, request_a, yaw_period_s, ticks) in legs {
            for _ in 0..ticks {
                tick += 1;
                speed_rpm += (target_rpm - speed_rpm).clamp(-10.0, 10.0);
                let measurement = at(speed_rpm, 1.5 * yaw_rate(tick, yaw_period_s), request_a);
                let command = controller.run(&measurement, true);
                prop_assert!((command.motor_v + command.feedback_v).abs() <= motor_limit_v);
                // The yaw rate jumps from leg to leg, and the steering stands still: other faults.
                let calm = at(speed_rpm, 0.5, 0.0);
                let setpoint = supervisor.run(&observed(&command, calm));
                prop_assert!(supervisor.faults().is_empty(), "{:?}", supervisor.faults());
                if supervisor.mode() == Mode::Active {
                    prop_assert_eq!(setpoint.motor_v, command.motor_v + command.feedback_v);
                }
            }
        }
    }
}

/// A gate with the feedback at that voltage, in steps that pass.
fn gate_at(scenario: &Scenario<f32>, motor_v: f32, feedback_v: f32) -> Supervisor<f32> {
    let mut supervisor = Supervisor::new(scenario, CLOCK_HZ);
    for tick in 0..=2000 {
        let share = tick as f32 / 2000.0;
        let command = Command {
            motor_v: share * motor_v,
            feedback_v: share * feedback_v,
            dither_amplitude_v: 0.0,
        };
        supervisor.run(&observed(&command, at(1750.0, 0.5, 0.0)));
    }
    assert!(supervisor.faults().is_empty(), "{:?}", supervisor.faults());
    supervisor
}

#[test]
fn sr01_the_gate_bounds_the_feedback() {
    let limits = scenario().gate;
    let slew_v = limits.feedback_slew_v_per_s / TICKS_PER_S as f32;
    for (from, to, fault) in [
        ((0.0, 1.499), (0.0, 1.5), None),
        ((0.0, 1.499), (0.0, 1.5001), Some(Fault::FeedbackVoltage)),
        ((0.0, -1.499), (0.0, -1.5001), Some(Fault::FeedbackVoltage)),
        ((0.0, 1.0), (0.0, 1.0 - 0.999 * slew_v), None),
        (
            (0.0, 1.0),
            (0.0, 1.0 - 1.001 * slew_v),
            Some(Fault::FeedbackSlew),
        ),
        (
            (0.0, -1.0),
            (0.0, 1.001 * slew_v - 1.0),
            Some(Fault::FeedbackSlew),
        ),
        // Both shares together.
        ((3.2, 1.2999), (3.2, 1.3), None),
        ((3.2, 1.2999), (3.2, 1.3001), Some(Fault::MotorVoltage)),
        ((-3.2, -1.2999), (-3.2, -1.3001), Some(Fault::MotorVoltage)),
        // The driver's share has its own slew, whatever the feedback does.
        ((1.0, 0.5), (1.0041, 0.4959), Some(Fault::MotorSlew)),
        ((0.0, 0.5), (0.0, f32::NAN), Some(Fault::CommandNotANumber)),
        (
            (0.0, 0.5),
            (0.0, f32::INFINITY),
            Some(Fault::CommandNotANumber),
        ),
    ] {
        let mut supervisor = gate_at(&scenario(), from.0, from.1);
        let command = Command {
            motor_v: to.0,
            feedback_v: to.1,
            dither_amplitude_v: 0.0,
        };
        let setpoint = supervisor.run(&observed(&command, at(1750.0, 0.5, 0.0)));
        let found: Vec<Fault> = supervisor.faults().iter().collect();
        assert_eq!(found, Vec::from_iter(fault), "{from:?} {to:?}");
        let before_v = from.0 + from.1;
        if fault.is_some() {
            // From where it was, towards neutral.
            assert!(setpoint.motor_v.abs() < before_v.abs());
            assert!((setpoint.motor_v - before_v).abs() < 4.1e-3);
        }
    }
}

/// A change by the limit itself passes, and the next number above it does not.
#[test]
fn the_gate_passes_the_fastest_change() {
    let scenario = scenario();
    let period_s = 1.0 / scenario.run.control_rate_hz;
    let limits = &scenario.gate;
    let most_v = limits.feedback_slew_v_per_s * period_s + 1e-6 * limits.feedback_voltage_v;
    for (feedback_v, faults) in [
        (most_v, Faults::NONE),
        (most_v.next_up(), Fault::FeedbackSlew.into()),
    ] {
        let mut supervisor = gate_at(&scenario, 0.0, 0.0);
        let command = Command {
            motor_v: 0.0,
            feedback_v,
            dither_amplitude_v: 0.0,
        };
        supervisor.run(&observed(&command, at(1750.0, 0.5, 0.0)));
        assert_eq!(supervisor.faults(), faults, "{feedback_v}");
    }
}

/// Where the feedback is not chosen, any is too much.
#[test]
fn the_gate_passes_no_feedback_that_is_not_chosen() {
    for suppression in [Suppression::None, Suppression::Dither] {
        let mut scenario = scenario();
        scenario.controller.suppression = suppression;
        let mut supervisor = gate_at(&scenario, 1.0, 0.0);
        let command = Command {
            motor_v: 1.0,
            feedback_v: 1e-6,
            dither_amplitude_v: 0.0,
        };
        supervisor.run(&observed(&command, at(1750.0, 0.5, 0.0)));
        assert!(supervisor.faults().contains(Fault::FeedbackVoltage));
    }
}

/// A yaw rate that is lost or stuck ends in the safe state, in which the feedback ramps out.
#[test]
fn a_wrong_yaw_rate_ends_the_feedback() {
    let lost = |_| f32::NAN;
    let stuck = |_| yaw_rate(2 * FULL_TICKS - 1, 1.1);
    for (yaw_rate_of, fault) in [
        (lost as fn(u32) -> f32, Fault::SensorNotANumber),
        (stuck, Fault::SensorStuck),
    ] {
        let scenario = scenario();
        let (mut controller, mut supervisor) = (
            Controller::new(&scenario),
            Supervisor::new(&scenario, CLOCK_HZ),
        );
        let run =
            |controller: &mut Controller<f32>, supervisor: &mut Supervisor<f32>, yaw, tick: u32| {
                let angle = 0.4 * yaw_rate(tick, 1.0);
                let rate = 0.4 * std::f32::consts::TAU * yaw_rate(tick + 250, 1.0);
                let measurement = Measurement {
                    steering_angle_rad: angle,
                    steering_rate_rad_per_s: rate,
                    ..at(1750.0, yaw, REQUEST_A)
                };
                let command = controller.run(&measurement, measurement.is_finite());
                supervisor.run(&observed(&command, measurement))
            };
        let mut setpoint = None;
        for tick in 0..2 * FULL_TICKS {
            let yaw = yaw_rate(tick, 1.1);
            setpoint = Some(run(&mut controller, &mut supervisor, yaw, tick));
        }
        assert!(setpoint.unwrap().motor_v != 0.0);
        assert_eq!(supervisor.mode(), Mode::Active, "{:?}", supervisor.faults());
        for tick in 2 * FULL_TICKS..3 * FULL_TICKS {
            setpoint = Some(run(
                &mut controller,
                &mut supervisor,
                yaw_rate_of(tick),
                tick,
            ));
        }
        assert!(
            supervisor.faults().contains(fault),
            "{:?}",
            supervisor.faults()
        );
        assert_eq!(supervisor.mode(), Mode::Safe);
        assert_eq!(setpoint.unwrap().motor_v, 0.0);
    }
}

/// What the gate would refuse is refused before the first tick, with its bounds.
#[test]
fn inconsistent_settings_are_refused() {
    for (setting, says) in [
        (
            "controller.feedback_torque_nm=8.2",
            "controller.feedback_torque_nm =",
        ),
        (
            "controller.feedback_torque_nm=-1",
            "controller.feedback_torque_nm = -1",
        ),
        (
            "controller.feedback_slew_nm_per_s=137",
            "controller.feedback_slew_nm_per_s =",
        ),
        // Slower than the driver's share, for which it must make room.
        (
            "controller.feedback_slew_nm_per_s=16.3",
            "controller.feedback_slew_nm_per_s =",
        ),
        (
            "controller.feedback_adaptation_s3_per_rad2=1.1",
            "controller.feedback_adaptation_s3_per_rad2 =",
        ),
        ("gate.feedback_voltage_v=3.1", "gate.feedback_voltage_v ="),
        (
            "gate.feedback_slew_v_per_s=51",
            "gate.feedback_slew_v_per_s =",
        ),
        // Without efficiency no voltage gives a torque.
        ("steering.efficiency=0", "controller.feedback_torque_nm ="),
    ] {
        let mut scenario = scenario();
        scenario.apply(setting).unwrap();
        let error = Ecu::new(&scenario, CLOCK_HZ).unwrap_err().to_string();
        assert!(error.starts_with(says), "{setting}: {error}");
    }
    for setting in [
        "controller.feedback_torque_nm=8.18",
        "controller.feedback_torque_nm=0",
        "controller.feedback_slew_nm_per_s=136",
        "controller.feedback_slew_nm_per_s=16.4",
    ] {
        let mut scenario = scenario();
        scenario.apply(setting).unwrap();
        assert!(Ecu::new(&scenario, CLOCK_HZ).is_ok(), "{setting}");
    }
    // What the gate just passes may be the limit.
    let mut exact = scenario();
    exact.gate.feedback_voltage_v = exact.controller.feedback_torque_nm * exact.motor_v_per_nm();
    exact.gate.feedback_slew_v_per_s =
        exact.controller.feedback_slew_nm_per_s * exact.motor_v_per_nm();
    assert!(Ecu::new(&exact, CLOCK_HZ).is_ok());
    let mut scenario = scenario();
    assert!(scenario.apply("controller.suppression=all").is_err());
    scenario.apply("controller.suppression=both").unwrap();
    assert_eq!(scenario.controller.suppression, Suppression::Both);
}
