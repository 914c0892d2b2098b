//! Equilibria, their eigenvalues and Hopf bifurcations against motions.

use dynamics::equilibria::{Equilibrium, find, hopf, over_speed};
use dynamics::extrema::Extrema;
use dynamics::sweep::{Parameter, RunControl, Values};
use engine::Stepper;
use nalgebra::Vector4;
use shared_model::dither::Waveform;
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::vehicle::{Model, YAW_RATE};
use shared_model::{Preset, Scenario};
use std::sync::atomic::AtomicBool;

static GO_ON: AtomicBool = AtomicBool::new(false);
const WATCH: RunControl = RunControl {
    stop: &GO_ON,
    done: &|| {},
};

fn at(rpm: f64, law: FrictionLaw) -> Scenario<f64> {
    let mut scenario = Parameter::Speed.set(&Scenario::reconstruction(), rpm);
    scenario.friction.law = law;
    scenario
}

/// The balance has a closed form: the motor fixes the front force, the yaw moment the rear one, and
/// each cubic tyre gives a force that small at three slip angles.
#[test]
fn all_nine_are_found_and_balance() {
    for rpm in [800.0, 1750.0] {
        let scenario = at(rpm, FrictionLaw::CoulombRate);
        let found = find(&scenario).expect("valid");
        assert_eq!(found.len(), 9, "{rpm} rpm");
        let model = Model::new(&scenario);
        let front_n = scenario.steering.motor_torque_nm() / scenario.steering.trail_m();
        for equilibrium in &found {
            assert!(equilibrium.residual < 1e-9, "{equilibrium:?}");
            let x = Vector4::from(equilibrium.state);
            let injection = shared_model::dither::Injection::Off;
            let rates = model.derivative(&x, injection, FrictionMode::Neutral);
            assert!(rates.amax() < 1e-9, "{rates}");
            let (front, rear) = model.cornering_forces(&x, injection);
            assert!((front / front_n - 1.0).abs() < 1e-9);
            assert!((rear / (front_n * 1.2 / 1.3) - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn other_laws_tyres_and_dithers_balance_too() {
    let printed = Scenario::preset(Preset::Printed);
    let mut dithered = at(1750.0, FrictionLaw::CoulombRate);
    dithered.dither.waveform = Waveform::Square;
    dithered.dither.amplitude_v = 0.1;
    let mut magic = at(1750.0, FrictionLaw::None);
    magic.tires.model = shared_model::tire::TireModel::MagicFormula;
    for scenario in [printed, dithered, magic] {
        let found = find(&scenario).expect("valid");
        assert!(!found.is_empty());
        assert!(found.iter().all(|e| e.residual < 1e-9));
    }
}

/// A motion from near a stable equilibrium comes to rest at it, and with stick in its band.
#[test]
fn a_long_motion_rests_where_the_equilibrium_is() {
    for law in [FrictionLaw::None, FrictionLaw::CoulombRate] {
        let scenario = at(1000.0, law);
        let found = find(&scenario).expect("valid");
        let stable: Vec<_> = found.iter().filter(|e| e.stable).collect();
        assert!(!stable.is_empty());
        for equilibrium in stable {
            let mut motion = Stepper::new(&scenario).expect("valid");
            let off = Vector4::new(1e-3, -1e-3, 1e-3, 0.0);
            let start = motion.model().state(Vector4::from(equilibrium.state) + off);
            motion.set_state(start);
            let end: [f64; 4] = motion.run(400.0).x.into();
            let apart = (Vector4::from(end) - Vector4::from(equilibrium.state)).amax();
            match law {
                FrictionLaw::None => assert!(apart < 1e-8, "{apart}"),
                _ => assert!(equilibrium.holds(&end), "{end:?} {equilibrium:?}"),
            }
        }
    }
}

/// Growth rate (1/s) and angular frequency (rad/s) of a small oscillation about an equilibrium,
/// from the maxima of its yaw rate.
fn oscillation(scenario: &Scenario<f64>, equilibrium: &Equilibrium) -> (f64, f64) {
    let mut motion = Stepper::new(scenario).expect("valid");
    let off = Vector4::new(1e-5, 0.0, 0.0, 0.0);
    let start = motion.model().state(Vector4::from(equilibrium.state) + off);
    motion.set_state(start);
    let step_s = motion.step_s();
    // Only the leading pair is left after this.
    motion.run(5.0);
    let mut extrema = Extrema::default();
    // In millionths, so that every maximum counts.
    motion
        .observe(30.0, |time_s, state| {
            extrema.push(
                time_s,
                step_s,
                1e6 * (state.x[YAW_RATE] - equilibrium.state[YAW_RATE]),
            );
        })
        .expect("the motion stays near");
    let maxima = extrema.maxima();
    let (first, last) = (maxima[0], maxima[maxima.len() - 1]);
    let time_s = last.0 - first.0;
    let cycles = (maxima.len() - 1) as f64;
    (
        (last.1 / first.1).ln() / time_s,
        std::f64::consts::TAU * cycles / time_s,
    )
}

#[test]
fn motions_grow_above_the_hopf_speed_and_decay_below() {
    let scenario = at(1650.0, FrictionLaw::None);
    let speeds = Values::new("wheel speed", 1640.0, 1660.0, 10.0).expect("valid");
    let found = over_speed(&scenario, &speeds, WATCH).expect("valid");
    let hopf = hopf(&scenario, &found).expect("valid");
    let [hopf] = &hopf[..] else {
        panic!("{hopf:?}");
    };
    assert!(hopf.destabilises && hopf.upper_rpm - hopf.lower_rpm <= 0.01);
    assert!((hopf.state[2] + 0.4685).abs() < 1e-3, "{hopf:?}");
    for (rpm, grows) in [
        (hopf.lower_rpm - 10.0, false),
        (hopf.upper_rpm + 10.0, true),
    ] {
        let scenario = at(rpm, FrictionLaw::None);
        let all = find(&scenario).expect("valid");
        let distance = |e: &Equilibrium| (e.state[2] - hopf.state[2]).abs();
        let equilibrium = all
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .expect("there are some");
        let pair = equilibrium.leading_pair().expect("it oscillates");
        assert_eq!(pair.re > 0.0, grows);
        let (growth, frequency) = oscillation(&scenario, equilibrium);
        assert!(
            (growth - pair.re).abs() < 1e-4,
            "{rpm} rpm: {growth} against {pair}"
        );
        assert!(
            (frequency / pair.im - 1.0).abs() < 1e-4,
            "{frequency} against {pair}"
        );
    }
}
