//! The vehicle's branches.

use continuation::arclength::Settings;
use continuation::branch::follow;
use continuation::orbit::Shooting;
use continuation::start::near_returns;
use continuation::vehicle::Vehicle;
use nalgebra::Vector4;
use shared_model::Scenario;

const TOLERANCE: f64 = 1e-12;

fn branch(coefficient: f64, rpm: f64, range: (f64, f64), cycles: usize) {
    let mut scenario = Scenario::reconstruction();
    scenario.friction.coefficient = coefficient;
    scenario.run.wheel_speed_rpm = rpm;
    let vehicle = Vehicle::new(&scenario, ["run.wheel_speed_rpm", "friction.coefficient"]).unwrap();
    let start = Vector4::new(0.15, 0.0, 0.46, 0.0);
    let p = vehicle.parameters();
    let t = std::time::Instant::now();
    let returns = near_returns(&vehicle, p, &start, 1, 60.0, 60.0, 4, 1e-9).unwrap();
    println!("returns in {:?}", t.elapsed());
    for r in &returns {
        println!(
            "{} {} {} {:?}",
            r.cycles,
            r.period_s,
            r.distance,
            r.start.as_slice()
        );
    }
    let r = returns[cycles - 1];
    let spans = [500.0, 0.28];
    let problem =
        Shooting::<_, 4, 6>::new(&vehicle, &r.start, r.period_s, p, spans, 1, 1, TOLERANCE)
            .unwrap();
    let guess = problem.guess(&r.start, r.period_s, p).unwrap();
    for sign in [1.0, -1.0] {
        let t = std::time::Instant::now();
        let settings = Settings::over(&[range]);
        let branch = follow(
            &problem,
            guess.clone(),
            &problem.parameter_axis(sign),
            &settings,
            |_| true,
        );
        let branch = match branch {
            Ok(b) => b,
            Err(e) => {
                println!("{e}");
                continue;
            }
        };
        println!(
            "{} orbits in {:?}; end {}",
            branch.orbits.len(),
            t.elapsed(),
            branch.end
        );
        for o in branch.orbits.iter().step_by(10) {
            println!(
                "  {:.4} T {:.6} {:?} triv {:.1e} legs {} {}",
                o.parameters[0],
                o.period_s,
                o.multipliers,
                o.trivial_error,
                o.segments[0].legs.len(),
                o.modes().len()
            );
        }
        for s in &branch.specials {
            println!(
                "  {} at {:.9} +- {:.1e}: T {:.6} {:?}",
                s.kind.name(),
                s.orbit.parameters[0],
                s.parameter_error,
                s.orbit.period_s,
                s.orbit.multipliers
            );
        }
    }
}

#[test]
fn smooth() {
    branch(0.0, 1600.0, (1400.0, 2000.0), 1);
}

#[test]
fn dry() {
    branch(0.28, 1600.0, (1400.0, 2000.0), 1);
}
