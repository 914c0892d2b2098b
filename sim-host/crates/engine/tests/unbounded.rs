//! Why a fixed step leaves all bounds: the motion does, or the step is too long.

use engine::taylor::{Ensemble, Observables, Span};
use engine::{EarlyEnd, Reason, Stepper};
use shared_model::Scenario;
use shared_model::tire::HIGH_FRICTION_ROAD;

fn by_steps(scenario: &Scenario<f64>) -> Option<EarlyEnd> {
    let mut motion = Stepper::new(scenario).expect("it is valid");
    motion.observe(20.0, |_, _| {}).err()
}

fn by_engine(scenario: &Scenario<f64>) -> Option<EarlyEnd> {
    let span = Span {
        time_s: 20.0,
        tolerance: 1e-10,
        observables: Observables::default(),
        warm_up_s: 0.0,
        segments: 0,
    };
    let motions = Ensemble::new(std::slice::from_ref(scenario)).expect("supported");
    motions.integrate::<0>(&span).remove(0).early_end
}

/// At 8 rad of slip the cubic tyre is so stiff that a step of 1 ms overshoots. The motion comes
/// back.
#[test]
fn a_step_that_overshoots_is_too_long() {
    for start_rad in [-8.0, 3.0, 8.0, 10.0] {
        let mut scenario = Scenario::reconstruction();
        scenario.run.sideslip_rad = start_rad;
        assert_eq!(by_engine(&scenario), None, "{start_rad}");
        if let Some(end) = by_steps(&scenario) {
            assert_eq!(end.reason, Reason::StepTooLong, "{start_rad}: {end}");
        }
        scenario.run.control_rate_hz = 100_000.0;
        scenario.run.pwm_rate_hz = 100_000.0;
        assert_eq!(by_steps(&scenario), None, "{start_rad} with a short step");
    }
    let mut scenario = Scenario::reconstruction();
    scenario.run.sideslip_rad = 8.0;
    assert_eq!(
        by_steps(&scenario).map(|end| end.reason),
        Some(Reason::StepTooLong)
    );
}

/// The high-friction road's cubic tyre is not bounded: its motion diverges, whatever the integrator
/// and the step.
#[test]
fn a_motion_that_diverges_is_named_so() {
    let mut scenario = Scenario::reconstruction();
    (scenario.tires.front, scenario.tires.rear) = HIGH_FRICTION_ROAD;
    let engine = by_engine(&scenario).expect("it diverges");
    assert_eq!(engine.reason, Reason::Diverges);
    for rate_hz in [1000.0, 10_000.0] {
        scenario.run.control_rate_hz = rate_hz;
        let end = by_steps(&scenario).expect("it diverges");
        assert_eq!(end.reason, Reason::Diverges, "{end}");
        assert!(
            (end.time_s - engine.time_s).abs() < 2.0 / rate_hz,
            "{end} {engine}"
        );
    }
}
