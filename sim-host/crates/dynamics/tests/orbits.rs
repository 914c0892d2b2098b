//! Regions, orbit diagrams and basins of the paper's vehicle against the paper and against each
//! other.

use dynamics::attractor::{Kind, attractor};
use dynamics::basin::{Cell, basin};
use dynamics::component::Component;
use dynamics::equilibria;
use dynamics::extrema::Extrema;
use dynamics::orbit::{Outcome, Point, Section, Start, diagram};
use dynamics::period::yaw_rate_maxima;
use dynamics::regions::{Regions, coexisting, regions};
use dynamics::simulate::simulate;
use dynamics::sweep::{Parameter, RunControl, SweepError, Timing, Values, mirrored};
use engine::reference::Reference;
use shared_model::Scenario;
use shared_model::dither::Waveform;
use shared_model::tire::HIGH_FRICTION_ROAD;
use std::sync::atomic::AtomicBool;

static GO_ON: AtomicBool = AtomicBool::new(false);
const WATCH: RunControl = RunControl {
    stop: &GO_ON,
    done: &|| {},
};

fn at(rpm: f64) -> Scenario<f64> {
    Parameter::Speed.set(&Scenario::reconstruction(), rpm)
}

fn values(from: f64, to: f64, step: f64) -> Values {
    Values::new("test", from, to, step).expect("the range is valid")
}

fn timing(transient_s: f64, time_s: f64) -> Timing {
    Timing::new(transient_s, time_s).expect("the times are valid")
}

fn over_speed(from: f64, to: f64, step: f64) -> Regions {
    regions(
        &Scenario::reconstruction(),
        Parameter::Speed,
        &values(from, to, step),
        0.5,
        timing(200.0, 600.0),
        WATCH,
    )
    .expect("the sweep is valid")
}

#[test]
fn the_papers_four_speeds() {
    for (rpm, kind) in [
        (1600.0, Kind::Periodic(2)),
        (1750.0, Kind::Chaos),
        (1845.0, Kind::Periodic(3)),
        (1880.0, Kind::Chaos),
    ] {
        let found = attractor(&at(rpm), timing(200.0, 600.0), true).expect("valid");
        assert_eq!(found.kind, kind, "{rpm} rpm: {found:?}");
        assert_eq!(found.lobe(), "positive", "{rpm} rpm");
    }
}

/// Chaos begins within 7 rpm of the paper's 1645. At its 1825 the chaos splits into three bands,
/// out of which period 3 comes, and that ends at its 1855.
#[test]
fn edges_are_near_the_papers() {
    let sweep = over_speed(1620.0, 1890.0, 15.0);
    assert!(sweep.complete);
    for edge in &sweep.edges {
        assert!(edge.upper - edge.lower <= 0.5, "{edge:?}");
    }
    let first_above = |rpm: f64, is: fn(Kind) -> bool| {
        let mut edges = sweep.edges.iter().filter(|e| e.lower >= rpm);
        edges
            .find(|e| is(e.above))
            .unwrap_or_else(|| panic!("{:?}", sweep.edges))
            .middle()
    };
    let chaos = first_above(1600.0, Kind::is_chaotic);
    let bands = first_above(1800.0, |kind| kind == Kind::BandedChaos(3));
    let again = first_above(1846.0, Kind::is_chaotic);
    for (found, paper) in [(chaos, 1645.0), (bands, 1825.0), (again, 1855.0)] {
        assert!((found - paper).abs() <= 7.0, "{found} rpm, paper {paper}");
    }
}

/// The sine's period one ends a fiftieth short of the paper's 1.2 V: from there on the motion comes
/// to rest.
#[test]
fn dither_makes_period_one_where_the_paper_has_it() {
    let kind = |waveform, amplitude_v| {
        let mut scenario = Parameter::Amplitude.set(&at(1750.0), amplitude_v);
        scenario.dither.waveform = waveform;
        let found = attractor(&scenario, timing(200.0, 600.0), true);
        found.expect("valid").kind
    };
    assert_eq!(kind(Waveform::Square, 0.1), Kind::Periodic(1));
    for amplitude_v in [0.8, 0.9, 1.0, 1.1, 1.17] {
        let found = kind(Waveform::Sine, amplitude_v);
        assert_eq!(found, Kind::Periodic(1), "{amplitude_v} V");
    }
    assert_eq!(kind(Waveform::Sine, 1.2), Kind::Equilibrium);
}

#[test]
fn the_other_lobe_has_an_equilibrium_of_its_own() {
    let range = values(1600.0, 1640.0, 20.0);
    let (given, timing) = (at(1600.0), timing(200.0, 600.0));
    let sweep = |scenario| {
        regions(&scenario, Parameter::Speed, &range, 0.5, timing, WATCH)
            .expect("the sweep is valid")
    };
    let (one, other) = (sweep(given), sweep(mirrored(&given)));
    for sample in &other.samples {
        assert_eq!(sample.attractor.kind, Kind::Equilibrium);
        assert_eq!(sample.attractor.lobe(), "negative");
    }
    let both = coexisting(&given, Parameter::Speed, &one, &other).expect("valid");
    assert_eq!(both, [1600.0, 1620.0, 1640.0]);
    assert!(
        coexisting(&given, Parameter::Speed, &one, &one)
            .expect("valid")
            .is_empty()
    );
}

fn orbit(scenario: &Scenario<f64>, range: &Values, section: Section, start: Start) -> Vec<Point> {
    let timing = timing(100.0, 200.0);
    diagram(
        scenario,
        Parameter::Speed,
        range,
        section,
        timing,
        start,
        WATCH,
    )
    .expect("the diagram is valid")
}

fn heights(point: &Point) -> &[f64] {
    match &point.orbit {
        Outcome::Meets { values } => values,
        other => panic!("{} rpm: {other:?}", point.value),
    }
}

/// Where there is one attractor on the lobe, every start shows it.
#[test]
fn continuation_upwards_and_downwards_agree_on_a_period() {
    let range = values(1580.0, 1620.0, 10.0);
    let all = [Start::Fixed, Start::Up, Start::Down]
        .map(|start| orbit(&at(1600.0), &range, Section::YawRateMaxima, start));
    for (k, fixed) in all[0].iter().enumerate() {
        for other in &all[1..] {
            assert_eq!(fixed.value, other[k].value);
            let extent = |p| {
                let bound = |pick: fn(f64, f64) -> f64| heights(p).iter().copied().reduce(pick);
                (
                    bound(f64::min).expect("some"),
                    bound(f64::max).expect("some"),
                )
            };
            let (a, b) = (extent(fixed), extent(&other[k]));
            assert!(
                (a.0 - b.0).abs() < 1e-3 && (a.1 - b.1).abs() < 1e-3,
                "{a:?} {b:?}"
            );
        }
    }
}

/// A section in the steering rate: a period-2 orbit, which steers once to and fro for each maximum,
/// meets it in few points; one far out is never crossed, and the message says where the motion
/// stays.
#[test]
fn sections_are_crossed_or_said_not_to_be() {
    let range = values(1600.0, 1600.0, 1.0);
    let section = |level| Section::Rising {
        component: Component::STEERING_ANGLE,
        level,
    };
    let points = orbit(&at(1600.0), &range, section(0.3), Start::Fixed);
    let mut met = heights(&points[0]).to_vec();
    met.sort_by(f64::total_cmp);
    met.dedup_by(|a, b| (*a - *b).abs() < 1e-3);
    assert!((1..=4).contains(&met.len()), "{met:?}");
    let refused = diagram(
        &at(1600.0),
        Parameter::Speed,
        &range,
        section(2.0),
        timing(100.0, 200.0),
        Start::Fixed,
        WATCH,
    );
    let Err(SweepError::SectionNotCrossed { low, high, .. }) = refused else {
        panic!("{refused:?}");
    };
    assert!(low < high && high < 2.0, "{low} to {high}");
}

/// Maxima found while the motion runs are those of the recorded motion.
#[test]
fn streaming_finds_the_recorded_maxima() {
    for rpm in [1600.0, 1750.0] {
        let mut scenario = at(rpm);
        scenario.run.duration_s = 100.0;
        let trace = simulate(&scenario).expect("valid");
        let mut extrema = Extrema::default();
        for (k, gamma) in trace.component(1).enumerate() {
            extrema.push(trace.time_s(k), trace.step_s, gamma);
        }
        let (found, recorded) = (extrema.maxima(), yaw_rate_maxima(&trace, 0));
        assert!(recorded.len() > 50);
        assert_eq!(found.len(), recorded.len());
        for (a, b) in found.iter().zip(&recorded) {
            let apart = (a.0 - b.0).abs().max((a.1 - b.1).abs());
            assert!(apart < 1e-9, "{a:?} {b:?}");
        }
    }
}

#[test]
fn starts_end_on_the_attractors_of_both_lobes_or_diverge() {
    let scenario = at(1600.0);
    let (betas, deltas) = (values(-0.15, 0.15, 0.15), values(-0.46, 0.46, 0.46));
    let found = basin(&scenario, &betas, &deltas, timing(200.0, 400.0), WATCH).expect("valid");
    assert_eq!(found.cells.len(), 9);
    let of = |beta: f64, delta: f64| {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let cell = found
            .cells
            .iter()
            .find(|c| near(c.sideslip_rad, beta) && near(c.steering_angle_rad, delta));
        &found.attractors[cell.expect("the start is on the grid").attractor]
    };
    assert_eq!(of(0.15, 0.46).kind, Kind::Periodic(2));
    let rest = of(-0.15, -0.46);
    assert_eq!(rest.kind, Kind::Equilibrium);
    // It rests in the stick band of one of the equilibria.
    let equilibria = equilibria::find(&scenario).expect("valid");
    let holding = equilibria.iter().filter(|e| e.holds(&rest.end)).count();
    assert_eq!(holding, 1, "{rest:?}");
    // Where nothing bounds the tyres' force.
    let mut unbounded = scenario;
    (unbounded.tires.front, unbounded.tires.rear) = HIGH_FRICTION_ROAD;
    let away = basin(&unbounded, &betas, &deltas, timing(200.0, 400.0), WATCH).expect("valid");
    let start = |c: &&Cell| c.sideslip_rad > 0.1 && c.steering_angle_rad > 0.4;
    let cell = away.cells.iter().find(start).expect("it is on the grid");
    assert_eq!(away.attractors[cell.attractor].kind, Kind::Diverges);
}

/// At 16 rad of slip the cubic tyre is so stiff that a step of 1 ms overshoots and diverges. The
/// motion itself comes back.
#[test]
fn a_stiff_start_comes_back_from_far_out() {
    let mut far = at(1600.0);
    (far.run.sideslip_rad, far.run.steering_angle_rad) = (8.0, -8.0);
    let mut reference = Reference::new(&far, 1e-10).expect("valid");
    let back = reference.run(2.0).expect("it stays bounded").x;
    assert!(back.amax() < 10.0, "{back}");
    let found = attractor(&far, timing(200.0, 400.0), false).expect("valid");
    assert_eq!(found.kind, Kind::Periodic(2));
}

/// Friction holds a vehicle that has come to rest: upwards the cycle lasts beyond 1.14 V, downwards
/// rest does.
#[test]
fn hysteresis_shows_where_two_attractors_coexist() {
    let mut scenario = at(1750.0);
    scenario.dither.waveform = Waveform::Sine;
    let range = values(1.14, 1.2, 0.02);
    let at_least_amplitude = |start| {
        let points = diagram(
            &scenario,
            Parameter::Amplitude,
            &range,
            Section::YawRateMaxima,
            timing(200.0, 300.0),
            start,
            WATCH,
        )
        .expect("the diagram is valid");
        points[0].orbit.clone()
    };
    assert!(matches!(
        at_least_amplitude(Start::Up),
        Outcome::Meets { .. }
    ));
    assert!(matches!(
        at_least_amplitude(Start::Down),
        Outcome::Rests { .. }
    ));
}
