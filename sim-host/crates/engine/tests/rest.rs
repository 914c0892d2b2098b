//! The integrators at rest, at exact zeros and at the ends of the parameters' ranges: they end,
//! they stay bounded where the reference does, and at rest the exponent is the greatest real part
//! of the eigenvalues.

use engine::Reason;
use engine::dual::Dual;
use engine::reference::Reference;
use engine::taylor::{Ensemble, Observables, Span, Trajectory};
use nalgebra::{Matrix4, Vector4};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use shared_model::Scenario;
use shared_model::dither::{Injection, Waveform};
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::stability::fastest_rate_per_s;
use shared_model::tire::TireModel;
use shared_model::vehicle::{Model, STEERING_RATE, SlipForm};

const SETTLED_S: f64 = 200.0;
const OBSERVED_S: f64 = 40.0;
/// Time up to which engine and reference are compared where a motion diverges, s.
const COMPARABLE_S: f64 = 30.0;

fn span(time_s: f64, segments: usize) -> Span {
    Span {
        time_s,
        tolerance: 1e-10,
        observables: Observables {
            turns: [true; 4],
            section: Some((1, 0.0)),
        },
        warm_up_s: if segments > 0 { 0.5 * time_s } else { 0.0 },
        segments,
    }
}

/// Parameters and starts over their ranges, exact zeros among them.
fn scenario() -> impl Strategy<Value = Scenario<f64>> {
    let zero_or = |range: std::ops::Range<f64>| prop_oneof![1 => Just(0.0), 3 => range];
    let kinds = (
        select(vec![FrictionLaw::None, FrictionLaw::CoulombRate]),
        select(vec![Waveform::None, Waveform::Square, Waveform::Sine]),
        select(vec![SlipForm::SmallAngle, SlipForm::Exact]),
        select(vec![TireModel::Cubic, TireModel::MagicFormula]),
    );
    let friction = prop_oneof![
        Just(0.0),
        Just(1e-300),
        Just(1e-17),
        Just(1e-13),
        Just(1e-6),
        0.0..2.0
    ];
    let numbers = (
        50.0..3000.0,
        zero_or(0.0..0.3),
        friction,
        zero_or(-15.0..15.0),
        zero_or(0.0..1000.0),
        zero_or(0.0..0.05),
        zero_or(0.0..0.05),
        zero_or(0.0..5000.0),
    );
    let start = (
        zero_or(-0.3..0.3),
        zero_or(-1.0..1.0),
        zero_or(-0.5..0.5),
        zero_or(-2.0..2.0),
    );
    (kinds, numbers, start).prop_map(|((law, waveform, slip, tires), n, start)| {
        let mut s = Scenario::reconstruction();
        s.friction.law = law;
        s.dither.waveform = waveform;
        s.vehicle.slip_form = slip;
        s.tires.model = tires;
        s.run.wheel_speed_rpm = n.0;
        // The sine's volts are worth 1/(2 pi) of the square wave's.
        s.dither.amplitude_v = if waveform == Waveform::Sine {
            6.0 * n.1
        } else {
            n.1
        };
        s.friction.coefficient = n.2;
        s.steering.motor_current_a = n.3;
        s.steering.damping_nm_s_per_rad = n.4;
        s.steering.pneumatic_trail_m = n.5;
        s.steering.mechanical_trail_m = n.6;
        s.tires.rear.peak_n = n.7;
        s.run.sideslip_rad = start.0;
        s.run.yaw_rate_rad_per_s = start.1;
        s.run.steering_angle_rad = start.2;
        s.run.steering_rate_rad_per_s = start.3;
        s
    })
}

/// The right-hand side linearised at a state.
fn jacobian(
    model: &Model<f64>,
    injection: Injection<f64>,
    mode: FrictionMode,
    x: &Vector4<f64>,
) -> Matrix4<f64> {
    let model = model.map(&Dual::<4>::constant);
    let seeded = Vector4::from_fn(|i, _| {
        Dual::new(x[i], std::array::from_fn(|k| f64::from(u8::from(i == k))))
    });
    let slope = model.derivative(&seeded, injection.map(Dual::constant), mode);
    Matrix4::from_fn(|i, k| slope[i].tangent[k])
}

/// Greatest real part of the eigenvalues of the motion near rest; where the steering sticks, of the
/// motion that is left.
fn greatest_real_part(jacobian: &Matrix4<f64>, sticks: bool) -> f64 {
    let mut jacobian = *jacobian;
    if sticks {
        // The steering angle stays as it is, and its rate is zero: a direction that neither grows
        // nor decays, and one that is none.
        jacobian.row_mut(STEERING_RATE).fill(0.0);
        jacobian[(STEERING_RATE, STEERING_RATE)] = -1e9;
    }
    jacobian
        .complex_eigenvalues()
        .iter()
        .map(|value| value.re)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// The largest exponent of a motion that rests, 1/s: by its tangent vector, and by the eigenvalues.
fn exponents_at_rest(scenario: &Scenario<f64>, found: &Trajectory<1>) -> Option<(f64, f64)> {
    let moved = (0..4).map(|i| found.upper[i] - found.lower[i]);
    if moved.fold(0.0, f64::max) > 1e-9 || found.events > 0 {
        return None;
    }
    let (model, injection) = (Model::new(scenario), scenario.dither.injection(0.0));
    let sticks = found.end.friction == FrictionMode::Sticking;
    let linear = jacobian(&model, injection, found.end.friction, &found.end.x);
    let wanted = greatest_real_part(&linear, sticks);
    let mean = found
        .log_stretching
        .iter()
        .map(|growth| growth[0])
        .sum::<f64>()
        / (0.5 * OBSERVED_S);
    Some((mean, wanted))
}

/// A focus grows unevenly within a turn, and directions of nearly the same rate part slowly: some
/// e-folds over the time.
fn tolerance(wanted_per_s: f64) -> f64 {
    4.0 / (0.5 * OBSERVED_S) + 1e-3 * wanted_per_s.abs()
}

/// Trajectories that come to rest, in all ways that there are: free and stuck, at a focus and at a
/// node, with friction of no torque, of less than rounding, and of the paper's.
#[test]
fn the_exponent_at_rest_is_the_greatest_real_part() {
    let (mut free, mut stuck) = (0, 0);
    for (waveform, amplitude_v) in [
        (Waveform::None, 0.0),
        (Waveform::Square, 0.14),
        (Waveform::Square, 0.15),
        (Waveform::Sine, 1.4),
    ] {
        for coefficient in [0.0, 1e-300, 1e-17, 1e-14, 1e-9, 0.28] {
            for (rpm, slip) in [
                (400.0, SlipForm::SmallAngle),
                (1000.0, SlipForm::Exact),
                (1750.0, SlipForm::SmallAngle),
                (1750.0, SlipForm::Exact),
            ] {
                let mut scenario = Scenario::reconstruction();
                scenario.friction.coefficient = coefficient;
                scenario.dither.waveform = waveform;
                scenario.dither.amplitude_v = amplitude_v;
                scenario.vehicle.slip_form = slip;
                scenario.run.wheel_speed_rpm = rpm;
                let case =
                    format!("{waveform:?} {amplitude_v} V, {coefficient}, {rpm} rpm, {slip:?}");
                let mut motions = Ensemble::new(&[scenario]).expect("supported");
                let settled = motions.integrate::<0>(&span(SETTLED_S, 0));
                motions.continue_from(&settled);
                let found = motions.integrate::<1>(&span(OBSERVED_S, 4)).remove(0);
                assert!(
                    settled[0].early_end.is_none() && found.early_end.is_none(),
                    "{case}"
                );
                // A motion takes some ten steps per second.
                assert!(
                    found.steps < 100 * OBSERVED_S as usize,
                    "{case}: {} steps",
                    found.steps
                );
                if let Some((mean, wanted)) = exponents_at_rest(&scenario, &found) {
                    assert!(
                        (mean - wanted).abs() < tolerance(wanted),
                        "{case}: {mean} for {wanted}"
                    );
                    let sticks = found.end.friction == FrictionMode::Sticking;
                    *(if sticks { &mut stuck } else { &mut free }) += 1;
                }
            }
        }
    }
    assert!(free >= 10 && stuck >= 10, "{free} free, {stuck} stuck");
}

proptest! {
    // The same scenarios in every run.
    #![proptest_config(ProptestConfig {
        cases: 150,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Whatever the scenario, the engine ends; it says that a motion diverges only if the reference says so too; and where the motion
    /// has come to rest, its exponent is that of the linearised motion.
    #[test]
    fn the_engine_ends_and_is_right_at_rest(scenario in scenario()) {
        prop_assume!(scenario.validate().is_ok());
        let one = std::slice::from_ref(&scenario);
        let Ok(mut motions) = Ensemble::new(one) else {
            // Friction under the mean of a sine.
            return Ok(());
        };
        let settled = motions.integrate::<0>(&span(SETTLED_S, 0)).remove(0);
        motions.continue_from(std::slice::from_ref(&settled));
        let found = motions.integrate::<1>(&span(OBSERVED_S, 4)).remove(0);
        let later = found.early_end.map(|end| end.later_by(SETTLED_S));
        if let Some(end) = settled.early_end.or(later) {
            prop_assert_eq!(end.reason, Reason::Diverges);
            // Later on the error of either may have grown to the size of the motion: in chaos, or in a slow drift across an
            // equilibrium's loss of stability, where rounding decides to which side the motion leaves.
            if end.time_s < COMPARABLE_S {
                let mut reference = Reference::new(&scenario, 1e-9).expect("it is valid");
                let known = reference.run(2.0 * end.time_s + 1.0).err();
                let reason = known.map(|end| end.reason);
                prop_assert_eq!(reason, Some(Reason::Diverges), "{} by the reference", end);
            }
            return Ok(());
        }
        if let Some((mean, wanted)) = exponents_at_rest(&scenario, &found) {
            prop_assert!((mean - wanted).abs() < tolerance(wanted), "{mean} for {wanted}");
        }
    }

    /// The bound on the fastest rate holds for the eigenvalues at all slip angles that a bounded motion visits.
    #[test]
    fn no_rate_is_faster_than_the_bound(scenario in scenario(), shares in [-1.0..1.0_f64, -1.0..1.0]) {
        let (model, injection) = (Model::new(&scenario), scenario.dither.injection(0.0));
        let bound = fastest_rate_per_s(&scenario);
        // Slip angles up to the one without force.
        let zero_force = |tire: &shared_model::tire::MagicFormula<f64>| {
            let tire = tire.cubic();
            (tire.linear_n_per_rad / tire.cubic_n_per_rad3).sqrt()
        };
        let (front, rear) = (zero_force(&scenario.tires.front), zero_force(&scenario.tires.rear));
        prop_assume!(front.is_finite() && scenario.dither.amplitude_rad() == 0.0);
        let rear = if rear.is_finite() { rear } else { 0.0 };
        // At rest in yaw the rear slip angle is the sideslip angle, the front one that less the steering angle.
        let x = Vector4::new(shares[1] * rear, 0.0, shares[1] * rear - shares[0] * front, 0.0);
        let linear = jacobian(&model, injection, FrictionMode::Neutral, &x);
        let fastest = linear.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max);
        prop_assert!(fastest <= bound * 1.001 + 1e-9, "{fastest} above {bound}");
    }
}
