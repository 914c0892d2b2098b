//! What motions do after their transients: by the engine, against the reference integrator and
//! against the ECU's fixed step.

use dynamics::attractor::{Kind, attractor};
use dynamics::fixed_step;
use dynamics::observe::observe;
use dynamics::sweep::{Parameter, RunControl, Timing};
use engine::reference::Reference;
use engine::taylor::{Observables, Trajectory};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::vehicle::YAW_RATE;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

const ALL_TURNS: Observables = Observables {
    turns: [true; 4],
    section: None,
};

fn at(rpm: f64, waveform: Waveform, amplitude_v: f64) -> Scenario<f64> {
    let mut scenario = Parameter::Speed.set(&Scenario::reconstruction(), rpm);
    scenario.dither.waveform = waveform;
    scenario.dither.amplitude_v = amplitude_v;
    scenario
}

fn by_engine(
    scenarios: &[Scenario<f64>],
    timing: Timing,
    observables: Observables,
) -> Vec<Trajectory<1>> {
    let see = |_: &Scenario<f64>, found: &Trajectory<1>| found.clone();
    let found = observe(scenarios, timing, observables, RunControl::none(), see).expect("valid");
    found.into_iter().flatten().collect()
}

/// Mean growth rate and its standard error as if pieces were independent, 1/s.
fn exponent(found: &Trajectory<1>, timing: Timing) -> (f64, f64) {
    let counted_s = 0.9 * timing.observed_s;
    let n = found.log_stretching.len() as f64;
    let mean = found.log_stretching.iter().map(|g| g[0]).sum::<f64>() / n;
    let variance = found
        .log_stretching
        .iter()
        .map(|g| (g[0] - mean).powi(2))
        .sum::<f64>()
        / n;
    (n * mean / counted_s, (n * variance).sqrt() / counted_s)
}

/// Behind a transient too, in which the friction mode changes again and again.
#[test]
fn motions_end_where_the_references_do() {
    let scenarios = [
        at(1600.0, Waveform::None, 0.0),
        at(1750.0, Waveform::None, 0.0),
        at(1750.0, Waveform::Square, 0.1),
        at(1750.0, Waveform::Sine, 1.0),
    ];
    let timing = Timing::new(6.0, 10.0).expect("valid");
    let found = by_engine(&scenarios, timing, ALL_TURNS);
    for (scenario, found) in scenarios.iter().zip(&found) {
        let mut reference = Reference::new(scenario, 1e-13).expect("valid");
        let apart = (reference.run(10.0).expect("it stays bounded").x - found.end.x).amax();
        assert!(apart < 1e-8, "{apart:e}");
        assert!(found.events > 0);
    }
}

/// Periodic motions have the same extents and exponents, chaotic ones within what their length
/// leaves open.
#[test]
fn the_fixed_step_ends_on_the_same_attractors() {
    let timing = Timing::new(200.0, 600.0).expect("valid");
    for (scenario, chaotic) in [
        (at(1600.0, Waveform::None, 0.0), false),
        (at(1845.0, Waveform::None, 0.0), false),
        (at(1750.0, Waveform::Square, 0.1), false),
        (at(1750.0, Waveform::None, 0.0), true),
        (at(1880.0, Waveform::None, 0.0), true),
    ] {
        let engine = by_engine(&[scenario], timing, ALL_TURNS).remove(0);
        let steps: Trajectory<1> =
            fixed_step::observe(&scenario, timing, ALL_TURNS).expect("valid");
        let rpm = scenario.run.wheel_speed_rpm;
        for i in 0..4 {
            let extent = engine.upper[i] - engine.lower[i];
            let most = extent * if chaotic { 0.03 } else { 1e-3 };
            let apart = (engine.lower[i] - steps.lower[i])
                .abs()
                .max((engine.upper[i] - steps.upper[i]).abs());
            println!("{rpm} rpm, component {i}: extent {extent:.5}, apart {apart:.2e}");
            assert!(
                apart < most,
                "{rpm} rpm, component {i}: {apart} of {extent}"
            );
        }
        let ((a, error_a), (b, error_b)) = (exponent(&engine, timing), exponent(&steps, timing));
        println!("{rpm} rpm: engine {a:.4} +- {error_a:.4}, fixed step {b:.4} +- {error_b:.4}");
        let most = if chaotic {
            3.0 * error_a.hypot(error_b)
        } else {
            2.0 / timing.observed_s
        };
        assert!((a - b).abs() < most, "{rpm} rpm: {a} and {b}");
        let maxima = |found: &Trajectory<1>| found.turns[YAW_RATE].len();
        let (more, fewer) = (maxima(&engine) as f64, maxima(&steps) as f64);
        println!("{rpm} rpm: {more} and {fewer} turning points");
    }
}

/// Under the sign of the steering angle as printed, dithered, the motion of period one slides along
/// a step of the friction: it is followed all the same, and does not leave its bounds.
#[test]
fn sliding_motions_are_followed() {
    let mut scenario = Scenario::printed();
    scenario.run.wheel_speed_rpm = 1750.0;
    scenario.dither.waveform = Waveform::Square;
    scenario.dither.amplitude_v = 0.1;
    let timing = Timing::new(100.0, 200.0).expect("valid");
    let found = attractor(&scenario, timing, false).expect("valid");
    assert_eq!(found.kind, Kind::Periodic(1));
}

/// Sections of either integrator are met at the same instants while the motions are still the same.
#[test]
fn crossings_are_those_of_the_fixed_step() {
    let timing = Timing::new(0.0, 8.0).expect("valid");
    let observables = Observables {
        turns: [false; 4],
        section: Some((YAW_RATE, 0.1)),
    };
    let scenario = at(1600.0, Waveform::None, 0.0);
    let engine = by_engine(&[scenario], timing, observables).remove(0);
    let steps: Trajectory<1> = fixed_step::observe(&scenario, timing, observables).expect("valid");
    assert!(engine.crossings.len() >= 4, "{:?}", engine.crossings);
    assert_eq!(engine.crossings.len(), steps.crossings.len());
    for (a, b) in engine.crossings.iter().zip(&steps.crossings) {
        assert_eq!(a.rising, b.rising);
        assert!((a.time_s - b.time_s).abs() < 1e-4, "{a:?} {b:?}");
        assert!((a.x[YAW_RATE] - 0.1).abs() < 1e-12, "{a:?}");
    }
}

/// Scenarios that the engine follows and those that it does not keep their places, and each is
/// counted.
#[test]
fn results_are_in_the_scenarios_order() {
    let scenarios: Vec<_> = (0..70)
        .map(|k| {
            let mut scenario = at(1500.0 + f64::from(k), Waveform::None, 0.0);
            if k % 7 == 0 {
                scenario.dither.waveform = Waveform::Sine;
                scenario.dither.amplitude_v = 1.0;
                scenario.friction.dithered = true;
            }
            scenario
        })
        .collect();
    let timing = Timing::new(1.0, 2.0).expect("valid");
    let (stop, done) = (AtomicBool::new(false), AtomicUsize::new(0));
    let count = || {
        done.fetch_add(1, Ordering::Relaxed);
    };
    let watch = RunControl {
        stop: &stop,
        done: &count,
    };
    let speed = |scenario: &Scenario<f64>, _: &Trajectory<0>| scenario.run.wheel_speed_rpm;
    let made = observe(&scenarios, timing, ALL_TURNS, watch, speed).expect("valid");
    for (k, speed) in made.iter().enumerate() {
        assert_eq!(*speed, Some(1500.0 + k as f64));
    }
    assert_eq!(done.load(Ordering::Relaxed), 70);
    stop.store(true, Ordering::Relaxed);
    let made = observe(&scenarios, timing, ALL_TURNS, watch, speed).expect("valid");
    assert!(made.iter().all(Option::is_none));
}
