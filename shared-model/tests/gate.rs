//! The gate at the control rate: commands, time, modes and the safe state. Sensors and samples have
//! tests of their own.

use proptest::prelude::*;
use shared_model::Scenario;
use shared_model::controller::Controller;
use shared_model::dither::Waveform;
use shared_model::gate::{Fault, FaultClass, Faults, Observation, Setpoint, Supervisor};
use shared_model::signal::{Measurement, Mode};

const CLOCK_HZ: u32 = 25_000_000;
const TICK_COUNTS: u32 = 25_000;
/// Change of the motor's share in a tick, V: 4 V/s at 1 kHz.
const SLEW_V: f32 = 4e-3;
const MOTOR_LIMIT_V: f32 = 4.5;
const SQUARE_LIMIT_V: f32 = 0.2;
/// Amplitude of the safe state.
const SAFE_SQUARE_V: f32 = 0.125;
/// Just beyond a limit: more than rounding, less than a PWM count.
const ABOVE: f32 = 1.000_01;

fn scenario(waveform: Waveform) -> Scenario<f32> {
    let mut scenario = Scenario::reconstruction();
    scenario.dither.waveform = waveform;
    scenario
}

fn supervisor(waveform: Waveform) -> Supervisor<f32> {
    Supervisor::new(&scenario(waveform), CLOCK_HZ)
}

fn calm() -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm: 1750.0,
        yaw_rate_rad_per_s: 0.5,
        steering_angle_rad: 0.1,
        steering_rate_rad_per_s: 0.0,
        current_request_a: 10.0,
    }
}

fn command(motor_v: f32, dither_amplitude_v: f32) -> Observation<f32> {
    Observation {
        elapsed_counts: TICK_COUNTS,
        measurement: Some(calm()),
        measurement_age_ticks: 1,
        motor_v,
        feedback_v: 0.0,
        dither_amplitude_v,
        found_outside: Faults::NONE,
    }
}

/// A gate that has let the motor's share come to `motor_v`.
fn active_at(waveform: Waveform, motor_v: f32) -> Supervisor<f32> {
    let mut supervisor = supervisor(waveform);
    let ticks = (motor_v.abs() / SLEW_V).ceil();
    for tick in 0..=ticks as u32 {
        let share = (tick as f32 / ticks.max(1.0)).min(1.0);
        supervisor.run(&command(share * motor_v, 0.0));
    }
    assert_eq!(supervisor.faults(), Faults::NONE);
    assert_eq!(supervisor.mode(), Mode::Active);
    supervisor
}

fn assert_only(supervisor: &Supervisor<f32>, fault: Fault) {
    assert_eq!(
        supervisor.faults().iter().collect::<Vec<_>>(),
        [fault],
        "{}",
        fault.name()
    );
    assert_eq!(supervisor.mode(), Mode::Safe);
}

fn assert_clean(supervisor: &Supervisor<f32>) {
    assert_eq!(
        supervisor.faults().iter().collect::<Vec<_>>(),
        [],
        "no fault"
    );
    assert_eq!(supervisor.mode(), Mode::Active);
}

#[test]
fn faults_are_bits_with_names() {
    let mut all = Faults::NONE;
    assert!(all.is_empty());
    for (bit, fault) in Fault::ALL.into_iter().enumerate() {
        assert_eq!(fault as usize, bit);
        assert_eq!(Faults::from(fault).bits(), 1 << bit);
        assert!(!all.contains(fault));
        all.add_if(false, fault);
        assert!(!all.contains(fault));
        all.add_if(true, fault);
        all |= fault;
        assert!(all.contains(fault) && !all.is_empty());
    }
    assert_eq!(all.bits(), 0x1F_FFFF);
    assert_eq!(all.iter().collect::<Vec<_>>(), Fault::ALL);
    let mut one = Faults::from(Fault::Readback);
    one |= Faults::from(Fault::FrameAge);
    one |= Faults::from(Fault::FrameAge);
    assert_eq!(one, Faults::from_bits(1 << 14 | 1 << 6));
    assert_eq!(Faults::from_bits(0), Faults::default());
    let mut names = Fault::ALL.map(Fault::name).to_vec();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), Fault::ALL.len());
    assert!(names.iter().all(|name| name.len() > 5));
}

#[test]
fn sr21_neutral_until_the_first_measurement() {
    let mut supervisor = supervisor(Waveform::Square);
    let limits = scenario(Waveform::Square).gate;
    // Neither time nor the age of a frame has a beginning yet.
    for elapsed_counts in (0..1000).chain([u32::MAX]) {
        let nothing = Observation {
            elapsed_counts,
            measurement: None,
            ..command(0.0, 0.0)
        };
        assert_eq!(supervisor.run(&nothing), Setpoint::neutral());
        assert_eq!(supervisor.mode(), Mode::Starting);
        assert_eq!(supervisor.faults(), Faults::NONE);
        let limit_rpm = supervisor.wheel_speed_limit_rpm();
        assert_eq!(limit_rpm, limits.safe_wheel_speed_rpm);
    }
    let first = Observation {
        elapsed_counts: 0,
        ..command(SLEW_V, 0.1)
    };
    let setpoint = supervisor.run(&first);
    assert_clean(&supervisor);
    assert_eq!(
        (setpoint.motor_v, setpoint.dither_amplitude_v),
        (SLEW_V, 0.1)
    );
    assert_eq!(supervisor.wheel_speed_limit_rpm(), limits.wheel_speed_rpm);
}

#[test]
fn sr21_no_command_before_the_first_measurement_is_followed() {
    let early = Observation {
        measurement: None,
        ..command(SLEW_V, 0.1)
    };
    let mut supervisor = supervisor(Waveform::Square);
    assert_eq!(supervisor.run(&early), Setpoint::neutral());
    assert_eq!(supervisor.mode(), Mode::Starting);
}

#[test]
fn sr01_motor_voltage_has_a_limit_on_both_sides() {
    for sign in [1.0, -1.0] {
        let mut at = active_at(Waveform::Square, sign * MOTOR_LIMIT_V);
        for _ in 0..100 {
            let setpoint = at.run(&command(sign * MOTOR_LIMIT_V, 0.0));
            assert_eq!(setpoint.motor_v, sign * MOTOR_LIMIT_V);
        }
        assert_clean(&at);
        at.run(&command(sign * MOTOR_LIMIT_V * ABOVE, 0.0));
        assert_only(&at, Fault::MotorVoltage);
    }
}

#[test]
fn sr01_motor_slew_has_a_limit_both_ways_from_anywhere() {
    for start_v in [0.0, 2.0, -2.0, 4.4, -4.4] {
        for sign in [1.0, -1.0] {
            let step_v = sign * SLEW_V;
            let mut at = active_at(Waveform::Square, start_v);
            at.run(&command(start_v + step_v, 0.0));
            at.run(&command(start_v + 2.0 * step_v, 0.0));
            assert_clean(&at);
            at.run(&command(start_v + 3.01 * step_v, 0.0));
            assert_only(&at, Fault::MotorSlew);
        }
    }
}

#[test]
fn motor_slew_holds_in_the_first_tick_and_across_lost_frames() {
    let mut first = supervisor(Waveform::Square);
    first.run(&command(1.01 * SLEW_V, 0.0));
    assert_only(&first, Fault::MotorSlew);

    let mut later = active_at(Waveform::Square, 1.0);
    for _ in 0..5 {
        later.run(&Observation {
            measurement: None,
            ..command(1.0, 0.0)
        });
    }
    assert_clean(&later);
    later.run(&command(1.0 + 1.01 * SLEW_V, 0.0));
    assert_only(&later, Fault::MotorSlew);
}

/// The last numbers that pass, rounding included, and the first that do not.
#[test]
fn motor_limits_end_at_a_number() {
    let most_v = MOTOR_LIMIT_V * (1.0 + 1e-6);
    for (motor_v, is_fault) in [(most_v, false), (most_v.next_up(), true)] {
        let mut at = active_at(Waveform::Square, MOTOR_LIMIT_V);
        at.run(&command(motor_v, 0.0));
        assert_eq!(at.faults().contains(Fault::MotorVoltage), is_fault);
    }
    let most_change_v = 4.0 * (1.0 / 1000.0) + 1e-6 * MOTOR_LIMIT_V;
    for (motor_v, is_fault) in [(most_change_v, false), (most_change_v.next_up(), true)] {
        let mut at = supervisor(Waveform::Square);
        at.run(&command(motor_v, 0.0));
        assert_eq!(at.faults().contains(Fault::MotorSlew), is_fault);
    }
}

/// A controller at a limit that the gate passes exactly must be able to command it permanently.
#[test]
fn a_controller_at_the_limits_raises_no_alarm() {
    let mut supervisor = supervisor(Waveform::Square);
    let mut motor_v = 0.0_f32;
    let mut step_v = SLEW_V;
    for _ in 0..100_000 {
        if (motor_v + step_v).abs() > MOTOR_LIMIT_V {
            step_v = -step_v;
        }
        motor_v += step_v;
        supervisor.run(&command(motor_v, SQUARE_LIMIT_V));
    }
    assert_clean(&supervisor);
}

#[test]
fn sr01_dither_amplitude_has_a_limit_for_each_waveform() {
    for (waveform, limit_v) in [
        (Waveform::None, 0.0),
        (Waveform::Square, SQUARE_LIMIT_V),
        (Waveform::Sine, 1.3),
    ] {
        for good in [0.0, -0.0, 0.5 * limit_v, limit_v] {
            let mut supervisor = supervisor(waveform);
            let setpoint = supervisor.run(&command(0.0, good));
            assert_clean(&supervisor);
            assert_eq!(setpoint.dither_amplitude_v, good);
        }
        for bad in [limit_v * ABOVE + 1e-30, -1e-30, -limit_v, 1e30] {
            let mut supervisor = supervisor(waveform);
            supervisor.run(&command(0.0, if bad == 0.0 { -1.0 } else { bad }));
            assert_only(&supervisor, Fault::DitherCommand);
        }
    }
}

#[test]
fn a_command_that_is_no_number_is_named_as_that() {
    for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for observation in [command(bad, 0.0), command(0.0, bad), command(bad, bad)] {
            let mut supervisor = supervisor(Waveform::Sine);
            assert_eq!(supervisor.run(&observation), Setpoint::neutral());
            assert_only(&supervisor, Fault::CommandNotANumber);
        }
    }
}

#[test]
fn sr14_ticks_have_a_window() {
    let elapsed = |elapsed_counts| Observation {
        elapsed_counts,
        ..command(0.0, 0.0)
    };
    for good in [20_000, 20_001, 25_000, 29_999, 30_000] {
        let mut supervisor = active_at(Waveform::Square, 0.0);
        supervisor.run(&elapsed(good));
        assert_clean(&supervisor);
    }
    for bad in [0, 12_500, 19_999, 30_001, 50_000, u32::MAX] {
        let mut supervisor = active_at(Waveform::Square, 0.0);
        supervisor.run(&elapsed(bad));
        assert_only(&supervisor, Fault::TickWindow);
    }
}

#[test]
fn frames_grow_too_old() {
    let none = Observation {
        measurement: None,
        ..command(0.0, 0.0)
    };
    // The age that the frame had when it came counts too.
    for age_ticks in [1, 2, 5, 10] {
        let mut supervisor = active_at(Waveform::Square, 0.0);
        let aged = Observation {
            measurement_age_ticks: age_ticks,
            ..command(0.0, 0.0)
        };
        for _ in 0..3 {
            supervisor.run(&aged);
            for _ in age_ticks..10 {
                supervisor.run(&none);
            }
            assert_clean(&supervisor);
        }
        supervisor.run(&none);
        assert_only(&supervisor, Fault::FrameAge);
    }
    let mut supervisor = active_at(Waveform::Square, 0.0);
    supervisor.run(&Observation {
        measurement_age_ticks: 11,
        ..command(0.0, 0.0)
    });
    assert_only(&supervisor, Fault::FrameAge);
}

/// At any control rate there is room for a lost frame, and no age beyond that of a challenge.
#[test]
fn frame_age_is_cut_to_ticks_that_a_challenge_distinguishes() {
    let mut limits = Scenario::<f32>::reconstruction().gate;
    let ticks = [10.0, 299.0, 300.0, 1000.0, 1500.0, 1600.0, 1e4, 1e6]
        .map(|rate_hz| limits.frame_age_ticks(rate_hz));
    assert_eq!(ticks, [3, 3, 3, 10, 15, 15, 15, 15]);
    limits.frame_age_s = 1e-3;
    assert_eq!(limits.frame_age_ticks(1000.0), 3);
}

/// The age in ticks is the nearest to the limit in seconds, not one less by f32's rounding.
#[test]
fn frame_age_is_rounded_to_ticks() {
    for (age_s, rate_hz, ticks) in [(0.003, 1000.0, 3), (0.009, 1000.0, 9), (0.0126, 500.0, 6)] {
        let mut scenario = scenario(Waveform::Square);
        scenario.gate.frame_age_s = age_s;
        scenario.run.control_rate_hz = rate_hz;
        let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
        let elapsed_counts = CLOCK_HZ / rate_hz as u32;
        let tick = |measurement| Observation {
            elapsed_counts,
            measurement,
            ..command(0.0, 0.0)
        };
        supervisor.run(&tick(Some(calm())));
        for _ in 1..ticks {
            supervisor.run(&tick(None));
        }
        assert_clean(&supervisor);
        supervisor.run(&tick(None));
        assert_only(&supervisor, Fault::FrameAge);
    }
}

#[test]
fn what_is_found_outside_is_a_fault_in_every_mode() {
    for fault in Fault::ALL {
        let found = Observation {
            found_outside: fault.into(),
            ..command(0.0, 0.0)
        };
        let mut active = active_at(Waveform::Square, 0.0);
        active.run(&found);
        assert_only(&active, fault);
        let mut starting = supervisor(Waveform::Square);
        starting.run(&Observation {
            measurement: None,
            ..found
        });
        assert_only(&starting, fault);
    }
    // A bit without a name is a fault, too.
    let mut nameless = active_at(Waveform::Square, 0.0);
    nameless.run(&Observation {
        found_outside: Faults::from_bits(1 << 31),
        ..command(0.0, 0.0)
    });
    assert_eq!(nameless.mode(), Mode::Safe);
}

#[test]
fn sr07_an_impossible_measurement_is_a_fault_even_if_it_is_the_first() {
    for mut supervisor in [
        supervisor(Waveform::Square),
        active_at(Waveform::Square, 0.0),
    ] {
        let mut measurement = calm();
        measurement.current_request_a = 21.0;
        supervisor.run(&Observation {
            measurement: Some(measurement),
            ..command(0.0, 0.0)
        });
        assert_only(&supervisor, Fault::SensorRange);
    }
}

#[test]
fn the_gate_knows_the_vehicles_wheels() {
    let mut scenario = scenario(Waveform::Square);
    // 1750 rpm at 4 rad/s is 220 m/s^2 with this wheel, and more than the limit with a larger one.
    let mut measurement = calm();
    measurement.yaw_rate_rad_per_s = 4.0;
    let observation = Observation {
        measurement: Some(measurement),
        ..command(0.0, 0.0)
    };
    let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
    supervisor.run(&observation);
    assert_clean(&supervisor);
    scenario.vehicle.wheel_radius_m *= 1.2;
    let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
    supervisor.run(&observation);
    assert_only(&supervisor, Fault::LateralAcceleration);
}

/// After a fault of the servo: dither out in 0.1 s, motor at 4 V/s, then neutral whatever comes.
#[test]
fn sr02_sr03_safe_state_ramps_out_and_is_latched() {
    for (motor_v, amplitude_v) in [
        (3.0, 0.2),
        (-3.0, 0.1),
        (4.5, 0.2),
        (0.0, 0.15),
        (1e-3, 0.0),
    ] {
        let mut supervisor = active_at(Waveform::Square, motor_v);
        supervisor.run(&command(motor_v, amplitude_v));
        let mut last = supervisor.run(&Observation {
            found_outside: Fault::Readback.into(),
            ..command(motor_v, amplitude_v)
        });
        // The tick that finds the fault takes the first step.
        assert!((last.motor_v.abs() - (motor_v.abs() - SLEW_V).max(0.0)).abs() < 1e-6);
        assert!((last.dither_amplitude_v - (amplitude_v - 2e-3).max(0.0)).abs() < 1e-6);
        let (mut motor_ticks, mut dither_ticks) = (1, 1);
        for tick in 0..5000 {
            // Later commands and measurements have no effect.
            let any = match tick % 4 {
                0 => command(f32::NAN, f32::INFINITY),
                1 => command(-4.5, 0.2),
                2 => Observation {
                    elapsed_counts: 0,
                    measurement: None,
                    ..command(4.5, 0.0)
                },
                _ => Observation {
                    found_outside: Fault::ChannelsDiffer.into(),
                    ..command(0.0, 0.0)
                },
            };
            let now = supervisor.run(&any);
            let step_v = last.motor_v - now.motor_v;
            assert!(now.motor_v.abs() <= last.motor_v.abs());
            assert!(now.motor_v * last.motor_v >= 0.0, "no overshoot");
            assert!(step_v.abs() <= SLEW_V * 1.001);
            let drop_v = last.dither_amplitude_v - now.dither_amplitude_v;
            assert!((0.0..=2e-3 * 1.001).contains(&drop_v));
            motor_ticks += u32::from(last.motor_v != 0.0);
            dither_ticks += u32::from(last.dither_amplitude_v != 0.0);
            assert_only(&supervisor, Fault::Readback);
            assert_eq!(supervisor.wheel_speed_limit_rpm(), 1100.0);
            last = now;
        }
        assert_eq!(last, Setpoint::neutral());
        let motor_least = (motor_v.abs() / SLEW_V) as u32;
        assert!(
            (motor_least..=motor_least + 2).contains(&motor_ticks),
            "{motor_ticks}"
        );
        let dither_least = (amplitude_v / 2e-3) as u32;
        assert!(
            (dither_least..=dither_least + 2).contains(&dither_ticks),
            "{dither_ticks}"
        );
    }
}

/// The safe state's setpoint after its ramps, entered by a fault of an active ECU at that speed and
/// amplitude; a second fault may follow.
fn safe_setpoint(
    waveform: Waveform,
    speed_rpm: f32,
    amplitude_v: f32,
    faults: [Faults; 2],
) -> Setpoint<f32> {
    let mut supervisor = supervisor(waveform);
    let observation = |found_outside| Observation {
        measurement: Some(Measurement {
            wheel_speed_rpm: speed_rpm,
            ..calm()
        }),
        found_outside,
        ..command(0.0, amplitude_v)
    };
    supervisor.run(&observation(Faults::NONE));
    assert_clean(&supervisor);
    let mut last = supervisor.run(&observation(faults[0]));
    for tick in 0..500 {
        // The commands and measurements of a broken program have no effect.
        let found = if tick < 100 { faults[0] } else { faults[1] };
        let now = supervisor.run(&Observation {
            measurement: None,
            ..Observation {
                found_outside: found,
                ..command(f32::NAN, 1e9)
            }
        });
        let step_v = (now.dither_amplitude_v - last.dither_amplitude_v).abs();
        assert!(step_v <= 13e-3 * 1.001, "{step_v} V");
        last = now;
    }
    assert_eq!(supervisor.mode(), Mode::Safe);
    last
}

#[test]
fn sr04_the_safe_state_keeps_the_dither_unless_its_path_is_faulty() {
    let kept = [FaultClass::Sensor, FaultClass::Link, FaultClass::Command];
    for (waveform, limit_v, safe_v) in [
        (Waveform::None, 0.0, 0.0),
        (Waveform::Square, SQUARE_LIMIT_V, SAFE_SQUARE_V),
        (Waveform::Sine, 1.3, 1.1),
    ] {
        // From above and from below.
        for amplitude_v in [limit_v, 0.5 * safe_v] {
            for fault in Fault::ALL {
                let faults = [fault.into(); 2];
                let expected_v = if kept.contains(&fault.class()) {
                    safe_v
                } else {
                    0.0
                };
                let safe = safe_setpoint(waveform, 1750.0, amplitude_v, faults);
                assert_eq!(safe.motor_v, 0.0);
                assert_eq!(safe.dither_amplitude_v, expected_v, "{}", fault.name());
            }
        }
    }
}

#[test]
fn the_class_decides_on_the_dither() {
    let keeping = Faults::that_keep_dither();
    for fault in Fault::ALL {
        assert_eq!(keeping.contains(fault), fault.class().keeps_dither());
    }
    let kept = [FaultClass::Sensor, FaultClass::Link, FaultClass::Command];
    for class in FaultClass::ALL {
        assert_eq!(
            class.keeps_dither(),
            kept.contains(&class),
            "{}",
            class.name()
        );
        assert!(Fault::ALL.iter().any(|fault| fault.class() == class));
    }
}

/// A bit without a name may be anything.
#[test]
fn sr04_sr06_the_safe_state_ends_the_dither_at_a_later_fault_of_its_path() {
    let first = Faults::from(Fault::FrameAge);
    let nameless = Faults::from_bits(1 << 31);
    let others = Fault::ALL.into_iter().map(Faults::from).chain([nameless]);
    for other in others {
        let mut both = first;
        both |= other;
        let safe = safe_setpoint(Waveform::Square, 1750.0, 0.1, [first, both]);
        let is_kept = other.iter().any(|fault| fault.class().keeps_dither());
        assert_eq!(
            safe.dither_amplitude_v,
            if is_kept { SAFE_SQUARE_V } else { 0.0 }
        );
    }
}

/// As in all modes but the first, the time between two control ticks is judged.
#[test]
fn sr06_the_safe_state_judges_the_time() {
    let mut safe = active_at(Waveform::Square, 0.0);
    safe.run(&command(0.0, 0.1));
    for _ in 0..200 {
        safe.run(&command(f32::NAN, 0.0));
    }
    let late = Observation {
        elapsed_counts: 2 * TICK_COUNTS,
        ..command(0.0, 0.0)
    };
    let amplitudes_v = [command(0.0, 0.0), late, command(0.0, 0.0)]
        .map(|observation| safe.run(&observation).dither_amplitude_v);
    for (amplitude_v, expected_v) in amplitudes_v.into_iter().zip([0.125, 0.123, 0.121]) {
        assert!((amplitude_v - expected_v).abs() < 1e-6, "{amplitudes_v:?}");
    }
    assert!(safe.bridge_on(), "for the ramp");
    assert_only(&safe, Fault::CommandNotANumber);
}

/// At a low speed there is no dither to keep, and none before the first measurement.
#[test]
fn sr04_the_safe_state_begins_no_dither() {
    for fault in Fault::ALL {
        let safe = safe_setpoint(Waveform::Square, 1750.0, 0.0, [fault.into(); 2]);
        // Without this one it was not needed.
        let is_missing = fault == Fault::DitherWeak;
        let expected_v = if is_missing { SAFE_SQUARE_V } else { 0.0 };
        assert_eq!(safe.dither_amplitude_v, expected_v, "{}", fault.name());
    }
    let mut starting = supervisor(Waveform::Square);
    for _ in 0..200 {
        let setpoint = starting.run(&Observation {
            measurement: Some(Measurement {
                current_request_a: f32::NAN,
                ..calm()
            }),
            ..command(0.0, 0.1)
        });
        assert_eq!(setpoint, Setpoint::neutral());
    }
    assert_only(&starting, Fault::SensorNotANumber);
}

/// Ticks from the start of the dither until an amplitude at a speed is found too weak.
fn weak_after(waveform: Waveform, speed_rpm: f32, amplitude_v: f32) -> Option<u32> {
    let mut scenario = scenario(waveform);
    scenario.dither.start_time_s = 0.3;
    let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
    let observation = Observation {
        measurement: Some(Measurement {
            wheel_speed_rpm: speed_rpm,
            ..calm()
        }),
        ..command(0.0, amplitude_v)
    };
    for tick in 0..3000 {
        supervisor.run(&observation);
        if supervisor.mode() == Mode::Safe {
            assert_only(&supervisor, Fault::DitherWeak);
            return Some(tick - 300);
        }
    }
    None
}

/// Amplitudes down to zero at a speed that needs dither, after its start and the time of its ramp.
#[test]
fn sr11_dither_that_is_too_weak_is_a_fault() {
    for (waveform, least_v) in [(Waveform::Square, 0.1_f32), (Waveform::Sine, 0.9)] {
        for weak_v in [0.0, 0.5 * least_v, least_v.next_down()] {
            for speed_rpm in [1575.0_f32.next_up(), 1750.0, 2500.0, 3000.0] {
                // 0.7 s; the tick that finds it is the next one.
                assert_eq!(weak_after(waveform, speed_rpm, weak_v), Some(701));
            }
            for speed_rpm in [0.0, 1000.0, 1575.0] {
                assert_eq!(weak_after(waveform, speed_rpm, weak_v), None);
            }
        }
        assert_eq!(weak_after(waveform, 1750.0, least_v), None);
    }
    assert_eq!(weak_after(Waveform::None, 1750.0, 0.0), None);
}

/// The time without dither counts from the last sufficient amplitude, also across lost frames.
#[test]
fn weak_dither_counts_while_it_lasts() {
    let mut scenario = scenario(Waveform::Square);
    scenario.dither.start_time_s = 0.0;
    let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
    for _ in 0..5 {
        for tick in 0..700 {
            supervisor.run(&Observation {
                measurement: (tick % 5 == 0).then(calm),
                ..command(0.0, 0.0)
            });
        }
        assert_clean(&supervisor);
        supervisor.run(&command(0.0, 0.1));
    }
    for _ in 0..701 {
        supervisor.run(&command(0.0, 0.0));
    }
    assert_only(&supervisor, Fault::DitherWeak);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// The gate passes the controller's dither at any speeds: through the hysteresis, during the ramps,
    /// after a late start.
    #[test]
    fn the_controllers_dither_is_never_too_weak(
        legs in prop::collection::vec((1400.0_f32..2100.0, 1.0_f32..20.0, 0_u32..1500), 1..12),
        is_sine: bool,
        start_time_s in 0.0_f32..3.0,
    ) {
        let mut scenario = scenario(if is_sine { Waveform::Sine } else { Waveform::Square });
        scenario.dither.start_time_s = start_time_s;
        let mut controller = Controller::new(&scenario);
        let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
        let mut speed_rpm = 1400.0_f32;
        for (target_rpm, step_rpm, ticks) in legs {
            for _ in 0..ticks {
                speed_rpm += (target_rpm - speed_rpm).clamp(-step_rpm, step_rpm);
                let measurement = Measurement { wheel_speed_rpm: speed_rpm, ..calm() };
                let given = controller.run(&measurement, true);
                supervisor.run(&Observation {
                    measurement: Some(measurement),
                    ..command(given.motor_v, given.dither_amplitude_v)
                });
                prop_assert!(supervisor.faults().is_empty(), "{:?}", supervisor.faults());
            }
        }
    }
}

/// The bridge is off from the tick on in which the pin or a channel is wrong, in every mode, and
/// stays off. Other faults leave it on for the ramp.
#[test]
fn sr05_the_bridge_goes_off_where_a_ramp_cannot_be_trusted() {
    for fault in Fault::ALL {
        let is_off = matches!(fault, Fault::Readback | Fault::ChannelsDiffer);
        let mut active = active_at(Waveform::Square, 1.0);
        assert!(active.bridge_on());
        // What caused the safe state is still found in the next ticks.
        let found = Observation {
            found_outside: fault.into(),
            ..command(1.0, 0.0)
        };
        for _ in 0..10 {
            active.run(&found);
            assert_eq!(active.bridge_on(), !is_off, "{}", fault.name());
        }
        active.run(&command(0.0, 0.0));
        assert_eq!(active.bridge_on(), !is_off, "{}", fault.name());
        assert_only(&active, fault);
    }
}

/// In the safe state a fault of the servo's path that was not known before switches the bridge off;
/// the faults that caused the safe state stay as they were.
#[test]
fn sr06_the_safe_state_judges_the_servo() {
    let servo = [
        Fault::Readback,
        Fault::ChannelsDiffer,
        Fault::DitherAmplitude,
        Fault::DitherFrequency,
    ];
    for fault in Fault::ALL
        .into_iter()
        .filter(|&fault| fault != Fault::SensorRange)
    {
        let mut safe = active_at(Waveform::Square, 1.0);
        let mut found = Faults::from(Fault::SensorRange);
        for _ in 0..10 {
            safe.run(&Observation {
                found_outside: found,
                ..command(1.0, 0.0)
            });
            assert!(safe.bridge_on());
        }
        found |= fault;
        safe.run(&Observation {
            found_outside: found,
            ..command(1.0, 0.0)
        });
        assert_eq!(
            safe.bridge_on(),
            !servo.contains(&fault),
            "{}",
            fault.name()
        );
        assert_only(&safe, Fault::SensorRange);
    }
}

#[test]
fn overspeed_is_no_fault() {
    let mut supervisor = active_at(Waveform::None, 0.0);
    for (wheel_speed_rpm, is_overspeed) in [
        (2490.0, false),
        (2500.0, false),
        (2500.0_f32.next_up(), true),
        (2510.0, true),
    ] {
        let mut fast = active_at(Waveform::None, 0.0);
        let measurement = Measurement {
            wheel_speed_rpm,
            ..calm()
        };
        assert_eq!(fast.is_overspeed(&measurement), is_overspeed);
        fast = Supervisor::new(&scenario(Waveform::None), CLOCK_HZ);
        fast.run(&Observation {
            measurement: Some(measurement),
            ..command(0.0, 0.0)
        });
        assert_clean(&fast);
        assert_eq!(fast.wheel_speed_limit_rpm(), 2500.0);
    }
    supervisor.run(&command(f32::NAN, 0.0));
    assert!(
        !supervisor.is_overspeed(&calm()),
        "of the vehicle's limit, not the safe state's"
    );
}

#[test]
fn a_restart_forgets_the_fault() {
    let mut stopped = active_at(Waveform::Square, 0.0);
    stopped.run(&command(f32::NAN, 0.0));
    assert_eq!(stopped.mode(), Mode::Safe);
    assert_clean(&active_at(Waveform::Square, 0.0));
}

/// Rates other than the preset's scale the changes in a tick.
#[test]
fn limits_are_by_time_not_by_tick() {
    let mut scenario = scenario(Waveform::Sine);
    scenario.run.control_rate_hz = 100.0;
    let ten_times = Observation {
        elapsed_counts: 10 * TICK_COUNTS,
        ..command(10.0 * SLEW_V, 1.3)
    };
    let mut supervisor = Supervisor::new(&scenario, CLOCK_HZ);
    supervisor.run(&ten_times);
    supervisor.run(&ten_times);
    assert_clean(&supervisor);
    let fault = Observation {
        found_outside: Fault::Readback.into(),
        ..ten_times
    };
    let setpoint = supervisor.run(&fault);
    assert!(setpoint.motor_v.abs() < 1e-6);
    assert!((setpoint.dither_amplitude_v - 1.3 * 0.9).abs() < 1e-6);
}

fn any_f32() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        -5.0_f32..5.0,
        -0.005_f32..0.005,
        Just(0.0)
    ]
}

prop_compose! {
    fn any_observation()(
        elapsed_counts in prop_oneof![9 => Just(TICK_COUNTS), 1 => any::<u32>()],
        measurement in prop_oneof![
            8 => Just(Some(calm())),
            1 => Just(None),
            1 => any_f32().prop_map(|yaw_rate_rad_per_s| Some(Measurement { yaw_rate_rad_per_s, ..calm() })),
        ],
        motor_v in any_f32(),
        feedback_v in prop_oneof![10 => Just(0.0), 1 => any_f32()],
        dither_amplitude_v in any_f32(),
        is_change in any::<bool>(),
        bits in prop_oneof![20 => Just(0), 1 => any::<u32>()],
    ) -> (Observation<f32>, bool) {
        let found_outside = Faults::from_bits(bits);
        (Observation { elapsed_counts, measurement, measurement_age_ticks: 1, motor_v, feedback_v, dither_amplitude_v, found_outside }, is_change)
    }
}

proptest! {
    /// Whatever is commanded: limits hold in every tick, and a fault ends for good in a motor without
    /// voltage and in the safe state's dither or none.
    #[test]
    fn sr01_nothing_gets_past(observations in prop::collection::vec(any_observation(), 1..60)) {
        let mut supervisor = supervisor(Waveform::Square);
        let mut last = Setpoint::<f32>::neutral();
        for (observation, is_change) in &observations {
            let mut observation = *observation;
            // Half of the commands are changes, so that some sequences stay within the slew limit.
            if *is_change {
                observation.motor_v = last.motor_v + observation.motor_v.clamp(-SLEW_V, SLEW_V);
                observation.dither_amplitude_v = observation.dither_amplitude_v.clamp(0.0, SQUARE_LIMIT_V);
            }
            let was_safe = supervisor.mode() == Mode::Safe;
            let now: Setpoint<f32> = supervisor.run(&observation);
            prop_assert!(now.motor_v.abs() <= MOTOR_LIMIT_V * ABOVE);
            prop_assert!((now.motor_v - last.motor_v).abs() <= SLEW_V * 1.01);
            prop_assert!((0.0..=SQUARE_LIMIT_V * ABOVE).contains(&now.dither_amplitude_v));
            prop_assert_eq!(supervisor.mode() == Mode::Safe, !supervisor.faults().is_empty());
            if was_safe {
                prop_assert_eq!(supervisor.mode(), Mode::Safe);
                prop_assert!(now.motor_v.abs() <= last.motor_v.abs());
                let step_v = (now.dither_amplitude_v - last.dither_amplitude_v).abs();
                prop_assert!(step_v <= 2e-3 * 1.001);
            }
            last = now;
        }
        supervisor.run(&command(f32::NAN, f32::NAN));
        for _ in 0..1126 {
            last = supervisor.run(&command(f32::NAN, f32::NAN));
        }
        prop_assert_eq!(last.motor_v, 0.0);
        let is_kept = supervisor.faults().iter().all(|fault| fault.class().keeps_dither());
        prop_assert!(last.dither_amplitude_v == 0.0 || is_kept && last.dither_amplitude_v == SAFE_SQUARE_V);
    }
}

/// A set has the faults that it is made of, and no other.
#[test]
fn a_set_of_faults_has_those_that_it_is_made_of() {
    let all = Fault::ALL.into_iter();
    for (one, other) in all
        .clone()
        .flat_map(|one| all.clone().map(move |other| (one, other)))
    {
        let set = Faults::of([one, other]);
        for fault in Fault::ALL {
            assert_eq!(set.contains(fault), fault == one || fault == other);
        }
    }
}
