//! Orbits of one cycle: near a trajectory, and along a branch over the wheel speed.

use crate::settled::{VehicleOrbit, branch_from, orbit_near};
use crate::sweep::Parameter;
use continuation::arclength::Settings;
use continuation::orbit::Guess;
use continuation::start::{Search, near_returns};
use continuation::vehicle::Vehicle;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::vehicle::YAW_RATE;

/// Transient before the search for the orbit, its length and tolerances, s.
const SEARCHED_AFTER_S: f64 = 60.0;
const SEARCHED_S: f64 = 100.0;
const SEARCH_TOLERANCE: f64 = 1e-9;
const TOLERANCE: f64 = 1e-11;
/// Parameters of the orbits: the speed, and one that is not varied.
const KEYS: [&str; 2] = [Parameter::Speed.key(), "vehicle.mass_kg"];
/// Its longest step, as a share of the range: near a homoclinic orbit Newton's method needs a close guess.
const LONGEST_STEP: f64 = 0.004;
/// How far it is followed beyond the speeds, rpm.
const BEYOND_RPM: f64 = 1.0;
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

/// The orbit of one cycle at the scenario's speed: near its trajectory, or else along the branch from slower speeds.
pub(super) fn orbit_of(scenario: &Scenario<f64>) -> Option<VehicleOrbit> {
    let along_branch = || orbit_on(&branch_over_speed(&[*scenario]), scenario);
    near_trajectory(scenario).or_else(along_branch)
}

/// The orbits of one cycle over the scenarios' speeds, ascending: the branch through the first that a trajectory
/// returns to, at these speeds or at slower ones.
pub(super) fn branch_over_speed(scenarios: &[Scenario<f64>]) -> Vec<VehicleOrbit> {
    let (Some(slowest), Some(fastest)) = (scenarios.first(), scenarios.last()) else {
        return Vec::new();
    };
    let [first_rpm, last_rpm] = [slowest, fastest].map(|one| one.run.wheel_speed_rpm);
    let slower = (1..=SLOWER).map(|k| first_rpm - f64::from(k) * SLOWER_RPM);
    let slower = slower
        .filter(|rpm| *rpm > BEYOND_RPM)
        .map(|rpm| Parameter::Speed.set(slowest, rpm));
    let found = scenarios
        .iter()
        .copied()
        .chain(slower)
        .find_map(|scenario| {
            let orbit = near_trajectory(&scenario)?;
            Some((Vehicle::new(&scenario, KEYS).ok()?, orbit))
        });
    let Some((vehicle, orbit)) = found else {
        return Vec::new();
    };
    let [rpm, _] = orbit.parameters;
    let range = (first_rpm.min(rpm) - BEYOND_RPM, last_rpm + BEYOND_RPM);
    let mut settings = Settings::over(&[range]);
    settings.longest_step = LONGEST_STEP;
    let one_way = |sign| branch_from(&vehicle, &orbit, sign, &settings, TOLERANCE, |_| true);
    let both_ways = [-1.0, 1.0].into_iter().filter_map(one_way);
    both_ways.flat_map(|branch| branch.orbits).collect()
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
