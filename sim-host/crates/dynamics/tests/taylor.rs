//! The Taylor engine against the reference integrator and against the fixed-step methods.

use dynamics::flow::VehicleFlow;
use dynamics::lyapunov::exponents;
use engine::reference::Reference;
use engine::taylor::{Compiled, Ensemble, Observables, Span, Tangents, Trajectory, Unsupported};
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::friction::FrictionLaw;
use shared_model::tire::TireModel;
use shared_model::vehicle::SlipForm;

fn span(time_s: f64) -> Span {
    Span {
        time_s,
        tolerance: 1e-12,
        observables: Observables::default(),
        warm_up_s: 0.0,
        segments: 0,
    }
}

fn follow<const K: usize>(scenarios: &[Scenario<f64>], span: &Span) -> Vec<Trajectory<K>>
where
    Tangents<K>: Compiled<K>,
{
    Ensemble::new(scenarios)
        .expect("all are supported")
        .integrate(span)
}

fn at_speed(wheel_speed_rpm: f64) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.wheel_speed_rpm = wheel_speed_rpm;
    scenario
}

/// Exact slip angles, the Magic Formula, and both, each with every dither.
fn analytic_scenarios() -> Vec<Scenario<f64>> {
    let mut scenarios = Vec::new();
    for (slip_form, tires) in [
        (SlipForm::Exact, TireModel::Cubic),
        (SlipForm::SmallAngle, TireModel::MagicFormula),
        (SlipForm::Exact, TireModel::MagicFormula),
    ] {
        for (waveform, amplitude_v) in [
            (Waveform::None, 0.0),
            (Waveform::Square, 0.1),
            (Waveform::Sine, 1.0),
        ] {
            let mut scenario = at_speed(1750.0);
            scenario.vehicle.slip_form = slip_form;
            scenario.tires.model = tires;
            scenario.dither.waveform = waveform;
            scenario.dither.amplitude_v = amplitude_v;
            scenarios.push(scenario);
        }
    }
    scenarios
}

/// Every friction law and dither, at speeds from rest to chaos.
fn scenarios() -> Vec<Scenario<f64>> {
    let mut scenarios = Vec::new();
    for wheel_speed_rpm in [900.0, 1500.0, 1750.0] {
        for law in [
            FrictionLaw::None,
            FrictionLaw::CoulombRate,
            FrictionLaw::PrintedAngle,
        ] {
            for (waveform, amplitude_v) in [
                (Waveform::None, 0.0),
                (Waveform::Square, 0.1),
                (Waveform::Sine, 1.0),
            ] {
                let mut scenario = at_speed(wheel_speed_rpm);
                scenario.friction.law = law;
                scenario.dither.waveform = waveform;
                scenario.dither.amplitude_v = amplitude_v;
                scenarios.push(scenario);
            }
        }
    }
    // The sign function's two steps under the mean of a square wave.
    let mut stepped = at_speed(1750.0);
    stepped.friction.dithered = true;
    stepped.dither.waveform = Waveform::Square;
    for amplitude_v in [2e-4, 5e-4] {
        stepped.dither.amplitude_v = amplitude_v;
        scenarios.push(stepped);
    }
    // The sign of the steering angle, which passes zero.
    let mut passing = at_speed(1750.0);
    passing.friction.law = FrictionLaw::PrintedAngle;
    passing.run.steering_angle_rad = -0.1;
    passing.run.steering_rate_rad_per_s = 6.0;
    scenarios.push(passing);
    scenarios.extend(analytic_scenarios());
    scenarios
}

#[test]
fn motions_and_events_are_the_references() {
    let scenarios = scenarios();
    let found = follow::<0>(&scenarios, &span(5.0));
    let mut events = Vec::new();
    for (scenario, found) in scenarios.iter().zip(found) {
        let mut reference = Reference::new(scenario, 1e-13).expect("it is valid");
        let end = *reference.run(5.0).expect("it stays bounded");
        let error = (found.end.x - end.x).amax();
        let what = (
            scenario.run.wheel_speed_rpm,
            scenario.friction,
            scenario.dither,
        );
        assert!(error < 2e-8, "{error}: {what:?}");
        assert_eq!(found.end.friction, end.friction, "{what:?}");
        assert_eq!(found.events, reference.events().len(), "{what:?}");
        events.push(found.events);
    }
    assert!(events[27..].iter().all(|&events| events > 0), "{events:?}");
}

/// The error falls with the tolerance, down to rounding.
#[test]
fn the_tolerance_is_kept() {
    let mut scenarios: Vec<_> = [1600.0, 1750.0, 1880.0].map(at_speed).into();
    scenarios.extend(analytic_scenarios());
    let ends: Vec<_> = scenarios
        .iter()
        .map(|scenario| {
            Reference::new(scenario, 1e-14)
                .expect("it is valid")
                .run(3.0)
                .expect("it stays bounded")
                .x
        })
        .collect();
    for tolerance in [1e-6, 1e-8, 1e-10, 1e-12] {
        let span = Span {
            tolerance,
            ..span(3.0)
        };
        let found = follow::<0>(&scenarios, &span);
        for (found, end) in found.iter().zip(&ends) {
            let error = (found.end.x - end).amax();
            assert!(error < 1e3 * tolerance, "{error} for {tolerance}");
        }
    }
}

/// Turning points: the rate is zero there, and no sample in between lies beyond them.
#[test]
fn turning_points_and_extents_are_exact() {
    let scenario = at_speed(1750.0);
    let span = Span {
        observables: Observables {
            turns: [true; 4],
            section: Some((1, 0.1)),
        },
        ..span(8.0)
    };
    let found = follow::<0>(&[scenario], &span).remove(0);
    let mut reference = Reference::new(&scenario, 1e-13).expect("it is valid");
    let (mut lower, mut upper) = (reference.state().x, reference.state().x);
    let (mut crossings, mut maxima) = (0, 0);
    let mut before = (reference.state().x[1], f64::NEG_INFINITY);
    for _ in 0..80_000 {
        let x = reference.run(1e-4).expect("it stays bounded").x;
        (lower, upper) = (lower.zip_map(&x, f64::min), upper.zip_map(&x, f64::max));
        crossings += usize::from((before.0 < 0.1) != (x[1] < 0.1));
        maxima += usize::from(before.1 > 0.0 && x[1] < before.0);
        before = (x[1], x[1] - before.0);
    }
    for i in 0..4 {
        // Samples a ten-thousandth of a second apart miss the extremes by 1e-6 at most, and a kink
        // by more.
        let miss = if i == 3 { 1e-2 } else { 1e-6 };
        assert!(
            found.lower[i] <= lower[i] + 1e-9 && lower[i] - found.lower[i] < miss,
            "{i}"
        );
        assert!(
            found.upper[i] >= upper[i] - 1e-9 && found.upper[i] - upper[i] < miss,
            "{i}"
        );
    }
    assert_eq!(found.crossings.len(), crossings);
    for crossing in &found.crossings {
        assert!((crossing.x[1] - 0.1).abs() < 1e-14);
    }
    let pairs = found.turns[1].windows(2);
    let falls = pairs.filter(|pair| pair[1].1 < pair[0].1).count();
    assert!(falls.abs_diff(maxima) <= 1, "{falls} {maxima}");
}

/// Largest exponent and spectrum against dual numbers through the fixed step.
#[test]
fn exponents_are_those_of_the_fixed_step() {
    for (law, slip_form) in [
        (FrictionLaw::None, SlipForm::SmallAngle),
        (FrictionLaw::CoulombRate, SlipForm::SmallAngle),
        (FrictionLaw::CoulombRate, SlipForm::Exact),
    ] {
        let mut scenario = at_speed(1750.0);
        scenario.friction.law = law;
        scenario.vehicle.slip_form = slip_form;
        let time_s = 400.0;
        let span = Span {
            warm_up_s: 0.1 * time_s,
            segments: 128,
            ..span(time_s)
        };
        let motions = Ensemble::new(&[scenario]).expect("it fits");
        let mean = |log_stretching: Vec<f64>| log_stretching.iter().sum::<f64>() / (0.9 * time_s);
        let largest = mean(
            motions.integrate::<1>(&span)[0]
                .log_stretching
                .iter()
                .map(|g| g[0])
                .collect(),
        );
        let spectrum = &motions.integrate::<4>(&span)[0].log_stretching;
        let spectrum: Vec<f64> = (0..4)
            .map(|k| mean(spectrum.iter().map(|g| g[k]).collect()))
            .collect();
        let flow = VehicleFlow::new(&scenario).expect("it is valid");
        let wanted = exponents::<4, 4>(&flow, &flow.start(), time_s).expect("long enough");
        for (k, wanted) in wanted.iter().enumerate() {
            let found = spectrum[k];
            match wanted {
                Some(wanted) => {
                    let error = 3.0 * wanted.standard_error_per_s + wanted.resolution_per_s;
                    assert!(
                        (found - wanted.per_s).abs() < error,
                        "{found} {wanted} of {k}"
                    );
                }
                None => assert_eq!(found, f64::NEG_INFINITY),
            }
        }
        assert!(
            (largest - spectrum[0]).abs() < 1e-9,
            "{largest} {}",
            spectrum[0]
        );
    }
}

/// What the first tangent vector has grown by at turning points of the yaw rate is what it would
/// have grown by if the motion ended there.
#[test]
fn growth_at_turns_is_that_of_shorter_motions() {
    let scenario = at_speed(1750.0);
    let motions = Ensemble::new(&[scenario]).expect("it fits");
    let mut observables = Observables::default();
    observables.turns[1] = true;
    let turning = Span {
        observables,
        warm_up_s: 1.0,
        segments: 8,
        ..span(9.0)
    };
    let growth_until = |time_s: f64| -> f64 {
        let whole = Span {
            segments: 1,
            ..span(time_s)
        };
        motions.integrate::<1>(&whole)[0].log_stretching[0][0]
    };
    let (one, all) = (
        motions.integrate::<1>(&turning),
        motions.integrate::<4>(&turning),
    );
    // Before counting begins the vector is not of length one.
    let begin = 0.5 * (1.5_f64.powi(2) + 3.0 * 0.5_f64.powi(2)).ln();
    let turns = &one[0].turns[1];
    assert!(turns.len() > 8 && one[0].log_stretching_at_turns.len() == turns.len());
    for (k, &(time_s, _)) in turns.iter().enumerate() {
        let wanted = growth_until(time_s) + begin;
        let (one, all) = (
            one[0].log_stretching_at_turns[k],
            all[0].log_stretching_at_turns[k],
        );
        assert!((one - wanted).abs() < 1e-6, "{one} {wanted} at {time_s} s");
        assert!((all - wanted).abs() < 1e-6, "{all} {wanted} at {time_s} s");
    }
}

/// Without friction the sum of all exponents is the mean of the divergence, which the frame's
/// volume must follow exactly.
#[test]
fn the_largest_exponent_alone_and_in_the_spectrum_are_one() {
    let mut scenario = at_speed(1845.0);
    scenario.friction.law = FrictionLaw::None;
    let span = Span {
        warm_up_s: 1.0,
        segments: 8,
        ..span(20.0)
    };
    let motions = Ensemble::new(&[scenario]).expect("it fits");
    let one = &motions.integrate::<1>(&span)[0].log_stretching;
    let all = &motions.integrate::<4>(&span)[0].log_stretching;
    for (one, all) in one.iter().zip(all) {
        assert!((one[0] - all[0]).abs() < 1e-6, "{one:?} {all:?}");
    }
}

#[test]
fn what_does_not_fit_is_said() {
    let mut scenario = at_speed(1750.0);
    scenario.dither.waveform = Waveform::Sine;
    scenario.dither.amplitude_v = 1.0;
    scenario.friction.dithered = true;
    assert_eq!(
        Ensemble::new(&[scenario]).err(),
        Some(Unsupported::SmoothFriction)
    );
    scenario.run.wheel_speed_rpm = f64::NAN;
    assert!(matches!(
        Ensemble::new(&[scenario]),
        Err(Unsupported::Invalid(_))
    ));
}
