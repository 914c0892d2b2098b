//! Motions that the engine cannot follow, because their friction is under the mean of a sine or they slide along a step of friction:
//! the same findings at the ECU's fixed step.

use crate::chaos::extrema::Extrema;
use crate::chaos::flow::VehicleFlow;
use crate::chaos::lyapunov::{self, PIECES, WARM_UP};
use crate::chaos::poincare::{Direction, Section, Step};
use crate::chaos::sweep::Timing;
use crate::component::Component;
use crate::engine::taylor::{Crossing, Found, Watched};
use crate::motion::Motion;
use shared_model::vehicle::State;
use shared_model::{InvalidScenario, Scenario};

/// What [`observe`](crate::chaos::observe::observe) finds of a motion. Changes of friction mode are not counted.
///
/// Extents are those of the states behind the steps, turning points and crossings interpolated between them.
///
/// # Errors
/// If the scenario is not valid.
pub fn observe<const K: usize>(
    scenario: &Scenario<f64>,
    timing: Timing,
    watched: Watched,
) -> Result<Found<K>, InvalidScenario> {
    let mut motion = Motion::new(scenario)?;
    if let Err(end) = motion.observe(timing.transient_s, |_, _| {}) {
        let mut found = Found::at(motion.state());
        found.early_end = Some(end);
        return Ok(found);
    }
    let start = *motion.state();
    let (model, injection, step_s) = (*motion.model(), motion.injection(), motion.step_s());
    let section = watched.section.map(|(component, value)| Section {
        component: Component::ALL[component],
        value,
        direction: Direction::Both,
    });
    let mut found = Found::at(&start);
    let mut extrema: [Extrema; 4] = Default::default();
    let mut before = start;
    let seen = motion.observe(timing.observed_s, |time_s, state| {
        for (i, &value) in state.x.iter().enumerate() {
            found.lower[i] = found.lower[i].min(value);
            found.upper[i] = found.upper[i].max(value);
            if watched.turns[i] {
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
        found.growths = pieces(scenario, &start, timing.observed_s)?;
    }
    found.early_end = seen.err().map(|end| end.later_by(timing.transient_s));
    Ok(found)
}

/// The growths of the tangent vectors in the engine's pieces: whole steps make a piece a little shorter than those.
fn pieces<const K: usize>(
    scenario: &Scenario<f64>,
    start: &State<f64>,
    time_s: f64,
) -> Result<Vec<[f64; K]>, InvalidScenario> {
    let flow = VehicleFlow::new(scenario)?;
    let Ok(pieces) = lyapunov::growths(&flow, &start.x, time_s) else {
        return Ok(Vec::new());
    };
    let share = (1.0 - WARM_UP) * time_s / PIECES as f64 / pieces.length_s;
    let whole = |growths: [f64; K]| growths.map(|growth| growth * share);
    Ok(pieces.growths.into_iter().map(whole).collect())
}
