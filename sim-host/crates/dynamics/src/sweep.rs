//! What sweeps share: the parameter that is swept, its values, the times of a run, and the work on
//! many points at once.

use crate::decimal::{NotSpaced, Spaced};
use crate::simulate::Unsettled;
use crate::words::{Short, counted};
use engine::EarlyEnd;
use interrupt;
use rayon::prelude::*;
use shared_model::dither::Waveform;
use shared_model::vehicle::State;
use shared_model::{InvalidScenario, Scenario};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most values of one range.
const MAX_VALUES: usize = 10_000_000;

/// Most items of a batch: the engine's lanes are full for most of its time, and a stop is heard
/// soon.
pub const LARGEST_BATCH: usize = 64;

/// What a sweep varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// The wheel speed, rpm.
    Speed,
    /// The dither's amplitude W, V.
    Amplitude,
}

impl Parameter {
    /// Name as in a configuration file.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Speed => "run.wheel_speed_rpm",
            Self::Amplitude => "dither.amplitude_v",
        }
    }

    /// The parameter of that name in a configuration file.
    pub fn from_key(key: &str) -> Option<Self> {
        [Self::Speed, Self::Amplitude]
            .into_iter()
            .find(|parameter| parameter.key() == key)
    }

    /// Name with unit, as axes and messages show it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Speed => "wheel speed (rpm)",
            Self::Amplitude => "dither amplitude (V)",
        }
    }

    /// Unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Speed => "rpm",
            Self::Amplitude => "V",
        }
    }

    /// The width to which an edge is located unless told otherwise: 0.5 rpm or 0.5 mV.
    pub fn edge_width(self) -> f64 {
        match self {
            Self::Speed => 0.5,
            Self::Amplitude => 0.5e-3,
        }
    }

    /// The scenario with the parameter's value put in.
    pub fn set(self, scenario: &Scenario<f64>, value: f64) -> Scenario<f64> {
        let mut scenario = *scenario;
        match self {
            Self::Speed => scenario.run.wheel_speed_rpm = value,
            Self::Amplitude => scenario.dither.amplitude_v = value,
        }
        scenario
    }

    /// The parameter's value in a scenario.
    pub fn of(self, scenario: &Scenario<f64>) -> f64 {
        match self {
            Self::Speed => scenario.run.wheel_speed_rpm,
            Self::Amplitude => scenario.dither.amplitude_v,
        }
    }
}

/// Why a sweep cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SweepError {
    /// Bounds and step are no range.
    #[error("{what}: from {} to {} in steps of {}: {fault}", Short(*.from), Short(*.to), Short(*.step))]
    Range {
        /// What the range is of.
        what: &'static str,
        /// Its lower bound.
        from: f64,
        /// Its upper bound.
        to: f64,
        /// Its step.
        step: f64,
        /// What is wrong, with bounds.
        fault: &'static str,
    },
    /// Bounds and number are no range.
    #[error("{what}: {} from {} to {}: {fault}", counted(*.count, "value"), Short(*.from), Short(*.to))]
    Count {
        /// What the range is of.
        what: &'static str,
        /// One end.
        from: f64,
        /// The other end.
        to: f64,
        /// How many values.
        count: usize,
        /// What is wrong, with bounds.
        fault: &'static str,
    },
    /// Nothing of the run is left after the transient.
    #[error(
        "a run of {} s with a transient of {} s: the transient must be at least 0 and shorter than the run",
        Short(*.time_s), Short(*.transient_s)
    )]
    Timing {
        /// Length of the whole run, s.
        time_s: f64,
        /// Length of the transient, s.
        transient_s: f64,
    },
    /// A sweep over the amplitude of a dither that is off.
    #[error(
        "a sweep over the dither's amplitude needs a dither: its waveform is none, and must be square or sine"
    )]
    NoDither,
    /// No motion ever crosses the section.
    #[error(
        "the section {component} = {level} is never crossed upwards: the motions stay from {low} to {high}"
    )]
    SectionNotCrossed {
        /// The section's component, with its unit.
        component: String,
        /// Its level.
        level: f64,
        /// Least value of the component on all motions.
        low: f64,
        /// Greatest value.
        high: f64,
    },
    /// A point's scenario is not valid.
    #[error("{0}")]
    Scenario(#[from] InvalidScenario),
    /// A motion that is needed as a start leaves all bounds.
    #[error(transparent)]
    EndsEarly(#[from] EarlyEnd),
}

impl From<Unsettled> for SweepError {
    fn from(error: Unsettled) -> Self {
        match error {
            Unsettled::Invalid(error) => error.into(),
            Unsettled::EndsEarly(end) => end.into(),
        }
    }
}

/// Equally spaced values, each the double nearest to its decimal value; but for those by
/// [`parts`](Self::parts).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Values(Kind);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Decimal(Spaced),
    Multiples { of: f64, count: usize },
}

impl Values {
    /// The values from `from` on in steps of `step`, not beyond `to`, which may be the lower one;
    /// `what` they are of is for the message.
    ///
    /// # Errors
    /// If a number is not finite, the step is 0 or leads away from `to`, values are more than ten
    /// million, or neighbours are the same number.
    pub fn new(what: &'static str, from: f64, to: f64, step: f64) -> Result<Self, SweepError> {
        let refuse = |fault| {
            Err(SweepError::Range {
                what,
                from,
                to,
                step,
                fault,
            })
        };
        if ![from, to, step].iter().all(|value| value.is_finite()) {
            return refuse("all three must be finite numbers");
        }
        if step == 0.0 || step < 0.0 && to >= from {
            return refuse("the step must be greater than 0; only downwards it may be less");
        }
        match Spaced::in_steps(from, to, step, MAX_VALUES) {
            Ok(values) => Ok(Self(Kind::Decimal(values))),
            Err(fault) => refuse(words(fault)),
        }
    }

    /// `count` values, `from` and `to` among them.
    ///
    /// # Errors
    /// If a number is not finite, there is no value, or neighbours are the same number.
    pub fn between(
        what: &'static str,
        from: f64,
        to: f64,
        count: usize,
    ) -> Result<Self, SweepError> {
        let refuse = |fault| {
            Err(SweepError::Count {
                what,
                from,
                to,
                count,
                fault,
            })
        };
        if !from.is_finite() || !to.is_finite() {
            return refuse("both must be finite numbers");
        }
        if count == 0 || (count == 1) != (from == to) {
            return refuse("there must be at least two, or one with both ends the same");
        }
        match Spaced::between(from, to, count) {
            Ok(values) => Ok(Self(Kind::Decimal(values))),
            Err(fault) => refuse(words(fault)),
        }
    }

    /// The ends of `parts` equal parts from 0 to `to`, as multiples of the double that is nearest
    /// to one: the ECU's table is made from these, and depends on their last bits.
    ///
    /// # Errors
    /// If `to` is not a positive number, or there is no part.
    pub fn parts(what: &'static str, to: f64, parts: usize) -> Result<Self, SweepError> {
        let count = parts.saturating_add(1);
        if to <= 0.0 {
            return Err(SweepError::Count {
                what,
                from: 0.0,
                to,
                count,
                fault: "the end must be greater than 0",
            });
        }
        Self::between(what, 0.0, to, count)?;
        Ok(Self(Kind::Multiples {
            of: to / parts as f64,
            count,
        }))
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        match &self.0 {
            Kind::Decimal(values) => values.count(),
            Kind::Multiples { count, .. } => *count,
        }
    }

    /// Value number `k` of the ascending ones, from 0 on.
    pub fn at(&self, k: usize) -> f64 {
        match &self.0 {
            Kind::Decimal(values) => values.at(k),
            Kind::Multiples { of, .. } => k as f64 * of,
        }
    }

    /// The least.
    pub fn first(&self) -> f64 {
        self.at(0)
    }

    /// The greatest.
    pub fn last(&self) -> f64 {
        self.at(self.count() - 1)
    }

    /// The values, ascending.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = f64> + '_ {
        (0..self.count()).map(|k| self.at(k))
    }
}

fn words(fault: NotSpaced) -> &'static str {
    match fault {
        NotSpaced::Count => "these are more than ten million values",
        NotSpaced::SizesDiffer => "the numbers differ too much in size to be counted in decimals",
        NotSpaced::SameNumber => "neighbouring values would be the same number",
    }
}

/// Length of a run and of the transient in it, s.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Timing {
    /// What passes before the motion is looked at, s.
    pub transient_s: f64,
    /// What is looked at, s.
    pub observed_s: f64,
}

impl Timing {
    /// A run of `time_s`, of which the first `transient_s` are not looked at.
    ///
    /// # Errors
    /// If nothing is left.
    pub fn new(transient_s: f64, time_s: f64) -> Result<Self, SweepError> {
        if transient_s >= 0.0 && transient_s < time_s && time_s.is_finite() {
            return Ok(Self {
                transient_s,
                observed_s: time_s - transient_s,
            });
        }
        Err(SweepError::Timing {
            time_s,
            transient_s,
        })
    }

    /// Length of the whole run, s.
    pub fn time_s(&self) -> f64 {
        self.transient_s + self.observed_s
    }
}

/// The scenarios of a sweep, each checked.
///
/// # Errors
/// If one is not valid, or the amplitude of no dither is to be swept.
pub fn scenarios(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    values: &Values,
) -> Result<Vec<Scenario<f64>>, SweepError> {
    if parameter == Parameter::Amplitude && scenario.dither.waveform == Waveform::None {
        return Err(SweepError::NoDither);
    }
    let point = |value| {
        let point = parameter.set(scenario, value);
        point.validate()?;
        Ok(point)
    };
    values.iter().map(point).collect()
}

/// The start with the opposite signs: on the other lobe.
pub fn mirrored(scenario: &Scenario<f64>) -> Scenario<f64> {
    let run = &scenario.run;
    let state = State {
        x: -nalgebra::Vector4::new(
            run.sideslip_rad,
            run.yaw_rate_rad_per_s,
            run.steering_angle_rad,
            run.steering_rate_rad_per_s,
        ),
        friction: shared_model::friction::FrictionMode::Sticking,
    };
    crate::simulate::started_at(scenario, &state)
}

/// Control of a long run: the request to stop, and the report of progress.
#[derive(Clone, Copy)]
pub struct RunControl<'a> {
    /// Set when no further point is to be begun.
    pub stop: &'a AtomicBool,
    /// Called after each point.
    pub done: &'a (dyn Fn() + Sync),
}

/// Never set.
static NEVER: AtomicBool = AtomicBool::new(false);

impl RunControl<'_> {
    /// No request to stop, and no reports.
    pub const fn none() -> RunControl<'static> {
        RunControl {
            stop: &NEVER,
            done: &|| (),
        }
    }

    /// The result of `work`, unless no point is to be begun any more, or it was interrupted.
    pub fn point<R>(&self, work: impl FnOnce() -> R) -> Option<R> {
        if self.stop.load(Ordering::Relaxed) {
            return None;
        }
        let result = self.unless_interrupted(work)?;
        (self.done)();
        Some(result)
    }

    /// The result of `work`, none if it was interrupted. Without a request to this control, the
    /// caller is interrupted.
    fn unless_interrupted<R>(&self, work: impl FnOnce() -> R) -> Option<R> {
        let result = interrupt::catch(work);
        if result.is_err() && !self.stop.load(Ordering::Relaxed) {
            interrupt::check();
        }
        result.ok()
    }

    /// Independent work on many items at once. Results are in the items' order whatever the number
    /// of threads; items that were not begun, or interrupted, have none.
    pub fn points<T: Sync, R: Send + Sync>(
        &self,
        items: &[T],
        work: impl Fn(&T) -> R + Sync,
    ) -> Vec<Option<R>> {
        let one = |k: usize| self.point(|| work(&items[k]));
        side_by_side(items.len(), one)
    }

    /// The same for work that takes a batch of items and gives a result for each. Batches are of a
    /// size, and as many as keep all threads busy.
    pub fn batches<T: Sync, R: Send + Sync>(
        &self,
        items: &[T],
        work: impl Fn(&[T]) -> Vec<R> + Sync,
    ) -> Vec<Option<R>> {
        let one = |batch: &[T]| -> Vec<Option<R>> {
            if self.stop.load(Ordering::Relaxed) {
                return batch.iter().map(|_| None).collect();
            }
            let Some(results) = self.unless_interrupted(|| work(batch)) else {
                return batch.iter().map(|_| None).collect();
            };
            results.iter().for_each(|_| (self.done)());
            results.into_iter().map(Some).collect()
        };
        let threads = rayon::current_num_threads();
        let rounds = items.len().div_ceil(LARGEST_BATCH * threads);
        let length = items.len().div_ceil((rounds * threads).max(1)).max(1);
        let batches: Vec<&[T]> = items.chunks(length).collect();
        let results = side_by_side(batches.len(), |k| one(batches[k]));
        results.into_iter().flatten().collect()
    }
}

/// The results of `work` for 0 to `count` - 1, in that order, computed on all threads.
pub(crate) fn side_by_side<R: Send + Sync>(
    count: usize,
    work: impl Fn(usize) -> R + Sync,
) -> Vec<R> {
    let results: Vec<OnceLock<R>> = (0..count).map(|_| OnceLock::new()).collect();
    on_all_threads(count, &|k| {
        results[k].get_or_init(|| work(k));
    });
    let results = results.into_iter().map(OnceLock::into_inner);
    results
        .map(|result| result.expect("every number was worked on"))
        .collect()
}

/// Compiled once: rayon's own collection is some 2000 lines of code for every kind of result.
fn on_all_threads(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(1).for_each(work);
}
