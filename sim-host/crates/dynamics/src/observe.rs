//! What motions do after their transients: by the engine, many side by side.

use crate::fixed_step;
use crate::lyapunov::SEGMENTS;
use crate::sweep::{RunControl, Timing};
use engine::taylor::{Compiled, Ensemble, Observables, Span, Tangents, Trajectory, Unsupported};
use engine::{Reason, Stepper};
use measures::exponent::WARM_UP;
use shared_model::friction::Sign;
use shared_model::{InvalidScenario, Scenario};

/// Largest last term of a step's expansion, in rad and rad/s.
const TOLERANCE: f64 = 1e-10;

/// Follows the scenarios' motions and shows `see` what is found of each behind its transient, with
/// `K` tangent vectors. The dither is averaged and on from the start.
///
/// Times found count from the transient's end, only that of a divergence from the motion's start.
/// Results are in the scenarios' order; motions that were not begun have none.
///
/// # Errors
/// If a scenario is not valid.
pub fn observe<const K: usize, R: Send + Sync>(
    scenarios: &[Scenario<f64>],
    timing: Timing,
    observables: Observables,
    control: RunControl,
    see: impl Fn(&Scenario<f64>, &Trajectory<K>) -> R + Sync,
) -> Result<Vec<Option<R>>, InvalidScenario>
where
    Tangents<K>: Compiled<K>,
{
    let (mut fit, mut unfit) = (Vec::new(), Vec::new());
    for (k, scenario) in scenarios.iter().enumerate() {
        let places = if is_supported(scenario)? {
            &mut fit
        } else {
            &mut unfit
        };
        places.push(k);
    }
    let by_engine = control.batches(&fit, |batch| {
        let batch: Vec<_> = batch.iter().map(|&k| scenarios[k]).collect();
        let found =
            follow(&batch, timing, observables).expect("the engine can follow each of them");
        batch.iter().zip(&found).map(|(s, f)| see(s, f)).collect()
    });
    let by_steps = control.points(&unfit, |&k| {
        let found = fixed_step::observe(&scenarios[k], timing, observables);
        found.map(|found| see(&scenarios[k], &found))
    });
    let mut results: Vec<_> = scenarios.iter().map(|_| None).collect();
    for (k, result) in fit.into_iter().zip(by_engine) {
        results[k] = result;
    }
    for (k, result) in unfit.into_iter().zip(by_steps) {
        results[k] = result.transpose()?;
    }
    Ok(results)
}

/// Whether the engine can follow the motion: its friction has a series between events, and where
/// friction steps the motion can stick. Else it may slide along the step, meeting it ever more
/// often.
pub fn is_supported(scenario: &Scenario<f64>) -> Result<bool, InvalidScenario> {
    match Ensemble::new(std::slice::from_ref(scenario)) {
        Ok(_) => {}
        Err(Unsupported::SmoothFriction) => return Ok(false),
        Err(Unsupported::Invalid(error)) => return Err(error),
    }
    let motion = Stepper::new(scenario)?;
    let (model, injection) = (motion.model(), motion.injection());
    Ok(model.friction_sign(injection) == Sign::Zero || model.can_stick(injection))
}

/// What is found of motions after their transients by the engine, as in [`observe`].
///
/// # Errors
/// If a scenario is not valid, or the engine cannot follow it.
pub(crate) fn follow<const K: usize>(
    scenarios: &[Scenario<f64>],
    timing: Timing,
    observables: Observables,
) -> Result<Vec<Trajectory<K>>, Unsupported>
where
    Tangents<K>: Compiled<K>,
{
    let transient = Span {
        time_s: timing.transient_s,
        tolerance: TOLERANCE,
        observables: Observables::default(),
        warm_up_s: 0.0,
        segments: 0,
    };
    let (warm_up, segments) = if K == 0 {
        (0.0, 0)
    } else {
        (WARM_UP, SEGMENTS)
    };
    let observed = Span {
        time_s: timing.observed_s,
        observables,
        warm_up_s: warm_up * timing.observed_s,
        segments,
        ..transient
    };
    let mut ensemble = Ensemble::new(scenarios)?;
    let settled = ensemble.integrate::<0>(&transient);
    ensemble.continue_from(&settled);
    let mut found = ensemble.integrate::<K>(&observed);
    for (found, settled) in found.iter_mut().zip(settled) {
        let later = found.early_end.map(|end| end.later_by(timing.transient_s));
        found.early_end = settled.early_end.or(later);
    }
    for (found, scenario) in found.iter_mut().zip(scenarios) {
        // What the engine cannot pass between events, the fixed step can.
        if found
            .early_end
            .is_some_and(|end| end.reason != Reason::Diverges)
        {
            *found = fixed_step::observe(scenario, timing, observables)?;
        }
    }
    Ok(found)
}
