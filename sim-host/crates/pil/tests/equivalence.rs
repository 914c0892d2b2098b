//! The comparison of f32 and f64, on host runs of both: it passes where it should, and fails where
//! it should.

use dynamics::lyapunov::largest;
use dynamics::period::mean_cycle_s;
use dynamics::simulate::{settle, simulate, started_at};
use pil::equivalence::{
    bounds_distance, divergence, horizon_s, one_step, parted_at_s, poincare_distance,
};
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};

/// A run at `rpm` from the attractor, `later_s` further along it, from a state that f32 has.
fn scenario(rpm: f64, later_s: f64, duration_s: f64) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.wheel_speed_rpm = rpm;
    scenario.run.duration_s = duration_s;
    let start = settle(&scenario, 200.0 + later_s).expect("the scenario is valid");
    started_at(&scenario, &start.map(|value| f64::from(value as f32)))
}

fn in_f32(scenario: &Scenario<f64>) -> dynamics::trace::Trace {
    simulate(&scenario.map(&|value| value as f32)).expect("the scenario is valid")
}

#[test]
fn one_step_defects_keep_their_bound() {
    for application in [Application::Averaged, Application::Signal] {
        for waveform in [Waveform::None, Waveform::Square, Waveform::Sine] {
            let mut scenario = scenario(1750.0, 0.0, 20.0);
            scenario.dither.application = application;
            scenario.dither.waveform = waveform;
            scenario.dither.amplitude_v = if waveform == Waveform::Sine { 1.0 } else { 0.1 };
            let worst = one_step(&scenario, &in_f32(&scenario))
                .expect("valid")
                .worst();
            assert!(worst <= 1.0, "{waveform:?} {application:?}: {worst}");
            assert!(
                worst > 0.1,
                "{waveform:?} {application:?}: a bound {worst} of which is used says nothing"
            );
        }
    }
}

/// The bound is tight enough to see an error of a few units in the last place.
#[test]
fn a_wrong_word_breaks_the_bound() {
    let scenario = scenario(1750.0, 0.0, 5.0);
    for component in 0..4 {
        let mut trace = in_f32(&scenario);
        let value = &mut trace.states[3210].x[component];
        *value = f32::from_bits((*value as f32).to_bits() ^ (1 << 6)).into();
        let worst = one_step(&scenario, &trace).expect("valid").worst();
        assert!(worst > 1.0, "component {component}: {worst}");
    }
}

/// Another mass by one part in ten thousand is another model.
#[test]
fn a_slightly_different_model_breaks_the_bound() {
    let scenario = scenario(1750.0, 0.0, 5.0);
    let trace = in_f32(&scenario);
    let mut other = scenario;
    other.vehicle.mass_kg *= 1.0001;
    assert!(one_step(&other, &trace).expect("valid").worst() > 1.0);
}

/// Of many starts, nearly all part within the predicted interval, on both sides of the expectation.
#[test]
fn horizons_are_predicted() {
    let long = scenario(1750.0, 0.0, 600.0);
    let trace = simulate(&long).expect("the scenario is valid");
    let exponent = largest(&long, &trace, 0).expect("the run is long enough");
    let mut inside = 0;
    let mut early = 0;
    const STARTS: u32 = 40;
    for start in 0..STARTS {
        let scenario = scenario(1750.0, 20.0 * f64::from(start), 150.0);
        let (a, b) = (in_f32(&scenario), simulate(&scenario).expect("valid"));
        let rms = one_step(&scenario, &a).expect("valid").relative_rms;
        let [least, expected, greatest] = horizon_s(&exponent, rms, a.step_s);
        let cycle_s = mean_cycle_s(&a).expect("the motion has cycles");
        let parted = parted_at_s(&divergence(&a, &b), cycle_s).expect("chaotic motions part");
        inside += u32::from((least..=greatest).contains(&parted));
        early += u32::from(parted < expected);
    }
    assert!(
        inside >= STARTS - 2,
        "{inside} of {STARTS} within the interval"
    );
    assert!(
        (STARTS / 5..=STARTS * 4 / 5).contains(&early),
        "{early} of {STARTS} before the expectation"
    );
}

#[test]
fn invariants_tell_speeds_apart() {
    let (short, long) = (scenario(1750.0, 0.0, 60.0), scenario(1750.0, 777.0, 600.0));
    let run = |scenario| simulate(scenario).expect("the scenario is valid");
    let (own, host) = (run(&short), run(&long));
    assert!(bounds_distance(&own, 0, &host, 0) <= 1.0);
    let (distance, critical) = poincare_distance(&own, 0, &host, 0);
    assert!(distance <= critical);
    // A speed 15 % lower has another attractor.
    let other = run(&scenario(1490.0, 0.0, 60.0));
    assert!(bounds_distance(&other, 0, &host, 0) > 1.0);
    let (distance, critical) = poincare_distance(&other, 0, &host, 0);
    assert!(distance > critical);
}
