//! The reference integrator against closed forms and itself, and the ECU's fixed step against it.

use engine::Stepper;
use engine::reference::Reference;
use shared_model::Scenario;
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::vehicle::{STEERING_ANGLE, STEERING_RATE};

/// A spring with dry friction: the front tyre as a linear spring on the steering (a cubic tyre
/// without cubic term, of the usual sign), and a chassis so heavy and fast that it does not take
/// part.
fn stick_slip_oscillator() -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.vehicle.mass_kg = 1e5;
    scenario.vehicle.yaw_inertia_kg_m2 = 1e6;
    scenario.vehicle.wheel_radius_m = 5.0;
    scenario.run.wheel_speed_rpm = 1e5;
    let front = &mut scenario.tires.front;
    front.shape = 1.0;
    front.curvature = -1.5; // (E + 1)/3 + C^2/6 = 0
    front.stiffness_per_rad = 10.0;
    front.peak_n = -1.0;
    scenario.tires.rear.peak_n = 0.0;
    let steering = &mut scenario.steering;
    steering.inertia_kg_m2 = 0.1;
    steering.damping_nm_s_per_rad = 0.0;
    steering.motor_current_a = 0.0;
    steering.pneumatic_trail_m = 0.5;
    steering.mechanical_trail_m = 0.5;
    scenario.friction.coefficient = 0.1 / (9.8 * 0.5 * 2.0); // limit 0.1 N m
    scenario.friction.front_wheel_load_kg = 2.0;
    scenario.run.sideslip_rad = 0.0;
    scenario.run.steering_angle_rad = 0.105;
    scenario
}

/// Stiffness 10 N m/rad, inertia 0.1: 10 rad/s. Each half period of pi/10 s turns at an amplitude
/// smaller by twice 0.1/10 rad, and the steering sticks where it turns within 0.01 rad of the
/// middle.
#[test]
fn a_stick_slip_oscillator_keeps_its_closed_form() {
    let mut reference = Reference::new(&stick_slip_oscillator(), 1e-13).expect("valid");
    let half_period_s = std::f64::consts::PI / 10.0;
    let mut amplitude = 0.105;
    for half in 1..=5 {
        reference.run(half_period_s).expect("it stays bounded");
        amplitude -= 0.02;
        let delta = reference.state().x[STEERING_ANGLE];
        let expected = if half % 2 == 1 { -amplitude } else { amplitude };
        assert!(
            (delta - expected).abs() < 1e-6,
            "half period {half}: {delta} for {expected}"
        );
    }
    reference.run(1.0).expect("it stays bounded");
    // 0.005 rad from the middle, within 0.01: stuck for good.
    assert_eq!(reference.state().friction, FrictionMode::Sticking);
    assert_eq!(reference.state().x[STEERING_RATE], 0.0);
    let turns: Vec<f64> = reference
        .events()
        .iter()
        .map(|event| event.time_s)
        .collect();
    // The release at time 0 is the start's own mode; then one event a half period.
    assert_eq!(turns.len(), 5, "{:?}", reference.events());
    for (half, time_s) in turns.iter().enumerate() {
        let expected = (half + 1) as f64 * half_period_s;
        assert!(
            (time_s - expected).abs() < 1e-6,
            "event {half} at {time_s} s for {expected} s"
        );
    }
}

/// Half a period and the sum of two quarter runs end alike; a looser tolerance ends nearby.
#[test]
fn the_reference_agrees_with_itself() {
    let scenario = Scenario::<f64>::reconstruction();
    let run = |tolerance, pieces: u32| {
        let mut reference = Reference::new(&scenario, tolerance).expect("valid");
        for _ in 0..pieces {
            reference
                .run(4.0 / f64::from(pieces))
                .expect("it stays bounded");
        }
        (reference.state().x, reference.events().to_vec())
    };
    let (fine, events) = run(1e-14, 1);
    assert!(events.len() >= 4, "the run has friction events: {events:?}");
    assert!(
        events
            .iter()
            .any(|event| event.to == FrictionMode::Sticking),
        "and sticks"
    );
    for (tolerance, pieces) in [(1e-14, 7), (1e-12, 1), (1e-14, 400)] {
        let (x, others) = run(tolerance, pieces);
        assert!((x - fine).amax() < 1e-9, "{:e}", (x - fine).amax());
        for (a, b) in events.iter().zip(&others) {
            assert!((a.time_s - b.time_s).abs() < 1e-10, "{a:?} {b:?}");
        }
    }
}

/// Observed order of the ECU's step against the reference, fitted over step lengths from 4 ms down,
/// four a halving.
fn observed_order(law: FrictionLaw, halvings: u32) -> f64 {
    let mut scenario = Scenario::<f64>::reconstruction();
    scenario.friction.law = law;
    scenario.servo.timer_clock_hz = 1e6; // fits a period at any of the rates
    let mut reference = Reference::new(&scenario, 1e-14).expect("valid");
    let end = *reference.run(4.0).expect("it stays bounded");
    let points: Vec<(f64, f64)> = (0..=4 * halvings)
        .map(|k| {
            scenario.run.control_rate_hz = (250.0 * 2_f64.powf(f64::from(k) / 4.0)).round();
            scenario.run.pwm_rate_hz = scenario.run.control_rate_hz;
            // Whole steps to 4 s: the rates are whole numbers.
            let mut motion = Stepper::new(&scenario).expect("valid");
            let error = (motion.run(4.0).x - end.x).amax();
            (-scenario.run.control_rate_hz.ln(), error.ln())
        })
        .collect();
    let n = points.len() as f64;
    let (sx, sy) = points
        .iter()
        .fold((0.0, 0.0), |(a, b), p| (a + p.0, b + p.1));
    let covariance: f64 = points.iter().map(|p| (p.0 - sx / n) * (p.1 - sy / n)).sum();
    let variance: f64 = points.iter().map(|p| (p.0 - sx / n).powi(2)).sum();
    covariance / variance
}

#[test]
fn the_fixed_step_converges_to_the_reference() {
    let smooth = observed_order(FrictionLaw::None, 3);
    assert!((3.8..4.2).contains(&smooth), "smooth: {smooth}");
    // Below 0.5 ms the smooth error drowns in rounding; with events it does not.
    let dry = observed_order(FrictionLaw::CoulombRate, 6);
    assert!(dry > 1.8, "with friction events: {dry}");
}
