//! The measures of chaos against something independent.

use dynamics::attractor::{Kind, attractors};
use dynamics::flow::VehicleFlow;
use dynamics::lyapunov::{Exponent, largest};
use dynamics::period::{Period, TOLERANCE, period};
use dynamics::simulate::{settle, simulate, started_at};
use dynamics::sweep::{RunControl, Timing, mirrored};
use dynamics::trace::Trace;
use dynamics::two_particle;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::friction::FrictionLaw;
use shared_model::vehicle::STEERING_ANGLE;

const RUN_S: f64 = 400.0;

fn settled(rpm: f64, law: FrictionLaw) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.wheel_speed_rpm = rpm;
    scenario.run.duration_s = RUN_S;
    scenario.friction.law = law;
    let start = settle(&scenario, 200.0).expect("the scenario is valid");
    started_at(&scenario, &start)
}

fn exponent(scenario: &Scenario<f64>) -> Exponent {
    let trace = simulate(scenario).expect("the scenario is valid");
    largest(scenario, &trace, 0).expect("the run is long enough")
}

/// The same by two neighbouring motions, which take no derivative and do not go through the ECU's
/// program.
fn twin_exponent_per_s(scenario: &Scenario<f64>) -> f64 {
    let flow = VehicleFlow::new(scenario).expect("the scenario is valid");
    let exponent = two_particle::largest(&flow, &flow.start(), scenario.run.duration_s);
    let exponent = exponent.expect("the motion is bounded");
    exponent.expect("the motions stay apart").per_s
}

#[test]
fn tangent_and_twin_motions_agree() {
    for law in [FrictionLaw::CoulombRate, FrictionLaw::None] {
        for rpm in [1700.0, 1750.0, 1880.0] {
            let scenario = settled(rpm, law);
            let tangent = exponent(&scenario);
            let twin = twin_exponent_per_s(&scenario);
            let apart = (tangent.per_s - twin).abs();
            assert!(
                apart <= 3.0 * tangent.standard_error_per_s.max(tangent.resolution_per_s),
                "{law:?} at {rpm} rpm: tangent {tangent}, twin {twin:.3}"
            );
        }
    }
}

#[test]
fn chaotic_and_periodic_motions_are_told_apart() {
    for (rpm, maxima) in [
        (1600.0, Some(2)),
        (1750.0, None),
        (1845.0, Some(3)),
        (1880.0, None),
    ] {
        let scenario = settled(rpm, FrictionLaw::CoulombRate);
        let trace = simulate(&scenario).expect("the scenario is valid");
        assert_eq!(period(&trace, 0, TOLERANCE).maxima(), maxima, "{rpm} rpm");
        let exponent = largest(&scenario, &trace, 0).expect("the run is long enough");
        assert_eq!(
            exponent.is_positive(),
            maxima.is_none(),
            "{rpm} rpm: {exponent}"
        );
    }
}

/// Down to a stable equilibrium the exponent is the rate at which two motions close in: negative,
/// and it needs no maxima.
#[test]
fn an_equilibrium_has_a_negative_exponent() {
    let mut scenario = Scenario::<f64>::reconstruction();
    scenario.run.wheel_speed_rpm = 1000.0;
    scenario.run.duration_s = RUN_S;
    scenario.run.sideslip_rad = -0.05;
    scenario.run.steering_angle_rad = -0.47;
    scenario.friction.law = FrictionLaw::None;
    let start = settle(&scenario, 400.0).expect("the scenario is valid");
    let scenario = started_at(&scenario, &start);
    let trace = simulate(&scenario).expect("the scenario is valid");
    assert_eq!(period(&trace, 0, TOLERANCE), Period::Equilibrium);
    let exponent = largest(&scenario, &trace, 0).expect("the run is long enough");
    let twin = twin_exponent_per_s(&scenario);
    assert!(exponent.per_s < -0.01, "{exponent}");
    assert!(
        (exponent.per_s / twin - 1.0).abs() < 0.02,
        "{exponent}, twin {twin}"
    );
}

/// The exponent does not depend on the step.
#[test]
fn a_tenth_of_the_step_gives_the_same_exponent() {
    let coarse = settled(1750.0, FrictionLaw::CoulombRate);
    let mut fine = coarse;
    fine.run.control_rate_hz = 10_000.0;
    let (a, b) = (exponent(&coarse), exponent(&fine));
    let error = a.standard_error_per_s.hypot(b.standard_error_per_s);
    assert!(
        (a.per_s - b.per_s).abs() <= 3.0 * error,
        "1 ms: {a}, 0.1 ms: {b}"
    );
}

/// A made-up motion whose yaw rate is `f` of the time.
fn yaw_rate(f: impl Fn(f64) -> f64) -> Trace {
    let scenario = settled(1600.0, FrictionLaw::CoulombRate);
    let mut trace = simulate(&scenario).expect("the scenario is valid");
    trace.states.truncate(60_000);
    for k in 0..trace.states.len() {
        trace.states[k].x[1] = f(trace.time_s(k));
    }
    trace
}

#[test]
fn periods_of_known_motions() {
    use std::f64::consts::TAU;
    let wave = |t: f64| (TAU * t / 1.3).sin();
    let half = |t: f64| (TAU * t / 2.6).sin();
    let one = period(&yaw_rate(wave), 0, TOLERANCE);
    let Period::Periodic {
        maxima: 1,
        time_s,
        time_spread_s,
        ..
    } = one
    else {
        panic!("{one:?}");
    };
    assert!(
        (time_s - 1.3).abs() < 1e-6 && time_spread_s < 1e-5,
        "{one:?}"
    );
    let two = yaw_rate(|t| wave(t) + 0.2 * half(t));
    assert_eq!(period(&two, 0, TOLERANCE).maxima(), Some(2));
    // Two frequencies without a common multiple: no period.
    let none = yaw_rate(|t| wave(t) + 0.2 * (TAU * t / 2.9142).sin());
    assert!(matches!(
        period(&none, 0, TOLERANCE),
        Period::Aperiodic { .. }
    ));
    // A fast ripple makes no maxima.
    let ripple = yaw_rate(|t| wave(t) + 2e-3 * (2000.0 * t).sin());
    assert_eq!(period(&ripple, 0, 1e-2).maxima(), Some(1));
    assert_eq!(
        period(&yaw_rate(|_| 0.3), 0, TOLERANCE),
        Period::Equilibrium
    );
}

#[test]
fn dither_makes_the_motion_period_one() {
    for (waveform, amplitude_v) in [(Waveform::Square, 0.1), (Waveform::Sine, 1.0)] {
        let mut scenario = settled(1750.0, FrictionLaw::CoulombRate);
        scenario.dither.waveform = waveform;
        scenario.dither.amplitude_v = amplitude_v;
        let trace = simulate(&scenario).expect("the scenario is valid");
        let from = trace.index_after(23.0);
        assert_eq!(
            period(&trace, from, TOLERANCE).maxima(),
            Some(1),
            "{waveform:?}"
        );
        let exponent = largest(&scenario, &trace, from).expect("the run is long enough");
        assert!(!exponent.is_positive(), "{waveform:?}: {exponent}");
    }
}

/// The amplitude that the gate keeps in the safe state, at any speed to which a vehicle may slow down
/// or up to which it may be wrong.
#[test]
fn sr04_the_safe_states_amplitude_suppresses_the_chaos_at_every_speed() {
    let mut scenarios = Vec::new();
    for waveform in [Waveform::Square, Waveform::Sine] {
        for step in 0..=140 {
            let mut scenario = Scenario::reconstruction();
            scenario.run.wheel_speed_rpm = 1100.0 + 10.0 * f64::from(step);
            scenario.dither.waveform = waveform;
            scenario.dither.amplitude_v = match waveform {
                Waveform::Sine => scenario.gate.sine_safe_amplitude_v,
                _ => scenario.gate.square_safe_amplitude_v,
            };
            scenarios.extend([scenario, mirrored(&scenario)]);
        }
    }
    let timing = Timing::new(300.0, 500.0).expect("it is valid");
    let found = attractors(&scenarios, timing, true, RunControl::none()).expect("they are valid");
    let mut greatest_rad: f64 = 0.0;
    for (scenario, attractor) in scenarios.iter().zip(found) {
        let attractor = attractor.expect("it is not stopped");
        let peak_to_peak_rad = attractor.upper[STEERING_ANGLE] - attractor.lower[STEERING_ANGLE];
        greatest_rad = greatest_rad.max(peak_to_peak_rad);
        let is_calm = matches!(attractor.kind, Kind::Periodic(1) | Kind::Equilibrium);
        // Near the onset of the motion out of rest a small motion takes longer to settle.
        assert!(
            is_calm || peak_to_peak_rad < 0.05,
            "{:?} {} rpm: {:?}, {peak_to_peak_rad} rad",
            scenario.dither.waveform,
            scenario.run.wheel_speed_rpm,
            attractor.kind
        );
    }
    println!("greatest peak-to-peak steering angle: {greatest_rad:.3} rad");
    assert!(greatest_rad < 0.7, "{greatest_rad} rad");
}
