//! The gate's sensors: every limit from both sides, and each fault by itself.

use shared_model::Scenario;
use shared_model::gate::{Fault, Faults, Limits, Plausibility};
use shared_model::signal::Measurement;

const TICK_S: f32 = 1e-3;
/// Of a wheel of 0.3 m, m/s at 1 rpm.
const SPEED_PER_RPM: f32 = 0.031_415_93;

type Signal = fn(&mut Measurement<f32>) -> &mut f32;
const WHEEL_SPEED: Signal = |m| &mut m.wheel_speed_rpm;
const YAW_RATE: Signal = |m| &mut m.yaw_rate_rad_per_s;
const ANGLE: Signal = |m| &mut m.steering_angle_rad;
const RATE: Signal = |m| &mut m.steering_rate_rad_per_s;
const REQUEST: Signal = |m| &mut m.current_request_a;
const ALL: [Signal; 5] = [WHEEL_SPEED, YAW_RATE, ANGLE, RATE, REQUEST];

fn limits() -> Limits<f32> {
    Limits::reconstruction()
}

fn watch(limits: &Limits<f32>) -> Plausibility<f32> {
    Plausibility::new(limits, TICK_S, SPEED_PER_RPM)
}

fn at_rest() -> Measurement<f32> {
    Measurement {
        wheel_speed_rpm: 0.0,
        yaw_rate_rad_per_s: 0.0,
        steering_angle_rad: 0.0,
        steering_rate_rad_per_s: 0.0,
        current_request_a: 0.0,
    }
}

fn with(mut measurement: Measurement<f32>, signal: Signal, value: f32) -> Measurement<f32> {
    *signal(&mut measurement) = value;
    measurement
}

/// Faults of a first measurement.
fn first(measurement: Measurement<f32>) -> Faults {
    watch(&limits()).check(Some(&measurement))
}

fn only(fault: Fault) -> Faults {
    fault.into()
}

#[test]
fn the_vehicles_speed_is_the_wheels() {
    let scenario = Scenario::<f32>::reconstruction();
    let speed_m_per_s = scenario.vehicle.speed_m_per_s(1.0);
    assert!((speed_m_per_s - SPEED_PER_RPM).abs() < 1e-8);
}

#[test]
fn no_measurement_is_no_fault() {
    let mut watch = watch(&limits());
    for _ in 0..100 {
        assert_eq!(watch.check(None), Faults::NONE);
    }
    assert_eq!(watch.check(Some(&at_rest())), Faults::NONE);
}

#[test]
fn sr07_ranges_end_at_their_limits() {
    let limits = limits();
    for (signal, limit) in [
        (YAW_RATE, limits.yaw_rate_rad_per_s),
        (ANGLE, limits.steering_angle_rad),
        (RATE, limits.steering_rate_rad_per_s),
        (REQUEST, limits.current_request_a),
    ] {
        for sign in [1.0, -1.0] {
            assert_eq!(first(with(at_rest(), signal, sign * limit)), Faults::NONE);
            let above = sign * limit.next_up();
            assert_eq!(
                first(with(at_rest(), signal, above)),
                only(Fault::SensorRange)
            );
        }
    }
    let wheel_speed = |rpm: f32| first(with(at_rest(), WHEEL_SPEED, rpm));
    for good in [0.0, -0.0, f32::MIN_POSITIVE, 2500.0, 2501.0, 4000.0] {
        assert_eq!(wheel_speed(good), Faults::NONE);
    }
    for bad in [-f32::MIN_POSITIVE, -1.0, 4000.0_f32.next_up(), f32::MAX] {
        assert_eq!(wheel_speed(bad), only(Fault::SensorRange));
    }
}

#[test]
fn sr07_what_is_no_number_is_named_as_that_alone() {
    let largest_subnormal = f32::MIN_POSITIVE.next_down();
    for signal in ALL {
        for bad in [
            f32::NAN,
            f32::INFINITY,
            largest_subnormal,
            f32::from_bits(1),
        ] {
            for bad in [bad, -bad] {
                let measurement = with(at_rest(), signal, bad);
                assert_eq!(first(measurement), only(Fault::SensorNotANumber));
                let mut later = watch(&limits());
                assert_eq!(later.check(Some(&at_rest())), Faults::NONE);
                assert_eq!(
                    later.check(Some(&measurement)),
                    only(Fault::SensorNotANumber)
                );
            }
        }
        assert_eq!(
            first(with(at_rest(), signal, f32::MIN_POSITIVE)),
            Faults::NONE
        );
        assert_eq!(first(with(at_rest(), signal, -0.0)), Faults::NONE);
    }
}

/// After `ticks` ticks a signal may have moved that many times as far, either way.
#[test]
fn changes_are_limited_by_time() {
    let mut limits = limits();
    // This test is about the changes alone.
    limits.steering_contradiction_rad = 10.0;
    for (signal, start, per_s) in [
        (WHEEL_SPEED, 1000.0, limits.wheel_acceleration_rpm_per_s),
        (YAW_RATE, 0.5, limits.yaw_acceleration_rad_per_s2),
        (ANGLE, 0.1, limits.steering_angle_change_rad_per_s),
        (RATE, 0.5, limits.steering_acceleration_rad_per_s2),
    ] {
        for (ticks, sign) in [(1, 1.0), (1, -1.0), (2, 1.0), (3, -1.0), (7, 1.0)] {
            let change = sign * per_s * TICK_S * ticks as f32;
            let after = |change: f32| {
                let mut watch = watch(&limits);
                watch.check(None);
                assert_eq!(
                    watch.check(Some(&with(at_rest(), signal, start))),
                    Faults::NONE
                );
                for _ in 1..ticks {
                    assert_eq!(watch.check(None), Faults::NONE);
                }
                watch.check(Some(&with(at_rest(), signal, start + change)))
            };
            assert_eq!(after(0.999 * change), Faults::NONE, "{ticks} ticks");
            assert_eq!(
                after(1.001 * change),
                only(Fault::SensorRate),
                "{ticks} ticks"
            );
        }
    }
}

/// Each measurement is held against the one before, not against the first.
#[test]
fn changes_add_up_over_ticks() {
    let mut watch = watch(&limits());
    for tick in 0..100 {
        let measurement = with(at_rest(), WHEEL_SPEED, 19.0 * tick as f32);
        assert_eq!(watch.check(Some(&measurement)), Faults::NONE);
    }
}

#[test]
fn the_drivers_request_may_step() {
    let mut watch = watch(&limits());
    for request_a in [20.0, -20.0, 0.0, 20.0] {
        let measurement = with(at_rest(), REQUEST, request_a);
        assert_eq!(watch.check(Some(&measurement)), Faults::NONE);
    }
}

#[test]
fn speed_and_yaw_rate_fit_the_road() {
    // 250 m/s^2 at 2500 rpm (78.5 m/s).
    for (yaw_rate, wheel_speed) in [(3.183, 2500.0), (4.0, 1989.0), (0.1, 2500.0)] {
        for sign in [1.0, -1.0] {
            let measurement = with(
                with(at_rest(), YAW_RATE, sign * yaw_rate),
                WHEEL_SPEED,
                wheel_speed,
            );
            assert_eq!(first(measurement), Faults::NONE);
        }
    }
    for (yaw_rate, wheel_speed) in [(3.184, 2500.0), (4.0, 1990.0)] {
        for sign in [1.0, -1.0] {
            let measurement = with(
                with(at_rest(), YAW_RATE, sign * yaw_rate),
                WHEEL_SPEED,
                wheel_speed,
            );
            assert_eq!(first(measurement), only(Fault::LateralAcceleration));
        }
    }
}

/// The steering turns at 1 rad/s in steps of a tick, the yaw rate as given; returns the tick at
/// which something is found.
fn turned(wheel_speed_rpm: f32, sign: f32, yaw_rate: impl Fn(u32) -> f32) -> Option<(u32, Faults)> {
    let mut watch = watch(&limits());
    (0..1000).find_map(|tick| {
        let measurement = Measurement {
            wheel_speed_rpm,
            yaw_rate_rad_per_s: yaw_rate(tick),
            steering_angle_rad: sign * (tick as f32 * 1e-3 - 0.5),
            steering_rate_rad_per_s: sign,
            current_request_a: 10.0,
        };
        let faults = watch.check(Some(&measurement));
        (!faults.is_empty()).then_some((tick, faults))
    })
}

#[test]
fn a_yaw_rate_that_keeps_its_value_is_stuck() {
    for sign in [1.0, -1.0] {
        let found = turned(1750.0, sign, |_| 0.3);
        let (tick, faults) = found.unwrap();
        assert_eq!(faults, only(Fault::SensorStuck));
        assert!((200..=201).contains(&tick), "{tick}");
        // Stuck from a moment on: it is the movement since then that counts.
        let found = turned(1750.0, sign, |tick| 0.3 + 1e-6 * tick.min(300) as f32);
        let (tick, faults) = found.unwrap();
        assert_eq!(faults, only(Fault::SensorStuck));
        assert!((500..=501).contains(&tick), "{tick}");
        assert_eq!(
            turned(1750.0, sign, |tick| 0.3 + 1e-5 * (tick / 190) as f32),
            None
        );
    }
}

#[test]
fn steering_on_the_spot_is_not_stuck() {
    assert_eq!(turned(0.0, 1.0, |_| 0.0), None);
    assert_eq!(turned(100.0, 1.0, |_| 0.0), None);
    let (_, faults) = turned(100.0_f32.next_up(), 1.0, |_| 0.0).unwrap();
    assert_eq!(faults, only(Fault::SensorStuck));
}

/// At rest a coarse yaw rate keeps its value for ever, while the steering angle's noise does not.
#[test]
fn noise_is_no_movement() {
    let mut watch = watch(&limits());
    for tick in 0..1_000_000 {
        let mut measurement = with(
            at_rest(),
            ANGLE,
            0.1 + if tick % 2 == 0 { 2e-3 } else { -2e-3 },
        );
        measurement.wheel_speed_rpm = 1750.0;
        assert_eq!(watch.check(Some(&measurement)), Faults::NONE);
    }
}

/// A steering rate that is off by `offset`, the steering at rest; found at some tick?
fn contradiction(offset: f32, ticks_a_measurement: u32) -> Option<Faults> {
    let mut watch = watch(&limits());
    (0..20_000).find_map(|tick: u32| {
        let measurement = with(at_rest(), RATE, offset);
        let is_new = tick.is_multiple_of(ticks_a_measurement);
        let faults = watch.check(is_new.then_some(&measurement));
        (!faults.is_empty()).then_some(faults)
    })
}

/// 0.05 rad over a memory of 0.2 s: an offset of 0.25 rad/s.
#[test]
fn angle_and_rate_must_not_contradict_each_other() {
    for sign in [1.0, -1.0] {
        for ticks in [1, 5] {
            assert_eq!(contradiction(sign * 0.24, ticks), None);
            let inconsistent = Some(only(Fault::SteeringInconsistent));
            assert_eq!(contradiction(sign * 0.26, ticks), inconsistent);
        }
    }
    // Angle that moves at constant speed while the rate is zero.
    let mut watch = watch(&limits());
    let found = (0..1000).map(|tick| {
        let measurement = with(at_rest(), ANGLE, 1e-3 * tick as f32);
        watch.check(Some(&measurement))
    });
    let found = found.into_iter().find(|faults| !faults.is_empty());
    assert_eq!(found, Some(only(Fault::SteeringInconsistent)));
}

/// The mean of the rates at both ends is what moves the angle.
#[test]
fn a_true_motion_contradicts_nothing() {
    let mut watch = watch(&limits());
    for tick in 0..20_000 {
        let time_s = f64::from(tick) * 1e-3;
        let mut measurement = with(at_rest(), ANGLE, (0.5 * libm::sin(3.0 * time_s)) as f32);
        measurement.steering_rate_rad_per_s = (1.5 * libm::cos(3.0 * time_s)) as f32;
        // One measurement in four is lost.
        let measurement = (tick % 4 != 0).then_some(&measurement);
        assert_eq!(watch.check(measurement), Faults::NONE);
    }
}

/// One contradiction is forgotten before the next.
#[test]
fn contradictions_fade() {
    let mut watch = watch(&limits());
    for tick in 0..5000 {
        // A step of 0.018 rad each 0.4 s without any rate.
        let angle = 0.018 * (tick / 400) as f32;
        assert_eq!(
            watch.check(Some(&with(at_rest(), ANGLE, angle))),
            Faults::NONE
        );
    }
}

/// A memory that is shorter than the time between two measurements forgets, and does not swing up.
#[test]
fn a_short_memory_is_stable() {
    let mut limits = limits();
    limits.steering_memory_s = 0.01;
    let mut watch = Plausibility::new(&limits, 0.1, SPEED_PER_RPM);
    for tick in 0..1000 {
        let angle = if tick % 2 == 0 { 0.01 } else { -0.01 };
        assert_eq!(
            watch.check(Some(&with(at_rest(), ANGLE, angle))),
            Faults::NONE
        );
    }
}
