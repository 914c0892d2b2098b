//! Orbits of one cycle: near a trajectory, and along a branch over the wheel speed.

use crate::settled::VehicleOrbit;
use crate::sweep::Parameter;
use continuation::Failure;
use continuation::arclength::Settings;
use continuation::branch::{follow, orbit_at};
use continuation::orbit::{Guess, Shooting};
use continuation::start::{Search, near_returns};
use continuation::vehicle::Vehicle;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::vehicle::YAW_RATE;

/// Transient before the search for the orbit, its length and tolerances, s.
const SEARCHED_AFTER_S: f64 = 60.0;
const SEARCHED_S: f64 = 100.0;
const SEARCH_TOLERANCE: f64 = 1e-9;
const ORBIT_TOLERANCE: f64 = 1e-11;
/// Parameters of the orbits: the speed, and one that is not varied.
const KEYS: [&str; 2] = [Parameter::Speed.key(), "vehicle.mass_kg"];
/// Its longest step, as a share of the range: near a homoclinic orbit Newton's method needs a close guess.
const LONGEST_STEP: f64 = 0.004;
/// Slower speeds that are tried, and how far apart, rpm.
const SLOWER: u32 = 8;
const SLOWER_RPM: f64 = 50.0;

/// The orbit of one cycle that the scenario's trajectory returns to.
fn near_trajectory(scenario: &Scenario<f64>) -> Option<VehicleOrbit> {
    let vehicle = Vehicle::new(scenario, KEYS).ok()?;
    let run = &scenario.run;
    let search = Search {
        start: Vector4::new(
            run.sideslip_rad,
            run.yaw_rate_rad_per_s,
            run.steering_angle_rad,
            run.steering_rate_rad_per_s,
        ),
        transient_s: SEARCHED_AFTER_S,
        observed_s: SEARCHED_S,
        component: YAW_RATE,
        most_cycles: 1,
        tolerance: SEARCH_TOLERANCE,
    };
    let found = near_returns(&vehicle, vehicle.parameters(), &search).ok()?;
    orbit_near(&vehicle, &found.first()?.guess)
}

fn orbit_near(vehicle: &Vehicle, guess: &Guess<4>) -> Option<VehicleOrbit> {
    let problem = Shooting::<_, 4, 6>::new(vehicle, guess, &[1.0], 1, ORBIT_TOLERANCE).ok()?;
    let unknowns = problem.guess(&guess.start, guess.period_s, guess.parameters);
    orbit_at(&problem, unknowns.ok()?).ok()
}

/// The orbit of one cycle at the scenario's speed: near its trajectory, or else along the branch from slower speeds.
pub(super) fn orbit_of(scenario: &Scenario<f64>) -> Option<VehicleOrbit> {
    near_trajectory(scenario).or_else(|| {
        let rpm = scenario.run.wheel_speed_rpm;
        let slower = (1..=SLOWER).map(|k| rpm - f64::from(k) * SLOWER_RPM);
        let slower = slower.filter(|rpm| *rpm > 0.0);
        let scenarios: Vec<Scenario<f64>> = slower
            .map(|rpm| Parameter::Speed.set(scenario, rpm))
            .collect();
        let slowest = scenarios.last()?.run.wheel_speed_rpm;
        orbit_on(
            &branch_over_speed(&scenarios, (slowest, rpm + 1.0)),
            scenario,
        )
    })
}

/// The orbits of one cycle over the speed: the branch through the first that a trajectory returns to.
pub(super) fn branch_over_speed(
    scenarios: &[Scenario<f64>],
    range: (f64, f64),
) -> Vec<VehicleOrbit> {
    let first = scenarios.iter().find_map(|scenario| {
        let orbit = near_trajectory(scenario)?;
        Some((Vehicle::new(scenario, KEYS).ok()?, orbit))
    });
    let Some((vehicle, orbit)) = first else {
        return Vec::new();
    };
    let mut settings = Settings::over(&[range]);
    settings.longest_step = LONGEST_STEP;
    let both_ways = || -> Result<Vec<VehicleOrbit>, Failure> {
        let spans = settings.spans();
        let problem =
            Shooting::<_, 4, 6>::new(&vehicle, &orbit.guess(), &spans, 1, ORBIT_TOLERANCE)?;
        let guess = problem.guess(orbit.start(), orbit.period_s, orbit.parameters)?;
        let mut orbits = Vec::new();
        for sign in [-1.0, 1.0] {
            let axis = problem.parameter_axis(sign);
            orbits.extend(follow(&problem, guess.clone(), &axis, &settings, |_| true)?.orbits);
        }
        Ok(orbits)
    };
    both_ways().unwrap_or_default()
}

/// The orbit at a scenario's speed, from the nearest of a branch.
pub(super) fn orbit_on(branch: &[VehicleOrbit], scenario: &Scenario<f64>) -> Option<VehicleOrbit> {
    let vehicle = Vehicle::new(scenario, KEYS).ok()?;
    let [rpm, _] = vehicle.parameters();
    let apart = |orbit: &VehicleOrbit| (orbit.parameters[0] - rpm).abs();
    let nearest = branch.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    let guess = Guess {
        parameters: vehicle.parameters(),
        ..nearest.guess()
    };
    orbit_near(&vehicle, &guess)
}
