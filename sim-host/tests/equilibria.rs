//! Equilibria, their eigenvalues and Hopf bifurcations against motions.

use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::friction::FrictionLaw;
use shared_model::vehicle::YAW_RATE;
use sim_host::chaos::equilibria::{Equilibrium, find, hopf, over_speed};
use sim_host::chaos::extrema::Extrema;
use sim_host::chaos::sweep::{Values, Watch};
use sim_host::motion::Motion;
use sim_host::simulate::started_at;
use std::sync::atomic::AtomicBool;

static STOP: AtomicBool = AtomicBool::new(false);
const WATCH: Watch = Watch {
    stop: &STOP,
    done: &|| {},
};

fn at(rpm: f64, law: FrictionLaw) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.run.wheel_speed_rpm = rpm;
    scenario.friction.law = law;
    scenario
}

#[test]
fn explore() {
    for rpm in [1000.0, 1750.0] {
        for law in [
            FrictionLaw::None,
            FrictionLaw::CoulombRate,
            FrictionLaw::PrintedAngle,
        ] {
            println!("== {rpm} {law:?}");
            for e in find(&at(rpm, law)).unwrap() {
                println!(
                    "{:?} res {:.1e} stable {} slips {:?}",
                    e.state, e.residual, e.stable, e.slip_angles_rad
                );
                println!(
                    "   {}",
                    e.eigenvalues_per_s
                        .iter()
                        .map(|e| e.to_string())
                        .collect::<Vec<_>>()
                        .join("; ")
                );
                if let Some(b) = e.stick_band {
                    println!(
                        "   band {:?} {:?} {} {}",
                        b.lower, b.upper, b.eigenvalues_per_s[0], b.stable
                    );
                }
            }
        }
    }
    let t = std::time::Instant::now();
    let speeds = Values::new("rpm", 500.0, 2000.0, 10.0).unwrap();
    let s = at(1000.0, FrictionLaw::None);
    let all = over_speed(&s, &speeds, WATCH).unwrap();
    println!("{:?}", t.elapsed());
    for h in hopf(&s, &all).unwrap() {
        println!("{h:?}");
    }
    println!("{:?}", t.elapsed());
}
