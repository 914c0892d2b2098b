//! Branches of the vehicle: smooth and with stick-slip.

use continuation::Bifurcation;
use continuation::arclength::{End, Settings};
use continuation::branch::{Branch, follow};
use continuation::orbit::Shooting;
use continuation::start::{Search, near_returns};
use continuation::vehicle::{InvalidParameter, Vehicle};
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::YAW_RATE;

const SPEED: &str = "run.wheel_speed_rpm";
const TOLERANCE: f64 = 1e-12;

type Found = Branch<FrictionMode, 4>;

fn branch(scenario: &Scenario<f64>, key: &str, range: (f64, f64), tolerance: f64) -> Found {
    let vehicle = Vehicle::new(scenario, [key, "vehicle.mass_kg"]).unwrap();
    let parameters = vehicle.parameters();
    let search = Search {
        start: Vector4::new(0.15, 0.0, 0.46, 0.0),
        transient_s: 100.0,
        observed_s: 30.0,
        component: YAW_RATE,
        most_cycles: 1,
        tolerance: 1e-9,
    };
    let guess = near_returns(&vehicle, parameters, &search).unwrap()[0].guess;
    let settings = Settings::over(&[range]);
    let spans = settings.spans();
    let problem = Shooting::<_, 4, 6>::new(&vehicle, &guess, &spans, 1, tolerance).unwrap();
    let unknowns = problem
        .guess(&guess.start, guess.period_s, parameters)
        .unwrap();
    let axis = problem.parameter_axis(1.0);
    follow(&problem, unknowns, &axis, &settings, |_| true).unwrap()
}

fn at(rpm: f64, coefficient: f64) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    scenario.friction.coefficient = coefficient;
    scenario.run.wheel_speed_rpm = rpm;
    scenario
}

fn doubling(branch: &Found) -> (f64, f64) {
    let mut all = branch
        .specials
        .iter()
        .filter(|s| s.kind == Bifurcation::PeriodDoubling);
    let special = all.next().unwrap_or_else(|| panic!("none: {}", branch.end));
    (special.orbit.parameters[0], special.parameter_error)
}

/// By `doublings.py` beside this file, which has the vehicle without friction too.
#[test]
fn the_doubling_without_friction_is_that_of_another_program() {
    let (rpm, error) = doubling(&branch(
        &at(1700.0, 0.0),
        SPEED,
        (1700.0, 1760.0),
        TOLERANCE,
    ));
    assert!((rpm - 1730.293623033).abs() < 5e-7, "{rpm:.9}");
    assert!(error < 1e-9 * rpm, "{error:e}");
}

/// With stick-slip, by itself at other tolerances: there are two changes of the friction's mode in it.
#[test]
fn the_doubling_with_stick_slip_converges_with_the_tolerance() {
    let of = |tolerance| {
        doubling(&branch(
            &at(1620.0, 0.28),
            SPEED,
            (1620.0, 1660.0),
            tolerance,
        ))
        .0
    };
    let (coarse, fine, finest) = (of(1e-8), of(1e-11), of(1e-13));
    assert!((fine - finest).abs() < 1e-6, "{fine:.9} {finest:.9}");
    assert!((coarse - finest).abs() < 1e-3, "{coarse:.9} {finest:.9}");
    assert!((finest - 1639.188836).abs() < 1e-5, "{finest:.9}");
}

/// The multipliers are the derivative of what the trajectory does.
#[test]
fn the_trivial_multiplier_is_one_through_stick_and_slip() {
    for coefficient in [0.0, 0.1, 0.28] {
        let found = branch(&at(1600.0, coefficient), SPEED, (1600.0, 1640.0), TOLERANCE);
        assert_eq!(found.end, End::Range);
        for orbit in &found.orbits {
            assert!(
                orbit.trivial_error < 1e-5,
                "{coefficient}: {:e}",
                orbit.trivial_error
            );
            let modes = orbit.modes().len();
            assert!(if coefficient > 0.0 {
                modes >= 2
            } else {
                modes == 1
            });
        }
    }
}

/// Any number of the configuration, and the dither.
#[test]
fn other_parameters_have_branches() {
    let friction = branch(
        &at(1600.0, 0.28),
        "friction.coefficient",
        (0.2, 0.4),
        TOLERANCE,
    );
    assert_eq!(friction.end, End::Range);
    let mut scenario = at(1750.0, 0.28);
    scenario.dither.waveform = Waveform::Square;
    scenario.dither.amplitude_v = 0.06;
    let amplitude = branch(&scenario, "dither.amplitude_v", (0.05, 0.12), TOLERANCE);
    assert_eq!(amplitude.end, End::Range);
    assert!(amplitude.orbits.iter().all(|orbit| orbit.is_stable()));
}

#[test]
fn an_unknown_number_or_an_invalid_scenario_is_refused() {
    let refused = Vehicle::new(&at(1600.0, 0.28), ["run.speed", "vehicle.mass_kg"]);
    assert!(matches!(refused, Err(InvalidParameter::Unknown { key }) if key == "run.speed"));
    let refused = Vehicle::new(&at(-1.0, 0.28), [SPEED, "vehicle.mass_kg"]);
    assert!(matches!(refused, Err(InvalidParameter::Scenario(_))));
}
