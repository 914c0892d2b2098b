//! Delayed feedback: multipliers by power iteration against continuation and simulation.

use dynamics::component::Component;
use dynamics::delayed_feedback::{
    Conditions, Feedback, Linearised, Mixed, Plan, over_speed, simulate,
};
use dynamics::sweep::{RunControl, Values};
use shared_model::Scenario;

const CONDITIONS: Conditions = Conditions {
    free_s: 100.0,
    time_s: 300.0,
    noise: 0.0,
};

fn at(rpm: f64) -> (Scenario<f64>, Linearised) {
    let mut scenario = Scenario::reconstruction();
    scenario.run.wheel_speed_rpm = rpm;
    let orbit = Linearised::of(&scenario).expect("there is an orbit of one cycle");
    (scenario, orbit)
}

fn feedback(orbit: &Linearised, gain: f64) -> Feedback {
    Feedback {
        component: Component::YAW_RATE,
        mixed: None,
        gain,
        delay_s: orbit.period_s,
        memory: 0.0,
        limit_nm: 8.0,
        adaptation: 0.0,
        latency_ticks: 0,
    }
}

/// Without gain the fixed-step map along the orbit has the multiplier that shooting finds by another integrator.
#[test]
fn without_gain_the_multiplier_is_that_of_the_orbit() {
    for rpm in [1700.0, 1750.0, 1800.0] {
        let (_, orbit) = at(rpm);
        let found = orbit.greatest_multiplier(&feedback(&orbit, 0.0));
        let free = orbit.free_multiplier.abs();
        // The instants of stick and slip, by linear interpolation in steps of 0.1 ms.
        assert!((found / free - 1.0).abs() < 2e-3, "{rpm}: {found} {free}");
    }
}

/// The torque of a simulation falls from period to period by the multiplier.
#[test]
fn a_simulation_decays_by_the_multiplier() {
    let (scenario, orbit) = at(1750.0);
    // Slowly enough to be measured before the error of the interpolated delay is all that is left.
    let feedback = feedback(&orbit, 3.5);
    let multiplier = orbit.greatest_multiplier(&feedback);
    let peak_nm = |periods: f64| {
        let conditions = Conditions {
            free_s: 50.0,
            time_s: 70.0 + periods * orbit.period_s,
            noise: 0.0,
        };
        // That at the begin of the last minute.
        simulate(&scenario, &feedback, &conditions).torque_peak_nm
    };
    let (first, last) = (10.0, 50.0);
    let measured = (peak_nm(last) / peak_nm(first)).powf(1.0 / (last - first));
    assert!((0.9..1.0).contains(&multiplier), "{multiplier}");
    assert!(
        (measured - multiplier).abs() < 5e-4,
        "{measured} {multiplier}"
    );
}

/// Below the least holding gain the simulation stays chaotic, above it is held with hardly any torque.
#[test]
fn the_least_gain_divides_held_from_chaotic() {
    let (scenario, orbit) = at(1750.0);
    for (gain, is_held) in [(2.5, false), (4.5, true), (6.0, true)] {
        let feedback = feedback(&orbit, gain);
        assert_eq!(
            orbit.greatest_multiplier(&feedback) < 1.0,
            is_held,
            "{gain}"
        );
        let held = simulate(&scenario, &feedback, &CONDITIONS);
        assert_eq!(held.capture_s.is_some(), is_held, "{gain}: {held:?}");
        assert_eq!(held.torque_rms_nm < 1e-3, is_held, "{gain}: {held:?}");
        // The held orbit is as large as the chaotic motion.
        let (low, high) = held.yaw_rates_rad_per_s.unwrap();
        assert!(high - low > 2.0, "{held:?}");
    }
}

/// The torque that an error of the delay leaves is gone after the delay has adapted.
#[test]
fn the_delay_adapts_to_the_period_of_the_orbit() {
    let (scenario, orbit) = at(1750.0);
    let wrong = Feedback {
        delay_s: orbit.period_s + 0.01,
        ..feedback(&orbit, 6.0)
    };
    let stays = simulate(&scenario, &wrong, &CONDITIONS);
    assert!((0.3..1.0).contains(&stays.torque_rms_nm), "{stays:?}");
    let adapting = Feedback {
        adaptation: 1.0,
        ..wrong
    };
    let adapted = simulate(&scenario, &adapting, &CONDITIONS);
    assert!(adapted.torque_rms_nm < 1e-3, "{adapted:?}");
    let delay_s = adapted.delay_s.unwrap();
    assert!((delay_s - orbit.period_s).abs() < 1e-4, "{adapted:?}");
}

/// A gain so great that numbers overflow is not taken for one that leaves nothing of a perturbation.
#[test]
fn an_overflow_is_no_decay() {
    let (_, orbit) = at(1750.0);
    for gain in [1e4, 1e200, -1e300] {
        let found = orbit.greatest_multiplier(&feedback(&orbit, gain));
        assert!(found > 1.0, "{gain}: {found}");
    }
}

/// No torque, no hold; the limit is kept.
#[test]
fn the_limit_is_kept() {
    let (scenario, orbit) = at(1750.0);
    for limit_nm in [0.0, 2.0] {
        let limited = Feedback {
            limit_nm,
            ..feedback(&orbit, 2.0)
        };
        let held = simulate(&scenario, &limited, &CONDITIONS);
        assert!(held.torque_peak_nm <= limit_nm, "{held:?}");
        assert!(
            limit_nm == 0.0 || held.torque_peak_nm == limit_nm,
            "{held:?}"
        );
    }
}

/// A mix of signals is their weighted sum: the same gain in other shares gives the same multiplier.
#[test]
fn a_mix_of_signals_is_their_weighted_sum() {
    let (_, orbit) = at(1750.0);
    let mixed = |component, other, weight| Feedback {
        component,
        mixed: Some(Mixed {
            component: other,
            weight,
        }),
        ..feedback(&orbit, 0.0)
    };
    let [yaw, steering] = [Component::YAW_RATE, Component::STEERING_RATE];
    let at_gain = |gain, feedback| orbit.greatest_multiplier(&Feedback { gain, ..feedback });
    let one = at_gain(6.0, mixed(yaw, steering, -0.5));
    let same = at_gain(-3.0, mixed(steering, yaw, -2.0));
    assert!((one - same).abs() < 1e-9, "{one} {same}");
    let alone = at_gain(6.0, feedback(&orbit, 0.0));
    assert!((one - alone).abs() > 1e-3, "{one} {alone}");
    let without = at_gain(6.0, mixed(yaw, steering, 0.0));
    assert_eq!(without, alone);
}

/// The whole state leads the chaos to rest with a limited torque, and no torque does not.
#[test]
fn feedback_of_the_whole_state_leads_to_rest() {
    let scenario = Scenario::reconstruction();
    let speeds = Values::new("wheel speed (rpm)", 1700.0, 1950.0, 125.0).unwrap();
    let yaw_rate = feedback(&at(1750.0).1, 0.0);
    let at_limit = |limit_nm| {
        let mut plan = Plan {
            feedback: Feedback {
                limit_nm,
                ..yaw_rate
            },
            gains: Values::new("gain", 4.0, 4.0, 1.0).unwrap(),
            delay_error_s: 0.0,
            conditions: CONDITIONS,
        };
        plan.conditions.time_s = 150.0;
        let control = RunControl::none();
        over_speed(&scenario, &speeds, &plan, &scenario, control).unwrap()
    };
    for (limit_nm, wanted) in [
        (0.0, [false, false, false]),
        (8.0, [true, true, false]),
        (16.0, [true, true, true]),
    ] {
        let points = at_limit(limit_nm).into_iter().map(|point| point.unwrap());
        for (point, at_rest) in points.zip(wanted) {
            let (rpm, held) = (point.wheel_speed_rpm, point.to_rest);
            let (low, high) = held.yaw_rates_rad_per_s.unwrap();
            assert_eq!(held.capture_s.is_some(), at_rest, "{rpm}: {held:?}");
            assert_eq!(high - low < 1e-3, at_rest, "{rpm}: {held:?}");
            assert!(held.torque_peak_nm <= limit_nm, "{rpm}: {held:?}");
            // Friction holds the steering.
            assert!(!at_rest || held.torque_rms_nm < 0.5, "{rpm}: {held:?}");
        }
    }
}
