//! Trajectories that the engine cannot follow, because their friction is under the mean of a sine
//! or they slide along a step of friction: the same findings at the ECU's fixed step.

use crate::component::Component;
use crate::extrema::Extrema;
use crate::flow::VehicleFlow;
use crate::lyapunov::{self, SEGMENTS};
use crate::section::{Direction, Section, Step};
use crate::sweep::Timing;
use engine::Stepper;
use engine::taylor::{Crossing, Observables, Trajectory};
use measures::exponent::WARM_UP;
use shared_model::vehicle::State;
use shared_model::{InvalidScenario, Scenario};

/// What [`observe`](crate::observe::observe) finds of a motion. Changes of friction mode are not
/// counted.
///
/// Extents are those of the states after the steps, turning points and crossings interpolated
/// between them.
///
/// # Errors
/// If the scenario is not valid.
pub fn observe<const K: usize>(
    scenario: &Scenario<f64>,
    timing: Timing,
    observables: Observables,
) -> Result<Trajectory<K>, InvalidScenario> {
    let mut motion = Stepper::new(scenario)?;
    if let Err(end) = motion.observe(timing.transient_s, |_, _| {}) {
        let mut found = Trajectory::at(motion.state());
        found.early_end = Some(end);
        return Ok(found);
    }
    let start = *motion.state();
    let (model, injection, step_s) = (*motion.model(), motion.injection(), motion.step_s());
    let section = observables.section.map(|(component, value)| Section {
        component: Component::ALL[component],
        value,
        direction: Direction::Both,
    });
    let mut found = Trajectory::at(&start);
    let mut extrema: [Extrema; 4] = Default::default();
    let mut before = start;
    let seen = motion.observe(timing.observed_s, |time_s, state| {
        for (i, &value) in state.x.iter().enumerate() {
            found.lower[i] = found.lower[i].min(value);
            found.upper[i] = found.upper[i].max(value);
            if observables.turns[i] {
                extrema[i].push(time_s, step_s, value);
            }
        }
        let step = Step {
            start: before,
            end: *state,
            step_s,
            injection,
        };
        let crossing = section.and_then(|section| step.crossing(&model, &section));
        found.crossings.extend(crossing.map(|crossing| Crossing {
            time_s: time_s - step_s + crossing.time_s,
            x: crossing.x.into(),
            rising: crossing.rising,
        }));
        before = *state;
    });
    found.end = *motion.state();
    found.turns = extrema.map(|extrema| extrema.turns().to_vec());
    if K > 0 && seen.is_ok() {
        found.log_stretching = segments(scenario, &start, timing.observed_s)?;
    }
    found.early_end = seen.err().map(|end| end.later_by(timing.transient_s));
    Ok(found)
}

/// The stretching of the tangent vectors in the engine's segments: whole steps make a segment a
/// little shorter than those.
fn segments<const K: usize>(
    scenario: &Scenario<f64>,
    start: &State<f64>,
    time_s: f64,
) -> Result<Vec<[f64; K]>, InvalidScenario> {
    let flow = VehicleFlow::new(scenario)?;
    let Ok(segments) = lyapunov::log_stretching(&flow, &start.x, time_s) else {
        return Ok(Vec::new());
    };
    let share = (1.0 - WARM_UP) * time_s / SEGMENTS as f64 / segments.length_s;
    let whole = |log_stretching: [f64; K]| log_stretching.map(|growth| growth * share);
    Ok(segments.log_stretching.into_iter().map(whole).collect())
}
