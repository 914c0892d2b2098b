//! Dry friction: the sign function under dither against brute force, its events, work and stick.

use proptest::prelude::*;
use shared_model::dither::{Application, Injection, Waveform};
use shared_model::friction::{FrictionLaw, FrictionMode, Sign};
use shared_model::vehicle::{Model, STEERING_ANGLE, STEERING_RATE, State};
use shared_model::{Real, Scenario, integrate};
use std::f64::consts::TAU;

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn injection() -> impl Strategy<Value = Injection<f64>> {
    prop_oneof![
        Just(Injection::Off),
        (0.0..1.0_f64).prop_map(|amplitude| Injection::SquareMean { amplitude }),
        (0.0..1.0_f64).prop_map(|amplitude| Injection::SineMean { amplitude }),
        (-1.0..1.0_f64).prop_map(|offset| Injection::Shift { offset }),
    ]
}

/// The same dither seen from the other side.
fn mirrored(injection: Injection<f64>) -> Injection<f64> {
    match injection {
        Injection::Shift { offset } => Injection::Shift { offset: -offset },
        symmetric => symmetric,
    }
}

prop_compose! {
    /// A run with dry friction that the dither reaches only through its mean, if at all.
    fn scenario()(
        law in prop::sample::select(vec![FrictionLaw::CoulombRate, FrictionLaw::PrintedAngle]),
        dithered: bool,
        waveform in prop::sample::select(vec![Waveform::None, Waveform::Square, Waveform::Sine]),
        // At the steering rate's sign 0.02 rad/s and more: a square wave of less has its two steps so near to each other
        // that one integration step may pass both.
        amplitude_v in prop_oneof![Just(0.0), 1e-5..1e-3_f64, 1e-3..0.2_f64],
        wheel_speed_rpm in 800.0..2000.0_f64,
        x in (-0.2..0.2_f64, -0.5..0.5_f64, -0.5..0.5_f64, -0.5..0.5_f64),
    ) -> Scenario<f64> {
        let mut scenario = Scenario::reconstruction();
        (scenario.friction.law, scenario.friction.dithered) = (law, dithered);
        (scenario.dither.waveform, scenario.dither.amplitude_v) = (waveform, amplitude_v);
        let run = &mut scenario.run;
        run.wheel_speed_rpm = wheel_speed_rpm;
        (run.sideslip_rad, run.yaw_rate_rad_per_s, run.steering_angle_rad, run.steering_rate_rad_per_s) = x;
        scenario
    }
}

proptest! {
    #![proptest_config(cases(256))]

    /// (21) and (27) against the mean of the sign itself. Of equally spaced points each of the two sign changes misplaces
    /// at most one, which makes 2/points of difference.
    #[test]
    fn mean_sign_is_the_mean_of_the_sign(u in -1.5..1.5_f64, amplitude in 1e-3..1.0_f64) {
        const POINTS: u32 = 20_000;
        let mean = |wave: fn(f64) -> f64| {
            let at = |k: u32| (u + amplitude * wave((f64::from(k) + 0.5) / f64::from(POINTS) * TAU)).signum();
            (0..POINTS).map(at).sum::<f64>() / f64::from(POINTS)
        };
        let sine = Sign::new(Injection::SineMean { amplitude }).at(u);
        prop_assert!((sine - mean(libm::sin)).abs() <= 4.0 / f64::from(POINTS));
        let square = Sign::new(Injection::SquareMean { amplitude }).at(u);
        let halves = mean(|angle| if angle < 0.5 * TAU { 1.0 } else { -1.0 });
        prop_assert!((square - halves).abs() < 1e-12);
    }

    /// Friction has no preferred direction, and is never above its limit.
    #[test]
    fn sign_is_odd_and_bounded(injection in injection(), u in -2.0..2.0_f64) {
        let (value, mirror) = (Sign::new(injection).at(u), Sign::new(mirrored(injection)).at(-u));
        prop_assert_eq!(mirror, -value);
        prop_assert!(value.abs() <= 1.0, "{value}");
        let single = match injection {
            Injection::SineMean { amplitude } => Injection::SineMean { amplitude: amplitude as f32 },
            _ => return Ok(()),
        };
        prop_assert!(Sign::new(single).at(u as f32).abs() <= 1.0, "also where f32 rounds up");
    }

    #[test]
    fn sign_is_monotone(injection in injection(), u in -2.0..2.0_f64, v in -2.0..2.0_f64) {
        let sign = Sign::new(injection);
        prop_assert!(sign.at(u.min(v)) <= sign.at(u.max(v)));
    }

    /// The value is that of the mode, so that a step that holds the mode integrates the law itself.
    #[test]
    fn mode_has_the_sign(injection in injection(), u in -2.0..2.0_f64) {
        let sign = Sign::new(injection);
        let by_mode = match sign.mode(u) {
            FrictionMode::Positive => 1.0,
            FrictionMode::Negative => -1.0,
            FrictionMode::Neutral | FrictionMode::Sticking => 0.0,
        };
        if let Sign::Stepped { .. } = sign {
            prop_assert_eq!(sign.at(u), by_mode);
        } else {
            prop_assert_eq!(sign.mode(u), FrictionMode::Neutral, "a smooth sign has no steps");
        }
    }

    /// No crossing is reported on the mode's own side; one that is reported lies between the two arguments, and the mode
    /// after it is the next one on the way.
    #[test]
    fn crossing_lies_on_the_way(injection in injection(), from in -2.0..2.0_f64, to in -2.0..2.0_f64) {
        let sign = Sign::new(injection);
        let (mode, target) = (sign.mode(from), sign.mode(to));
        prop_assert_eq!(sign.crossing(mode, from), None);
        let Some((threshold, mode_after)) = sign.crossing(mode, to) else {
            prop_assert_eq!(mode, target, "a change of mode was missed");
            return Ok(());
        };
        prop_assert!(mode != target, "crossing at {threshold} without a change of mode");
        prop_assert!(from.min(to) <= threshold && threshold <= from.max(to));
        let next_on_the_way = (threshold + to) * 0.5;
        let apart = matches!(sign, Sign::Stepped { lower, upper } if lower < upper);
        if apart && mode != FrictionMode::Neutral {
            prop_assert_eq!(mode_after, FrictionMode::Neutral, "between the two steps");
        } else {
            prop_assert_eq!(mode_after, sign.mode(next_on_the_way));
        }
    }

    /// At a step of the sign itself: on the mode's own side, not across.
    #[test]
    fn crossing_needs_more_than_a_touch(injection in injection()) {
        let Sign::Stepped { lower, upper } = Sign::new(injection) else { return Ok(()) };
        let sign = Sign::Stepped { lower, upper };
        // Neither side of a step is preferred.
        prop_assert_eq!([lower, upper].map(|u| sign.mode(u)), [FrictionMode::Neutral; 2]);
        prop_assert_eq!(sign.crossing(FrictionMode::Positive, upper), None);
        prop_assert_eq!(sign.crossing(FrictionMode::Negative, lower), None);
        prop_assert_eq!(sign.crossing(FrictionMode::Neutral, lower), None);
        prop_assert_eq!(sign.crossing(FrictionMode::Neutral, upper), None);
    }

    /// Coulomb friction only takes energy from the steering: its torque times the rate is never negative, along
    /// trajectories through slip, stick and every mean dither. The torque is the difference to the same model without it.
    /// The mode after a change is held for the rest of the step; what the torques change by in a step, some 0.5 N m, may
    /// turn the rate around by 5e-5 rad/s in it: 3e-4 W, a ten-thousandth of the power in motion.
    #[test]
    fn coulomb_friction_does_no_work_on_the_steering(
        scenario in scenario(), signal: bool,
    ) {
        let mut scenario = scenario;
        scenario.friction.law = FrictionLaw::CoulombRate;
        if signal && !scenario.friction.dithered {
            // A held sample ahead of the sign itself may push for as long as it is held.
            scenario.dither.application = Application::Signal;
        }
        let model = Model::new(&scenario);
        scenario.friction.law = FrictionLaw::None;
        let frictionless = Model::new(&scenario);
        let mut state = model.initial_state(&scenario);
        for k in 0..300 {
            let injection = scenario.dither.injection(libm::sin(f64::from(k)));
            integrate::step(&model, &mut state, 1e-3, injection);
            let with = model.derivative(&state.x, injection, state.friction);
            let without = frictionless.derivative(&state.x, injection, FrictionMode::Neutral);
            let torque_nm = scenario.steering.inertia_kg_m2 * (without - with)[STEERING_RATE];
            let power_w = torque_nm * state.x[STEERING_RATE];
            prop_assert!(power_w >= -5e-4, "{power_w} W out of friction in {state:?}");
            let limit = 6.5856 + 1e-9;
            prop_assert!(torque_nm.abs() <= limit || state.friction == FrictionMode::Sticking);
        }
    }

    /// At rest the steering stays where it is, bit for bit, as long as motor and tyres pull by less than the friction's
    /// limit; beyond it, it sets out in the direction of the pull.
    #[test]
    fn coulomb_friction_sticks(
        x in (-0.3..0.3_f64, -0.3..0.3_f64, -0.6..0.6_f64), current_a in -15.0..15.0_f64,
    ) {
        sticks::<f64>(x, current_a, false)?;
        sticks::<f32>(x, current_a, false)?;
    }

    /// Friction that will be dithered sticks before the dither starts.
    #[test]
    fn coulomb_friction_sticks_until_it_is_dithered(
        x in (-0.3..0.3_f64, -0.3..0.3_f64, -0.6..0.6_f64), current_a in -15.0..15.0_f64,
    ) {
        sticks::<f64>(x, current_a, true)?;
        sticks::<f32>(x, current_a, true)?;
    }

    /// The printed law looks at the angle alone: the same torque at rest as in motion.
    #[test]
    fn printed_law_ignores_the_rate(delta in 0.01..0.6_f64, rate in -1.0..1.0_f64) {
        let mut scenario = Scenario::printed();
        let model = Model::new(&scenario);
        scenario.friction.law = FrictionLaw::None;
        let frictionless = Model::new(&scenario);
        for (angle, torque) in [(delta, 6.5856), (-delta, -6.5856)] {
            let state = model.state([0.1, 0.2, angle, rate].into());
            let with = model.derivative(&state.x, Injection::Off, state.friction);
            let without = frictionless.derivative(&state.x, Injection::Off, FrictionMode::Neutral);
            prop_assert!((10.0 * (without - with)[STEERING_RATE] - torque).abs() < 1e-9);
        }
    }
}

fn sticks<T: Real>(
    x: (f64, f64, f64),
    current_a: f64,
    dithered: bool,
) -> Result<(), TestCaseError> {
    let mut scenario = Scenario::<T>::reconstruction();
    scenario.steering.motor_current_a = T::from_f64(current_a);
    scenario.friction.dithered = dithered;
    let model = Model::new(&scenario);
    let limit = scenario
        .friction
        .limit_nm(scenario.steering.pneumatic_trail_m);
    // The same with friction that nothing here breaks loose: where the steering would be if it
    // stuck.
    scenario.friction.coefficient = T::from_f64(10.0);
    scenario.friction.front_wheel_load_kg = T::from_f64(1e5);
    let held = Model::new(&scenario);
    let x = [x.0, x.1, x.2, 0.0].map(T::from_f64);
    let mut state: State<T> = model.state(x.into());
    let torque = |state: &State<T>| model.driving_torque_nm(&state.x, Injection::Off);
    for _ in 0..500 {
        let mut stuck = state;
        integrate::step(&held, &mut stuck, T::from_f64(1e-3), Injection::Off);
        prop_assert!(stuck.x[STEERING_ANGLE] == x[2], "held, yet the angle crept");
        let (before, after) = (torque(&state), torque(&stuck));
        integrate::step(&model, &mut state, T::from_f64(1e-3), Injection::Off);
        if before.abs() <= limit && after.abs() <= limit {
            prop_assert_eq!(
                state,
                stuck,
                "pulled by {:?} and {:?} of {:?} N m",
                before,
                after,
                limit
            );
            prop_assert_eq!(state.friction, FrictionMode::Sticking);
            continue;
        }
        // So far beyond the limit that the tyres cannot turn the pull around within the step.
        if before.abs() > limit + T::from_f64(1.0) {
            prop_assert!(
                state.x[STEERING_RATE] * before > T::zero(),
                "pulled by {before:?} N m into {state:?}"
            );
            prop_assert!((state.x[STEERING_ANGLE] - x[2]) * before > T::zero());
        }
        break;
    }
    Ok(())
}

#[test]
fn mode_codes_round_trip() {
    let known: Vec<_> = (0..=u8::MAX)
        .filter_map(|code| Some((code, FrictionMode::from_code(code)?)))
        .collect();
    assert!(known.iter().all(|&(code, mode)| mode as u8 == code));
    // The codes are in the telemetry: they must not move.
    use FrictionMode::{Negative, Neutral, Positive, Sticking};
    assert_eq!(
        known,
        [(0, Sticking), (1, Negative), (2, Neutral), (3, Positive)]
    );
}

/// On the rate the dither's amplitude is its own times its frequency; on the angle it is its own.
#[test]
fn dither_reaches_the_sign_functions_argument() {
    let mut friction = Scenario::<f64>::reconstruction().friction;
    let dither = Injection::SquareMean { amplitude: 0.1 };
    assert_eq!(
        friction.injection(dither, 2000.0),
        Injection::Off,
        "not dithered"
    );
    friction.dithered = true;
    assert_eq!(
        friction.injection(dither, 2000.0),
        Injection::SquareMean { amplitude: 200.0 }
    );
    friction.law = FrictionLaw::PrintedAngle;
    assert_eq!(friction.injection(dither, 2000.0), dither);
    friction.law = FrictionLaw::None;
    assert_eq!(friction.injection(dither, 2000.0), Injection::Off);
    assert_eq!(friction.limit_nm(0.012), 0.0);
}
