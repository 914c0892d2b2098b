//! What is asked of the engine, and what it finds.

use super::equation::{Analytic, Equation, Polynomial};
use super::flight;
use super::queue::Queue;
use super::tires::offsets;
use crate::motion::EarlyEnd;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use shared_model::dither::{Application, Injection};
use shared_model::friction::Sign;
use shared_model::vehicle::{Model, SlipForm, State};
use shared_model::{InvalidScenario, Scenario};
use std::marker::PhantomData;

/// What is looked at on the way, beside the end. Each costs some percent.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Watched {
    /// Turning points of these components, by index in the state vector.
    pub turns: [bool; 4],
    /// Crossings of this component's level, either way.
    pub section: Option<(usize, f64)>,
}

/// How long motions are followed, and what is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Length, s.
    pub time_s: f64,
    /// Largest last term of a step's expansion, in rad and rad/s.
    pub tolerance: f64,
    /// What is looked at.
    pub watched: Watched,
    /// Time in which the tangent vectors turn into their directions, s.
    pub warm_up_s: f64,
    /// Pieces of equal length behind it, each with the growth of the tangent vectors in it.
    pub pieces: usize,
}

impl Span {
    /// Ends of the warm-up and of the pieces, s.
    pub(super) fn ends_s(&self) -> Vec<f64> {
        if self.pieces == 0 {
            return vec![self.time_s];
        }
        let piece_s = (self.time_s - self.warm_up_s) / self.pieces as f64;
        let end = |k: usize| self.warm_up_s + k as f64 * piece_s;
        (0..=self.pieces).map(end).collect()
    }
}

/// A crossing of the section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Time from the start, s.
    pub time_s: f64,
    /// The state there.
    pub x: [f64; 4],
    /// Upwards, not downwards.
    pub rising: bool,
}

/// Logarithms of the growth of `K` tangent vectors in one piece, kept at right angles; minus infinity for one that has no length
/// left.
pub type Growths<const K: usize> = [f64; K];

/// What is found of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Found<const K: usize> {
    /// The state at the end.
    pub end: State<f64>,
    /// When and why it ended before its time, from the start; the rest is up to there.
    pub early_end: Option<EarlyEnd>,
    /// Turning points of each component watched: time from the start (s) and value.
    pub turns: [Vec<(f64, f64)>; 4],
    /// Crossings of the section.
    pub crossings: Vec<Crossing>,
    /// Least value of each component; exact where its turning points are watched.
    pub lower: [f64; 4],
    /// Greatest value.
    pub upper: [f64; 4],
    /// Growth of the tangent vectors, piece by piece.
    pub growths: Vec<Growths<K>>,
    /// Growth of the first tangent vector since the start, a logarithm, at each turning point of the yaw rate, if that is watched.
    pub growth_at_turns: Vec<f64>,
    /// Changes of friction mode.
    pub events: usize,
    /// Steps.
    pub steps: usize,
}

impl<const K: usize> Found<K> {
    /// Nothing yet, of a motion at its start.
    pub fn at(start: &State<f64>) -> Self {
        Self {
            end: *start,
            early_end: None,
            turns: [const { Vec::new() }; 4],
            crossings: Vec::new(),
            lower: start.x.into(),
            upper: start.x.into(),
            growths: Vec::new(),
            growth_at_turns: Vec::new(),
            events: 0,
            steps: 0,
        }
    }

    pub(super) fn extend(&mut self, component: usize, value: f64) {
        self.lower[component] = self.lower[component].min(value);
        self.upper[component] = self.upper[component].max(value);
    }
}

/// Why a motion cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unfit {
    /// Its scenario is not valid.
    #[error(transparent)]
    Invalid(#[from] InvalidScenario),
    /// Its friction is smooth, but has no series where the sine ends.
    #[error("the engine does not follow friction under the mean of a sine")]
    SmoothFriction,
}

/// A motion to be followed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Task {
    pub model: Model<f64>,
    pub injection: Injection<f64>,
    pub start: State<f64>,
}

impl Task {
    /// The motion of a scenario from its start under the mean of its dither, which is on from then.
    fn new(scenario: &Scenario<f64>) -> Result<Self, Unfit> {
        scenario.validate()?;
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
        let model = Model::new(&averaged);
        let injection = averaged.dither.injection(0.0);
        let mut start = model.initial_state(&averaged);
        start.friction = model.mode_at(&start.x, injection);
        if let Sign::Smooth { .. } = model.friction_sign(injection) {
            return Err(Unfit::SmoothFriction);
        }
        Ok(Self {
            model,
            injection,
            start,
        })
    }

    /// What all motions of a flight have in common: form of the slip angles, slip angles at which the Magic Formula is worked out (none
    /// for cubic tyres), and the friction law's argument.
    fn form(&self) -> (SlipForm, usize, Option<usize>) {
        let probes = offsets(self.model.tires().0, self.injection).len();
        (self.model.constants().slip_form, probes, self.argument())
    }

    /// Index in the state of the friction law's argument, if friction has modes.
    pub(super) fn argument(&self) -> Option<usize> {
        let stepped = matches!(
            self.model.friction_sign(self.injection),
            Sign::Stepped { .. }
        );
        stepped.then(|| self.model.friction_argument())
    }
}

/// Motions of scenarios from their starts, the dither averaged and on from then.
#[derive(Debug, Clone)]
pub struct Motions {
    tasks: Vec<Task>,
}

impl Motions {
    /// The motions at their starts.
    ///
    /// # Errors
    /// If a scenario is not valid, or none for this engine.
    pub fn new(scenarios: &[Scenario<f64>]) -> Result<Self, Unfit> {
        let tasks = scenarios.iter().map(Task::new).collect::<Result<_, _>>()?;
        Ok(Self { tasks })
    }

    /// Follows all for a span, with `K` tangent vectors each, on all threads. What is found is in the scenarios' order.
    pub fn follow<const K: usize>(&self, span: &Span) -> Vec<Found<K>>
    where
        Tangents<K>: Compiled<K>,
    {
        Tangents::follow(self, Arch::new(), span)
    }

    fn follow_by<const K: usize>(&self, arch: Arch, span: &Span) -> Vec<Found<K>> {
        let alike = self.tasks.chunk_by(|a, b| a.form() == b.form());
        let follow = |tasks: &[Task]| match tasks[0].form() {
            (SlipForm::SmallAngle, 0, _) => follow::<Polynomial, K>(arch, tasks, span),
            _ => follow::<Analytic, K>(arch, tasks, span),
        };
        alike.flat_map(follow).collect()
    }

    /// Goes on from where the motions were found to end.
    pub fn go_on_from<const K: usize>(&mut self, found: &[Found<K>]) {
        for (task, found) in self.tasks.iter_mut().zip(found) {
            task.start = found.end;
        }
    }
}

/// A number of tangent vectors.
#[derive(Debug)]
pub struct Tangents<const K: usize>;

/// A number of tangent vectors for which this crate has the engine's code: a minute's work of the compiler, which is not to be done
/// again wherever the engine is called.
pub trait Compiled<const K: usize> {
    /// Follows motions with a given instruction set.
    fn follow(motions: &Motions, arch: Arch, span: &Span) -> Vec<Found<K>>;
}

impl Compiled<0> for Tangents<0> {
    #[inline(never)]
    fn follow(motions: &Motions, arch: Arch, span: &Span) -> Vec<Found<0>> {
        motions.follow_by(arch, span)
    }
}

impl Compiled<1> for Tangents<1> {
    #[inline(never)]
    fn follow(motions: &Motions, arch: Arch, span: &Span) -> Vec<Found<1>> {
        motions.follow_by(arch, span)
    }
}

impl Compiled<4> for Tangents<4> {
    #[inline(never)]
    fn follow(motions: &Motions, arch: Arch, span: &Span) -> Vec<Found<4>> {
        motions.follow_by(arch, span)
    }
}

/// Follows tasks that are alike, each thread as many side by side as it has lanes.
fn follow<E: Equation, const K: usize>(arch: Arch, tasks: &[Task], span: &Span) -> Vec<Found<K>> {
    let queue = &Queue::new(tasks, span.ends_s()[0]);
    let threads = rayon::current_num_threads();
    let most = tasks.len().div_ceil(threads);
    let flights = (0..threads).into_par_iter();
    let mut results: Vec<_> = flights
        .flat_map_iter(|_| {
            arch.dispatch(Fly::<E, K> {
                queue,
                span,
                most,
                equation: PhantomData,
            })
        })
        .collect();
    results.sort_unstable_by_key(|&(index, _)| index);
    results.into_iter().map(|(_, found)| found).collect()
}

/// One thread's share.
struct Fly<'a, E, const K: usize> {
    queue: &'a Queue<'a, K>,
    span: &'a Span,
    most: usize,
    equation: PhantomData<E>,
}

impl<E: Equation, const K: usize> WithSimd for Fly<'_, E, K> {
    type Output = Vec<flight::Result<K>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        E::fly(simd, self.queue, self.span, self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::x86::{V3, V4};
    use shared_model::dither::Waveform;
    use shared_model::tire::TireModel;

    /// Motions of all kinds: chaos, a period, stick, rest, and one that diverges; and of both kinds of right-hand side.
    fn scenarios() -> Vec<Scenario<f64>> {
        let scenario = |k: usize| {
            let mut scenario = Scenario::reconstruction();
            scenario.run.wheel_speed_rpm = 800.0 + 60.0 * k as f64;
            scenario.run.sideslip_rad = 0.02 - 0.003 * k as f64;
            if k % 3 == 1 {
                scenario.dither.waveform = Waveform::Square;
                scenario.dither.amplitude_v = 0.1;
            }
            if k > 20 {
                scenario.vehicle.slip_form = SlipForm::Exact;
                scenario.tires.model = TireModel::MagicFormula;
                scenario.run.wheel_speed_rpm = 1700.0;
            }
            if k == 11 || k == 13 {
                // At rest from the start, at exact zeros; with a friction of no torque.
                scenario.run.sideslip_rad = 0.0;
                scenario.run.steering_angle_rad = 0.0;
                scenario.steering.motor_current_a = 0.0;
                scenario.friction.coefficient = if k == 11 { 0.0 } else { 0.28 };
            }
            if k == 7 {
                (scenario.tires.front, scenario.tires.rear) =
                    shared_model::tire::HIGH_FRICTION_ROAD;
            }
            scenario
        };
        (0..40).map(scenario).collect()
    }

    fn span() -> Span {
        Span {
            time_s: 5.0,
            tolerance: 1e-11,
            watched: Watched {
                turns: [true; 4],
                section: Some((1, 0.0)),
            },
            warm_up_s: 1.0,
            pieces: 4,
        }
    }

    /// Neither the instruction set, nor the neighbours in a vector, nor the number of threads changes a bit. On one thread the
    /// motions are more than its lanes, and take turns.
    #[test]
    fn bits_are_the_same_on_every_path_and_in_every_company() {
        let scenarios = scenarios();
        let motions = Motions::new(&scenarios).expect("all fit");
        let portable = Tangents::<4>::follow(&motions, Arch::Scalar, &span());
        let v3 = V3::try_new().map(Arch::V3);
        let v4 = V4::try_new().map(Arch::V4);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads can be started").install(|| {
                for arch in [v3, v4].into_iter().flatten() {
                    assert_eq!(
                        Tangents::<4>::follow(&motions, arch, &span()),
                        portable,
                        "{arch:?}"
                    );
                }
            });
        }
        let alone = |scenario: &Scenario<f64>| {
            let motion = Motions::new(std::slice::from_ref(scenario)).expect("it fits");
            motion.follow::<4>(&span()).remove(0)
        };
        assert_eq!(scenarios.iter().map(alone).collect::<Vec<_>>(), portable);
        assert!(portable[7].early_end.is_some());
        assert!(portable.iter().any(|found| found.events > 0));
        assert!(portable.iter().all(|found| found.crossings.len() < 1000));
    }
}
