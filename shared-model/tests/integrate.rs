//! Integrator: orders of convergence, friction events against a closed form, and repeatability.

use nalgebra::Vector4;
use proptest::prelude::*;
use shared_model::dither::{Injection, Waveform};
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::tire::TireModel;
use shared_model::vehicle::{Model, STEERING_ANGLE, STEERING_RATE, State};
use shared_model::{Real, Scenario, integrate};

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// State vector after `duration_s` in the given number of steps.
fn end<T: Real>(
    scenario: &Scenario<T>,
    duration_s: f64,
    steps: u32,
    injection: Injection<T>,
) -> State<T> {
    let model = Model::new(scenario);
    let mut state = model.initial_state(scenario);
    let step_s = T::from_f64(duration_s / f64::from(steps));
    for _ in 0..steps {
        integrate::step(&model, &mut state, step_s, injection);
    }
    state
}

fn distance(a: Vector4<f64>, b: Vector4<f64>) -> f64 {
    (a - b)
        .iter()
        .fold(0.0, |greatest, d| d.abs().max(greatest))
}

/// A second of smooth motion: halving the step divides the difference to the next finer run by 2^4.
/// The steps are short against the fastest time constant (J_w/b_w = 50 ms) and the differences
/// large against rounding (some 1e-15).
fn assert_fourth_order(scenario: &Scenario<f64>, injection: Injection<f64>) {
    let runs = [250, 500, 1000, 2000].map(|steps| end(scenario, 1.0, steps, injection).x);
    let differences = [0, 1, 2].map(|k| distance(runs[k], runs[k + 1]));
    for pair in differences.windows(2) {
        let order = libm::log2(pair[0] / pair[1]);
        assert!(
            (3.8..=4.3).contains(&order),
            "order {order} from {differences:?}"
        );
    }
}

#[test]
fn fourth_order_without_friction() {
    let mut scenario = Scenario::reconstruction();
    scenario.friction.law = FrictionLaw::None;
    assert_fourth_order(&scenario, Injection::Off);
    assert_fourth_order(&scenario, Injection::SquareMean { amplitude: 0.1 });
}

/// A sine ahead of the friction's sign makes it smooth as long as the rate stays within the
/// dither's, here 640 rad/s.
#[test]
fn fourth_order_with_smoothed_friction() {
    let mut scenario = Scenario::reconstruction();
    scenario.friction.dithered = true;
    scenario.dither.waveform = Waveform::Sine;
    assert_fourth_order(&scenario, Injection::SineMean { amplitude: 0.16 });
}

/// With events the single error depends on where in its step an event falls; the trend over many
/// step lengths is the order. Four seconds of stick-slip motion at 1750 rpm, against steps of 2 us.
#[test]
fn second_order_with_stick_and_slip() {
    let scenario = Scenario::reconstruction();
    let exact = end(&scenario, 4.0, 2_000_000, Injection::Off).x;
    let points: Vec<(f64, f64)> = (0..48)
        .map(|k| {
            let steps = (1000.0 * libm::exp2(f64::from(k) / 8.0)) as u32;
            let error = distance(end(&scenario, 4.0, steps, Injection::Off).x, exact);
            (libm::log2(f64::from(steps)), libm::log2(error))
        })
        .collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let covariance: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let order = -covariance / points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum::<f64>();
    assert!(order > 1.8, "order {order}");
}

/// A steering without tyres and motor: J w' = -b w - tau_c sign(w), whose decay to rest has a
/// closed form.
fn free_steering(inertia: f64, damping: f64, coefficient: f64, rate: f64) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.tires.front.peak_n = 0.0;
    scenario.tires.rear.peak_n = 0.0;
    scenario.steering.motor_current_a = 0.0;
    scenario.steering.inertia_kg_m2 = inertia;
    scenario.steering.damping_nm_s_per_rad = damping;
    scenario.friction.coefficient = coefficient;
    scenario.run.steering_angle_rad = 0.0;
    scenario.run.steering_rate_rad_per_s = rate;
    scenario.validate().unwrap();
    scenario
}

/// Time and angle at which the free steering comes to rest: T = (J/b) ln(1 + b w0/tau_c), and from
/// the integral of the equation of motion, J w0 = b delta + tau_c T.
fn rest(scenario: &Scenario<f64>) -> (f64, f64) {
    let (inertia, damping) = (
        scenario.steering.inertia_kg_m2,
        scenario.steering.damping_nm_s_per_rad,
    );
    let limit = scenario
        .friction
        .limit_nm(scenario.steering.pneumatic_trail_m);
    let rate = scenario.run.steering_rate_rad_per_s;
    let time = inertia / damping * libm::log1p(damping * rate.abs() / limit);
    let angle = (inertia * rate.abs() - limit * time) / damping;
    (time, angle.copysign(rate))
}

proptest! {
    #![proptest_config(cases(200))]

    /// The steering stops in the step that holds the closed form's stopping time, at the closed form's angle, and stays
    /// there bit for bit. The event is located to second order: the error is a share of (acceleration) x (step)^2.
    #[test]
    fn free_decay_stops_as_the_closed_form(
        inertia in 1.0..20.0_f64, damping in 10.0..300.0_f64, coefficient in 0.05..1.0_f64,
        rate in prop_oneof![0.02..2.0_f64, -2.0..-0.02_f64],
    ) {
        let scenario = free_steering(inertia, damping, coefficient, rate);
        let model = Model::new(&scenario);
        let mut state = model.initial_state(&scenario);
        let (time, angle) = rest(&scenario);
        let step_s = 1e-4;
        let mut steps = 0;
        while state.friction != FrictionMode::Sticking && steps < 100_000 {
            integrate::step(&model, &mut state, step_s, Injection::Off);
            steps += 1;
        }
        prop_assert_eq!(state.x[STEERING_RATE], 0.0, "at rest exactly");
        let late = f64::from(steps) * step_s - time;
        // The last step's end comes up to a step after the stop.
        prop_assert!((-1e-6..step_s + 1e-6).contains(&late), "stopped {late} s after {time} s");
        let limit = scenario.friction.limit_nm(scenario.steering.pneumatic_trail_m);
        let deceleration = (limit + damping * rate.abs()) / inertia;
        let error = (state.x[STEERING_ANGLE] - angle).abs();
        prop_assert!(error <= 0.1 * deceleration * step_s * step_s, "off by {error} rad");
        let stopped = state.x[STEERING_ANGLE];
        for _ in 0..100 {
            integrate::step(&model, &mut state, step_s, Injection::Off);
        }
        prop_assert_eq!(state.x[STEERING_ANGLE], stopped);
    }

    /// A step in which the steering comes to rest holds its first mode only up to there. Held to the end of the step, the
    /// friction would turn the rate around, up to the whole acceleration times the step.
    #[test]
    fn mode_is_held_over_a_part_of_the_step(share in 0.05..0.95_f64) {
        let step_s = 1e-3;
        let mut scenario = free_steering(10.0, 200.0, 0.28, 1.0);
        let limit = scenario.friction.limit_nm(scenario.steering.pneumatic_trail_m);
        // Comes to rest after `share` of the step.
        scenario.run.steering_rate_rad_per_s = limit / 200.0 * libm::expm1(share * step_s * 200.0 / 10.0);
        let model = Model::new(&scenario);
        let mut state = model.initial_state(&scenario);
        prop_assert_eq!(state.friction, FrictionMode::Positive);
        integrate::step(&model, &mut state, step_s, Injection::Off);
        prop_assert_eq!((state.x[STEERING_RATE], state.friction), (0.0, FrictionMode::Sticking));
        // A hundredth of what holding the mode on would move the angle by, limit/J step^2/2.
        let (_, angle) = rest(&scenario);
        let error = (state.x[STEERING_ANGLE] - angle).abs();
        prop_assert!(error < 0.01 * 0.5 * limit / 10.0 * step_s * step_s, "off by {error} rad");
    }

    /// A motor stronger than the friction turns the steering around: after the crossing the other mode holds, and the
    /// rate at the end of the step is that of the piecewise closed form without damping.
    #[test]
    fn rate_turns_around_within_the_step(share in 0.05..0.95_f64, current_a in 5.0..15.0_f64) {
        let step_s = 1e-3;
        let mut scenario = free_steering(10.0, 0.0, 0.28, 1.0);
        scenario.steering.motor_current_a = -current_a;
        let limit = scenario.friction.limit_nm(scenario.steering.pneumatic_trail_m);
        let motor = -scenario.steering.motor_torque_nm();
        scenario.run.steering_rate_rad_per_s = (motor + limit) / 10.0 * share * step_s;
        let state = end(&scenario, step_s, 1, Injection::Off);
        let rate = -(motor - limit) / 10.0 * (1.0 - share) * step_s;
        // The rate is linear in time on both sides, so that even the linear interpolation is exact.
        if motor > limit {
            prop_assert_eq!(state.friction, FrictionMode::Negative);
            prop_assert!((state.x[STEERING_RATE] - rate).abs() < 1e-12, "{} against {rate}", state.x[STEERING_RATE]);
        } else {
            prop_assert_eq!((state.x[STEERING_RATE], state.friction), (0.0, FrictionMode::Sticking));
        }
    }
}

/// The steering breaks loose in the middle of a step, where the tyres' growing torque passes the
/// friction's limit, and not only at the next step: the rate after the step is that of steps a
/// thousand times as short.
#[test]
fn release_is_within_the_step() {
    let step_s = 1e-3;
    for share in [0.1, 0.3, 0.5, 0.7] {
        let mut scenario = Scenario::<f64>::reconstruction();
        (scenario.run.sideslip_rad, scenario.run.steering_angle_rad) = (0.05, 0.05);
        // Without motor the steering sticks; how the torque grows in the step does not depend on
        // the motor.
        let per_ampere = scenario.steering.motor_torque_nm() / scenario.steering.motor_current_a;
        scenario.steering.motor_current_a = 0.0;
        let torque =
            |state: &State<f64>| Model::new(&scenario).driving_torque_nm(&state.x, Injection::Off);
        let start = torque(&Model::new(&scenario).initial_state(&scenario));
        let growth = torque(&end(&scenario, step_s, 1, Injection::Off)) - start;
        let limit = scenario
            .friction
            .limit_nm(scenario.steering.pneumatic_trail_m);
        scenario.steering.motor_current_a =
            (limit.copysign(growth) - share * growth - start) / per_ampere;
        let state = end(&scenario, step_s, 1, Injection::Off);
        let exact = end(&scenario, step_s, 1000, Injection::Off).x[STEERING_RATE];
        assert!(exact.abs() > 1e-9, "broke loose at {share} of the step");
        let error = (state.x[STEERING_RATE] / exact - 1.0).abs();
        assert!(
            error < 0.05,
            "rate off by {error} of itself, released at {share} of the step"
        );
    }
}

/// Straight ahead without motor current is an equilibrium, under every law and mean dither, to the
/// bit.
#[test]
fn straight_ahead_stays() {
    let injections = [
        Injection::Off,
        Injection::SquareMean { amplitude: 0.1 },
        Injection::SineMean { amplitude: 0.1 },
    ];
    for law in [
        FrictionLaw::None,
        FrictionLaw::CoulombRate,
        FrictionLaw::PrintedAngle,
    ] {
        for (injection, dithered) in injections.into_iter().zip([false, true, true]) {
            let mut scenario = Scenario::<f32>::reconstruction();
            (scenario.friction.law, scenario.friction.dithered) = (law, dithered);
            scenario.dither.waveform = Waveform::Sine;
            scenario.steering.motor_current_a = 0.0;
            scenario.run.sideslip_rad = 0.0;
            scenario.run.steering_angle_rad = 0.0;
            let state = end(&scenario, 1.0, 1000, injection);
            assert_eq!(state.x, Vector4::zeros(), "{law:?} under {injection:?}");
        }
    }
}

/// A cornering equilibrium built by hand: slip angles chosen, front tyre scaled so that the yaw
/// moments balance, motor so that it balances the self-aligning torque. The right-hand side
/// vanishes there, so the state stays.
#[test]
fn cornering_equilibrium_stays() {
    let mut scenario = Scenario::<f64>::reconstruction();
    scenario.friction.law = FrictionLaw::None;
    let (front_slip, rear_slip) = (0.03, 0.02);
    let rear_n = scenario.tires.rear.cubic().force(rear_slip);
    let front_n = rear_n * 1.3 / 1.2;
    scenario.tires.front.peak_n *= front_n / scenario.tires.front.cubic().force(front_slip);
    let steering = &mut scenario.steering;
    steering.motor_current_a *= steering.trail_m() * front_n / steering.motor_torque_nm();
    let speed = scenario.vehicle.speed_m_per_s(1750.0);
    let yaw_rate = (front_n + rear_n) / (1500.0 * speed);
    let sideslip = rear_slip + 1.3 * yaw_rate / speed;
    let x = Vector4::new(
        sideslip,
        yaw_rate,
        sideslip + 1.2 * yaw_rate / speed - front_slip,
        0.0,
    );
    let run = &mut scenario.run;
    (
        run.sideslip_rad,
        run.yaw_rate_rad_per_s,
        run.steering_angle_rad,
    ) = (x[0], x[1], x[2]);
    let model = Model::new(&scenario);
    let slope = model.derivative(&x, Injection::Off, FrictionMode::Neutral);
    assert!(
        distance(slope, Vector4::zeros()) < 1e-12,
        "{slope:?} at the equilibrium"
    );
    let drift = distance(end(&scenario, 1.0, 1000, Injection::Off).x, x);
    assert!(drift < 1e-11, "drifted by {drift}");
}

/// The f32 model has the same bits in every run, on every machine and at every optimisation level:
/// firmware and host are compared by them. Who changes the arithmetic on purpose writes the new
/// bits here.
#[test]
fn f32_bits_repeat() {
    let mut scenario = Scenario::<f32>::reconstruction();
    scenario.tires.model = TireModel::MagicFormula;
    let cubic = Scenario::reconstruction();
    let runs = || {
        [
            end(&cubic, 2.0, 2000, Injection::Off),
            end(
                &scenario,
                2.0,
                2000,
                Injection::SineMean { amplitude: 0.01 },
            ),
        ]
        .map(|state| <[u32; 4]>::from(state.x.map(f32::to_bits)))
    };
    assert_eq!(runs(), runs());
    let known = [
        [0x3b8c_871b, 0x3f16_dc72, 0x3ec7_1e57, 0xbeab_e0f4],
        [0x4014_ccba, 0xbf86_3c2d, 0x3f0c_d563, 0xbd93_4725],
    ];
    assert_eq!(runs(), known, "{:#010x?}", runs());
}
