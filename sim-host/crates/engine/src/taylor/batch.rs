//! The steps: many motions in lanes, each with its own time.

mod observe;
mod scheduling;
mod stretching;

use super::equation::Equation;
use super::expansion::Expansion;
use super::guard::Guards;
use super::lanes::Lanes;
use super::observables::{Span, Trajectory};
use super::queue::{Active, LONGEST_STEP_S, LaneData, Queue};
use super::series::{ORDER, Series, value};
use crate::events::{Guard, next_mode};
use measures::{EarlyEnd, Reason};
use nalgebra::Vector4;
use pulp::Simd;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::STEERING_RATE;

/// Factor by which a step shrinks until it meets the tolerance, and its inverse by which it grows
/// where that would have met it.
const SHRINK: f64 = 0.92;
/// Factors tried without asking whether they are needed: the processor would rather try than guess.
const USUAL_SHRINKS: usize = 3;
/// Factors tried before a step is given up.
const MOST_SHRINKS: usize = 300;
/// A mode shorter than this, s, is one of a row in which a motion slides along a step of its
/// friction law.
const SHORT_MODE_S: f64 = 1e-6;
/// Largest last term of a tangent vector's expansion, as a share of its length.
const TANGENT_TOLERANCE: f64 = 1e-5;
/// Steps after which the last motions take turns, interruptions are heard, and the number of steps
/// is held against its bound.
const STEPS_A_TURN: usize = 64;
/// Steps that a motion may take: at once, and per second of motion. The paper's take some ten per
/// second.
const STEPS_AT_ONCE: f64 = 1e5;
const STEPS_PER_S: f64 = 1e5;
/// Mode transitions in a row after short modes that indicate a sliding mode.
const MOST_SHORT_MODES: usize = 1000;

/// What was found of the task with an index.
pub(super) type Result<const K: usize> = (usize, Trajectory<K>);

/// Motions on their way.
pub(super) struct Batch<'a, S: Simd, const V: usize, const K: usize, E: Equation> {
    simd: S,
    span: &'a Span,
    queue: &'a Queue<'a, K>,
    /// Ends of the pieces, s from the start.
    ends_s: Vec<f64>,
    steps: usize,
    lanes: Vec<Option<Active<'a, K>>>,
    /// How many lanes have a motion.
    active: usize,
    results: Vec<Result<K>>,
    /// Index of the friction law's argument in a state, if a mode can end at all.
    argument: Option<usize>,
    expansion: Expansion<S, V, K, E>,
    guards: Guards<Lanes<S, V>>,
    /// The step that the tolerance allows, s.
    step_s: Lanes<S, V>,
    /// What is left of the piece, s; infinite in an empty lane.
    left_s: Lanes<S, V>,
    /// Lanes whose friction mode ends in the present step, each with the bound that ends it.
    mode_transitions: Vec<(usize, f64)>,
    /// Lengths that tangent vectors had when they were made unit vectors, multiplied up.
    stretch: [Lanes<S, V>; K],
}

impl<'a, S: Simd, const V: usize, const K: usize, E: Equation> Batch<'a, S, V, K, E> {
    /// Up to `most` motions of the queue at once.
    pub fn new(simd: S, queue: &'a Queue<'a, K>, span: &'a Span, most: usize) -> Self {
        let splat = |number| Lanes::splat(simd, number);
        let like = queue.first();
        let mut batch = Self {
            simd,
            span,
            queue,
            ends_s: span.ends_s(),
            steps: 0,
            lanes: (0..Lanes::<S, V>::COUNT).map(|_| None).collect(),
            active: 0,
            results: Vec::new(),
            argument: like.argument(),
            expansion: Expansion::new(simd, &like.model, like.injection),
            guards: Guards::none(simd),
            step_s: splat(0.0),
            left_s: splat(f64::INFINITY),
            mode_transitions: Vec::new(),
            stretch: [splat(1.0); K],
        };
        for lane in 0..Lanes::<S, V>::COUNT {
            if lane < most {
                batch.load_next(lane);
            } else {
                batch.set_lane_data(lane, &LaneData::idle());
            }
        }
        batch
    }

    /// Follows motions until none waits and none is aboard.
    #[inline(always)]
    pub fn run(mut self) -> Vec<Result<K>> {
        while self.active > 0 {
            self.step();
            if self.steps.is_multiple_of(STEPS_A_TURN) {
                interrupt::check();
                self.bound_steps();
                self.take_turns();
            }
        }
        self.results
    }

    #[inline(always)]
    fn step(&mut self) {
        self.steps += 1;
        self.expansion.expand();
        let mut step_s = self.choose_step();
        if let Some(argument) = self.argument {
            self.find_mode_transitions(argument, &mut step_s);
        }
        for component in 0..4 {
            if self.span.observables.turns[component] {
                self.find_turning_points(component, &step_s);
            }
        }
        let mut next = [step_s; 4];
        for i in 0..4 {
            next[i] = value(&self.expansion.x[i], step_s);
        }
        if let Some((component, level)) = self.span.observables.section {
            self.find_crossings(component, level, &step_s, &next);
        }
        for i in 0..4 {
            self.expansion.x[i][0] = next[i];
            for k in 0..K {
                let series = &mut self.expansion.tangents[k][i];
                series[0] = value(series, step_s);
            }
        }
        self.left_s = self.left_s - step_s;
        while let Some((lane, bound)) = self.mode_transitions.pop() {
            self.change_mode(lane, bound, step_s.as_slice()[lane]);
        }
        self.keep_tangents_finite();
        self.finish_segments();
    }

    /// Ends motions that take more steps than a motion of their time may: with the tolerance's
    /// bound on a step, no input makes a run endless.
    #[inline(never)]
    fn bound_steps(&mut self) {
        for lane in 0..self.lanes.len() {
            let Some(motion) = &self.lanes[lane] else {
                continue;
            };
            let steps = motion.trajectory.steps + self.steps - motion.entered_at_step;
            if steps as f64 > STEPS_AT_ONCE + STEPS_PER_S * self.time_s(lane) {
                self.end_early(lane, Reason::TooManySteps);
            }
        }
    }

    /// Ends a lane's motion where it is, at the end of this step or of the next.
    fn end_early(&mut self, lane: usize, reason: Reason) {
        let time_s = self.time_s(lane);
        if let Some(motion) = &mut self.lanes[lane] {
            motion.trajectory.early_end = Some(EarlyEnd { time_s, reason });
            self.left_s.as_mut_slice()[lane] = 0.0;
        }
    }

    /// The step of each lane: no longer than its last term is within the tolerance, nor than its
    /// piece.
    #[inline(always)]
    fn choose_step(&mut self) -> Lanes<S, V> {
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        let factor = SHRINK.powi(ORDER as i32);
        let tolerance = splat(self.span.tolerance);
        let last = greatest(&self.expansion.x, ORDER).max(self.last_of_tangents());
        let mut step_s = self.step_s;
        let mut error = last * power(step_s);
        for tried in 0..MOST_SHRINKS {
            if tried >= USUAL_SHRINKS && error.all_less(tolerance) {
                break;
            }
            step_s = error.select_less(tolerance, step_s, step_s.scale(SHRINK));
            error = error.select_less(tolerance, error, error.scale(factor));
        }
        let longer = step_s.scale(1.0 / SHRINK).min(splat(LONGEST_STEP_S));
        let error_of_longer = error.scale(1.0 / factor);
        self.step_s = error_of_longer.select_less(tolerance, longer, step_s);
        step_s.min(self.left_s)
    }

    /// Greatest last term of the tangent vectors, weighed so that the tolerance of a state is
    /// theirs. At rest the state's own terms vanish, and would allow any step.
    #[inline(always)]
    fn last_of_tangents(&self) -> Lanes<S, V> {
        let zero = self.step_s.zero();
        let mut last = zero;
        for k in 0..K {
            last = last.max(greatest(&self.expansion.tangents[k], ORDER));
        }
        if K == 1 {
            // A single vector has any length, and none where friction took it away.
            let length = greatest(&self.expansion.tangents[0], 0);
            last = zero.select_less(length, last.over(length), zero);
        }
        last.scale(self.span.tolerance / TANGENT_TOLERANCE)
    }

    /// Shortens the step of lanes whose friction mode ends within it.
    #[inline(always)]
    fn find_mode_transitions(&mut self, argument: usize, step_s: &mut Lanes<S, V>) {
        let (x, force) = (
            &self.expansion.x[argument],
            self.expansion.forces.front_force(),
        );
        let room = self.guards.room(x, force, *step_s);
        if room.zero().all_less(room) {
            return;
        }
        for lane in room.at_most_zero() {
            let most_s = &mut step_s.as_mut_slice()[lane];
            if let Some((instant_s, bound)) = self.guards.first_end(lane, x, force, *most_s) {
                *most_s = instant_s;
                self.mode_transitions.push((lane, bound));
            }
        }
    }

    /// The mode of a lane ends, which `lasted_s` since the step began; the guard is at `bound`.
    /// Tangent vectors jump by the saltation matrix (M. di Bernardo et al., Piecewise-smooth
    /// Dynamical Systems, section 2.5): only the steering's acceleration jumps.
    #[inline(never)]
    fn change_mode(&mut self, lane: usize, bound: f64, lasted_s: f64) {
        let mut x = Vector4::from(self.state(lane));
        let Some(motion) = &mut self.lanes[lane] else {
            return;
        };
        let (model, injection) = (&motion.task.model, motion.task.injection);
        let argument = model.friction_argument();
        let from = motion.mode;
        if from != FrictionMode::Sticking {
            // Just beyond, whatever rounding left.
            let is_lower = bound == Guard::of(model, injection, from, &x).lower;
            let beyond = if is_lower {
                bound.next_down()
            } else {
                bound.next_up()
            };
            x[argument] = beyond;
        }
        let to = next_mode(model, injection, from, &mut x);
        let before = model.derivative(&x, injection, from);
        let after = model.derivative(&x, injection, to);
        motion.mode = to;
        motion.trajectory.events += 1;
        motion.short_modes = if lasted_s <= SHORT_MODE_S {
            motion.short_modes + 1
        } else {
            0
        };
        let chatters = motion.short_modes > MOST_SHORT_MODES;
        for i in 0..4 {
            motion.trajectory.extend(i, x[i]);
        }
        let jump = match from {
            FrictionMode::Sticking => 0.0,
            _ => (after[STEERING_RATE] - before[STEERING_RATE]) / before[argument],
        };
        for tangent in &mut self.expansion.tangents {
            let along = tangent[argument][0].as_slice()[lane];
            let rate = &mut tangent[STEERING_RATE][0].as_mut_slice()[lane];
            *rate = match to {
                FrictionMode::Sticking => 0.0,
                _ => jump.mul_add(along, *rate),
            };
        }
        for i in 0..4 {
            self.expansion.x[i][0].as_mut_slice()[lane] = x[i];
        }
        self.load_mode(lane);
        if chatters {
            self.end_early(lane, Reason::Chattering);
        }
    }

    /// Puts the numbers of a lane's mode into the vectors.
    fn load_mode(&mut self, lane: usize) {
        let Some(motion) = &self.lanes[lane] else {
            return;
        };
        let (model, injection) = (&motion.task.model, motion.task.injection);
        let x = Vector4::from(self.state(lane));
        self.expansion.set_mode(lane, model, motion.mode);
        self.guards
            .set_lane(lane, model, injection, motion.mode, &x);
    }

    fn state(&self, lane: usize) -> [f64; 4] {
        self.expansion.x.each_ref().map(|x| x[0].as_slice()[lane])
    }

    /// A lane's time from the start, s.
    fn time_s(&self, lane: usize) -> f64 {
        match &self.lanes[lane] {
            Some(motion) => self.ends_s[motion.segment] - self.left_s.as_slice()[lane],
            None => 0.0,
        }
    }
}

/// Coefficient `n` of each component.
#[inline(always)]
fn coefficients<S: Simd, const V: usize>(x: &[Series<S, V>; 4], n: usize) -> [Lanes<S, V>; 4] {
    [x[0][n], x[1][n], x[2][n], x[3][n]]
}

/// Greatest absolute value of coefficient `n`.
#[inline(always)]
fn greatest<S: Simd, const V: usize>(x: &[Series<S, V>; 4], n: usize) -> Lanes<S, V> {
    let [a, b, c, d] = coefficients(x, n);
    a.abs().max(b.abs()).max(c.abs().max(d.abs()))
}

/// The power of the last term.
#[inline(always)]
fn power<S: Simd, const V: usize>(step_s: Lanes<S, V>) -> Lanes<S, V> {
    let square = step_s * step_s;
    let mut power = square;
    for _ in 1..ORDER / 2 {
        power = power * square;
    }
    if ORDER % 2 == 1 {
        power * step_s
    } else {
        power
    }
}
