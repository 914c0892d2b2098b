//! Bifurcations by continuation, beside what trajectories and equilibria show.

use dynamics::attractor::attractor;
use dynamics::bifurcations::{Bifurcations, BifurcationsError, Curve, Plan, bifurcations};
use dynamics::component::Component;
use dynamics::poincare::crossings;
use dynamics::section::{Direction, Section};
use dynamics::simulate::started_at;
use dynamics::sweep::{RunControl, Timing, Values};
use dynamics::{equilibria, sweep::mirrored};
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::ecu_schedule::Table;
use shared_model::vehicle::Model;

fn plan(coefficient: f64, rpm: f64, range: (f64, f64)) -> Plan {
    let mut scenario = Scenario::reconstruction();
    scenario.friction.coefficient = coefficient;
    scenario.run.wheel_speed_rpm = rpm;
    Plan {
        scenario,
        parameter: "run.wheel_speed_rpm".into(),
        range,
        second: None,
        cycles: None,
        transient_s: 100.0,
        doublings: 0,
        tolerance: 1e-12,
    }
}

fn only_doubling(found: &Bifurcations) -> f64 {
    let [special] = &found.specials[..] else {
        panic!("{:?}", found.specials);
    };
    assert_eq!(special.kind, "period doubling");
    special.parameter
}

/// Growth per period of a perturbation, by the engine's trajectory: distances of crossings from the next
/// but one but one, which alternate in sign.
fn growth(scenario: &Scenario<f64>, state: [f64; 4], period_s: f64) -> f64 {
    const PERIODS: usize = 300;
    let model = Model::new(scenario);
    let mut start = model.state(Vector4::from(state));
    start.x[0] += 1e-5;
    let mut scenario = started_at(scenario, &start);
    scenario.run.duration_s = period_s * (PERIODS + 3) as f64;
    let section = Section {
        component: Component::YAW_RATE,
        value: 0.0,
        direction: Direction::Rising,
    };
    let all = crossings(&scenario, 5.0 * period_s, &section).unwrap();
    let apart = |k: usize| (all[k + 1].x - all[k].x).norm();
    let last = all.len() - 2;
    (apart(last) / apart(0)).powf(1.0 / last as f64)
}

/// A tenth of a revolution per minute below the doubling a perturbation decays, as far above it grows, at
/// the rate of the multiplier.
#[test]
fn trajectories_on_both_sides_of_a_doubling_grow_as_the_multiplier() {
    for (coefficient, rpm) in [(0.0, 1700.0), (0.28, 1620.0)] {
        let found = bifurcations(&plan(coefficient, rpm, (rpm, rpm + 60.0))).unwrap();
        let doubling = only_doubling(&found);
        for side in [-0.1, 0.1] {
            let at = bifurcations(&plan(
                coefficient,
                doubling - 10.0,
                (doubling - 20.0, doubling + side),
            ));
            let at = at.unwrap();
            let orbit = at.orbits[0].points.last().unwrap();
            assert!((orbit.parameter - doubling - side).abs() < 1e-9);
            let mut scenario = plan(coefficient, orbit.parameter, (0.0, 0.0)).scenario;
            scenario.run.duration_s = 1.0;
            let multiplier = orbit.multipliers[0];
            let measured = growth(&scenario, orbit.state, orbit.period_s);
            let wanted = multiplier.re.hypot(multiplier.im);
            assert!((wanted > 1.0) == (side > 0.0), "{wanted}");
            assert!(
                (measured - wanted).abs() < 2e-5,
                "{coefficient} {side}: {measured} {wanted}"
            );
        }
    }
}

/// The same bifurcation by the eigenvalues of a sweep.
#[test]
fn the_hopf_bifurcation_is_that_of_a_sweep() {
    let plan = plan(0.28, 1600.0, (1600.0, 1700.0));
    let found = bifurcations(&plan).unwrap();
    let [hopf] = &found.hopf[..] else {
        panic!("{:?}", found.hopf)
    };
    let speeds = Values::new("wheel speed (rpm)", 1600.0, 1700.0, 50.0).unwrap();
    let over = equilibria::over_speed(&plan.scenario, &speeds, RunControl::none()).unwrap();
    let swept = equilibria::hopf(&plan.scenario, &over).unwrap();
    let [swept] = &swept[..] else {
        panic!("{swept:?}")
    };
    let range = swept.lower_rpm - 1e-6..=swept.upper_rpm + 1e-6;
    assert!(
        range.contains(&hopf.parameter),
        "{} {range:?}",
        hopf.parameter
    );
    assert!((hopf.frequency_rad_per_s - swept.frequency_rad_per_s).abs() < 1e-4);
    // Subcritical: the orbit that is born below it is unstable.
    assert!(hopf.first_lyapunov_coefficient > 0.0);
}

/// Without friction the branch that is born there exists below, and is unstable.
#[test]
fn the_orbit_of_the_hopf_bifurcation_is_below_it() {
    let found = bifurcations(&plan(0.0, 1640.0, (1640.0, 1660.0))).unwrap();
    let hopf = &found.hopf[0];
    let born = found
        .orbits
        .iter()
        .find(|branch| branch.origin.contains("Hopf"))
        .unwrap();
    assert!(
        born.points
            .iter()
            .all(|orbit| !orbit.stable && orbit.parameter < hopf.parameter)
    );
    let first = &born.points[0];
    let period_s = std::f64::consts::TAU / hopf.frequency_rad_per_s;
    assert!((first.period_s / period_s - 1.0).abs() < 1e-3);
}

/// The curve of the doubling in speed and amplitude passes through the doubling over the speed alone.
#[test]
fn the_curve_of_a_doubling_meets_the_branches_at_its_points() {
    let mut plan = plan(0.28, 1620.0, (1600.0, 1900.0));
    plan.scenario.dither.waveform = Waveform::Square;
    plan.second = Some(("dither.amplitude_v".into(), (0.0, 0.1)));
    let found = bifurcations(&plan).unwrap();
    let curve = found
        .curves
        .iter()
        .find(|curve| curve.kind == "period doubling")
        .unwrap();
    assert!(curve.points.len() > 5);
    let point = curve.points[curve.points.len() / 2];
    plan.second = None;
    plan.scenario.dither.amplitude_v = point.parameters[1];
    plan.scenario.run.wheel_speed_rpm = point.parameters[0] - 20.0;
    plan.range = (point.parameters[0] - 30.0, point.parameters[0] + 30.0);
    let doubling = only_doubling(&bifurcations(&plan).unwrap());
    assert!(
        (doubling - point.parameters[0]).abs() < 1e-4,
        "{doubling} {point:?}"
    );
}

/// Long simulations on both sides of the curve of a doubling in speed and amplitude, each from the end of the one
/// before: the settled orbit has one cycle down to a millivolt above the curve, and none has a millivolt below.
/// From other initial states there is chaos above it too, since the doubling is subcritical.
#[test]
fn the_curve_of_a_doubling_is_the_edge_of_the_simulated_orbits() {
    let mut plan = plan(0.28, 1750.0, (0.0, 0.1));
    plan.scenario.dither.waveform = Waveform::Square;
    plan.scenario.dither.amplitude_v = 0.05;
    plan.parameter = "dither.amplitude_v".into();
    plan.second = Some(("run.wheel_speed_rpm".into(), (1680.0, 1900.0)));
    let found = bifurcations(&plan).unwrap();
    let is_doubling = |curve: &&Curve| curve.kind == "period doubling";
    let curve = found.curves.iter().find(is_doubling).unwrap();
    assert!(curve.points.len() > 10 && curve.codimension_two.is_empty());
    for point in curve.points.iter().step_by(4) {
        let [amplitude_v, rpm] = point.parameters;
        let mut scenario = plan.scenario;
        scenario.run.wheel_speed_rpm = rpm;
        for beside_mv in [30.0, 10.0, 3.0, 1.0, -1.0] {
            scenario.dither.amplitude_v = amplitude_v + 1e-3 * beside_mv;
            let timing = Timing::new(500.0, 700.0).unwrap();
            let found = attractor(&scenario, timing, false).unwrap();
            let is_one_cycle = found.cycles == Some(1);
            assert_eq!(is_one_cycle, beside_mv > 0.0, "{point:?} {beside_mv} mV");
            let end = Model::new(&scenario).state(found.end.into());
            scenario = started_at(&scenario, &end);
        }
    }
}

/// The equations are odd: with the motor's torque and the initial state of the other sign there is the same
/// branch.
#[test]
fn the_mirrored_vehicle_has_the_same_branch() {
    let given = plan(0.28, 1600.0, (1590.0, 1610.0));
    let mut other = given.clone();
    other.scenario = mirrored(&given.scenario);
    other.scenario.steering.motor_current_a *= -1.0;
    let [given, other] = [given, other].map(|plan| bifurcations(&plan).unwrap());
    let first = |found: &Bifurcations| {
        let point = &found.orbits[0].points[0];
        (
            point.period_s,
            point.multipliers[0].re,
            point.yaw_rate_max_rad_per_s,
        )
    };
    let least = |found: &Bifurcations| found.orbits[0].points[0].yaw_rate_min_rad_per_s;
    let (a, b) = (first(&given), first(&other));
    assert!(
        (a.0 - b.0).abs() < 1e-8 && (a.1 - b.1).abs() < 1e-6,
        "{a:?} {b:?}"
    );
    assert!((a.2 + least(&other)).abs() < 1e-3, "{a:?} {b:?}");
}

#[test]
fn a_plan_that_is_none_is_refused_with_its_bounds() {
    let good = plan(0.28, 1600.0, (1500.0, 1700.0));
    let refused = |change: &dyn Fn(&mut Plan)| {
        let mut plan = good.clone();
        change(&mut plan);
        bifurcations(&plan)
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default()
    };
    assert!(refused(&|plan| plan.range = (1700.0, 1500.0)).contains("ascending range"));
    assert!(refused(&|plan| plan.range = (1600.0, 1600.0)).contains("ascending range"));
    assert!(refused(&|plan| plan.range = (0.0, 1700.0)).contains("within 1 to 100000"));
    assert!(refused(&|plan| plan.range = (f64::NAN, 1700.0)).contains("ascending range"));
    assert!(refused(&|plan| plan.range = (1650.0, 1700.0)).contains("1600: must be in the range"));
    assert!(
        refused(&|plan| plan.parameter = "run.speed".into()).contains("no number of that name")
    );
    assert!(refused(&|plan| plan.tolerance = 1e-17).contains("rounding"));
    assert!(refused(&|plan| plan.tolerance = f64::NAN).contains("from 1e-14"));
    let same = Some(("run.wheel_speed_rpm".into(), (1500.0, 1700.0)));
    let mut twice = good.clone();
    twice.second = same;
    assert!(matches!(
        bifurcations(&twice),
        Err(BifurcationsError::SameParameter { .. })
    ));
}

/// At rest there is no orbit, and the reason is kept.
#[test]
fn a_trajectory_that_comes_to_rest_has_no_branch() {
    let mut plan = plan(0.28, 400.0, (300.0, 500.0));
    plan.transient_s = 300.0;
    let found = bifurcations(&plan).unwrap();
    assert!(found.orbits.is_empty() && !found.equilibria.is_empty());
    assert!(
        found.without_branch[0].contains("equilibrium"),
        "{:?}",
        found.without_branch
    );
}

/// The greatest multiplier of the orbits of both initial states at the amplitude that the ECU's table has for
/// a speed: 0.8 would be a perturbation that is halved in three cycles.
#[test]
fn the_ecus_amplitudes_keep_a_margin_from_every_bifurcation() {
    let mut greatest: f64 = 0.0;
    for waveform in [Waveform::Square, Waveform::Sine] {
        let table = Table::<f64>::of(waveform);
        for k in 0..8 {
            let rpm = 1550.0 + 50.0 * f64::from(k);
            let mut scenario = Scenario::reconstruction();
            scenario.run.wheel_speed_rpm = rpm;
            scenario.dither.waveform = waveform;
            scenario.dither.amplitude_v = table.amplitude_v(rpm);
            for start in [scenario, mirrored(&scenario)] {
                let mut plan = plan(0.28, rpm, (rpm - 0.5, rpm + 0.5));
                plan.scenario = start;
                plan.transient_s = 300.0;
                let found = bifurcations(&plan).unwrap();
                let Some(branch) = found.orbits.first() else {
                    continue; // at rest
                };
                assert!(
                    found.specials.is_empty(),
                    "{waveform:?} {rpm}: {:?}",
                    found.specials
                );
                for orbit in &branch.points {
                    let multiplier = orbit.multipliers[0];
                    greatest = greatest.max(multiplier.re.hypot(multiplier.im));
                }
            }
        }
    }
    assert!((0.1..0.8).contains(&greatest), "{greatest}");
}

mod edges {
    use dynamics::attractor::Kind;
    use dynamics::regions::{Regions, regions};
    use dynamics::sweep::{Parameter, RunControl, Timing, Values, mirrored};
    use shared_model::Scenario;
    use shared_model::dither::Waveform;

    fn over(
        scenario: &Scenario<f64>,
        parameter: Parameter,
        from: f64,
        to: f64,
        step: f64,
    ) -> Regions {
        let values = Values::new("values", from, to, step).unwrap();
        let timing = Timing::new(200.0, 600.0).unwrap();
        let width = parameter.edge_width();
        regions(
            scenario,
            parameter,
            &values,
            width,
            timing,
            RunControl::none(),
        )
        .unwrap()
    }

    /// Just below a doubling maxima alternate for longer than any run; the regions end where a multiplier
    /// is -1.
    #[test]
    fn an_edge_at_a_period_doubling_is_no_transient() {
        for (coefficient, from, wanted) in [(0.28, 1630.0, 1639.188836), (0.0, 1720.0, 1730.293623)]
        {
            let mut scenario = Scenario::reconstruction();
            scenario.friction.coefficient = coefficient;
            let found = over(&scenario, Parameter::Speed, from, from + 15.0, 2.5);
            let edge = found.edges[0];
            assert_eq!(edge.below, Kind::Periodic(2), "{:?}", found.edges);
            let at = edge.bifurcation.unwrap();
            assert_eq!(at.kind, "period doubling");
            assert!((at.value - wanted).abs() < 1e-5, "{at:?}");
            assert!((found.regions[0].to - wanted).abs() < 1e-5);
            assert!(
                found
                    .edges
                    .iter()
                    .all(|edge| edge.above != Kind::Periodic(4))
            );
        }
    }

    /// A slow spiral below the Hopf bifurcation comes to rest, above it it does not.
    #[test]
    fn a_slow_spiral_is_an_equilibrium() {
        let mut scenario = Scenario::reconstruction();
        scenario.friction.coefficient = 0.0;
        let found = over(&mirrored(&scenario), Parameter::Speed, 1646.0, 1653.0, 1.0);
        let [edge] = &found.edges[..] else {
            panic!("{:?}", found.edges);
        };
        assert_eq!(edge.below, Kind::Equilibrium);
        assert!(edge.lower < 1650.8174 && edge.upper > 1650.5, "{edge:?}");
    }

    /// The cycle gains a maximum of the yaw rate: an inflection of the same orbit.
    #[test]
    fn an_edge_between_counts_of_maxima_is_no_bifurcation() {
        let mut scenario = Scenario::reconstruction();
        scenario.dither.waveform = Waveform::Sine;
        let found = over(&scenario, Parameter::Amplitude, 0.72, 0.76, 0.02);
        let [edge] = &found.edges[..] else {
            panic!("{:?}", found.edges);
        };
        assert!(edge.is_inflection && edge.bifurcation.is_none(), "{edge:?}");
        let cycles = found.samples.iter().map(|sample| sample.attractor.cycles);
        assert!(cycles.into_iter().all(|cycles| cycles == Some(1)));
    }
}
