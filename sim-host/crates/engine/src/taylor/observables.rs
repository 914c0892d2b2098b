//! Observables of a trajectory, and the span over which they are taken.

use measures::EarlyEnd;
use shared_model::vehicle::State;

/// What is looked at on the way, beside the end. Each costs some percent.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Observables {
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
    pub observables: Observables,
    /// Time in which the tangent vectors turn into their directions, s.
    pub warm_up_s: f64,
    /// Pieces of equal length after it, each with the growth of the tangent vectors in it.
    pub segments: usize,
}

impl Span {
    /// Ends of the warm-up and of the pieces, s.
    pub(super) fn ends_s(&self) -> Vec<f64> {
        if self.segments == 0 {
            return vec![self.time_s];
        }
        let piece_s = (self.time_s - self.warm_up_s) / self.segments as f64;
        let end = |k: usize| self.warm_up_s + k as f64 * piece_s;
        (0..=self.segments).map(end).collect()
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

/// Logarithms of the growth of `K` tangent vectors in one piece, kept at right angles; minus
/// infinity for one that has no length left.
pub type LogStretching<const K: usize> = [f64; K];

/// What is found of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory<const K: usize> {
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
    pub log_stretching: Vec<LogStretching<K>>,
    /// Growth of the first tangent vector since the start, a logarithm, at each turning point of
    /// the yaw rate, if that is watched.
    pub log_stretching_at_turns: Vec<f64>,
    /// Changes of friction mode.
    pub events: usize,
    /// Steps.
    pub steps: usize,
}

impl<const K: usize> Trajectory<K> {
    /// Nothing yet, of a motion at its start.
    pub fn at(start: &State<f64>) -> Self {
        Self {
            end: *start,
            early_end: None,
            turns: [const { Vec::new() }; 4],
            crossings: Vec::new(),
            lower: start.x.into(),
            upper: start.x.into(),
            log_stretching: Vec::new(),
            log_stretching_at_turns: Vec::new(),
            events: 0,
            steps: 0,
        }
    }

    pub(super) fn extend(&mut self, component: usize, value: f64) {
        self.lower[component] = self.lower[component].min(value);
        self.upper[component] = self.upper[component].max(value);
    }
}
