//! What is asked of the engine, and what it finds.

use super::expansion::System;
use super::flight::Flight;
use crate::motion::Diverged;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use shared_model::dither::{Application, Injection};
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Scenario};

/// Vectors side by side: enough to hide the latency of a multiplication.
const VECTORS: usize = 2;
/// Motions that a thread takes at once.
const MOTIONS_A_THREAD: usize = 64;

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
    /// When it left all bounds, s from the start.
    pub diverged: Option<Diverged>,
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
    /// Changes of friction mode.
    pub events: usize,
}

impl<const K: usize> Found<K> {
    pub(super) fn at(start: &State<f64>) -> Self {
        Self {
            end: *start,
            diverged: None,
            turns: [const { Vec::new() }; 4],
            crossings: Vec::new(),
            lower: start.x.into(),
            upper: start.x.into(),
            growths: Vec::new(),
            events: 0,
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
    /// Its right-hand side is not a polynomial.
    #[error(
        "the engine follows the cubic tyre at small slip angles, its friction not under the mean of a sine"
    )]
    NotPolynomial,
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
        System::new(&model, injection, FrictionMode::Neutral).ok_or(Unfit::NotPolynomial)?;
        Ok(Self {
            model,
            injection,
            start,
        })
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
    pub fn follow<const K: usize>(&self, span: &Span) -> Vec<Found<K>> {
        let arch = Arch::new();
        let chunks = self.tasks.par_chunks(MOTIONS_A_THREAD);
        chunks
            .flat_map_iter(|tasks| arch.dispatch(Follow { tasks, span }))
            .collect()
    }

    /// Goes on from where the motions were found to end.
    pub fn go_on_from<const K: usize>(&mut self, found: &[Found<K>]) {
        for (task, found) in self.tasks.iter_mut().zip(found) {
            task.start = found.end;
        }
    }
}

struct Follow<'a, const K: usize> {
    tasks: &'a [Task],
    span: &'a Span,
}

impl<const K: usize> WithSimd for Follow<'_, K> {
    type Output = Vec<Found<K>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        Flight::<S, VECTORS, K>::new(simd, self.tasks, self.span).run()
    }
}
