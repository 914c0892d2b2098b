//! The steps: many motions in lanes, each with its own time.

use super::equation::Equation;
use super::expansion::Expansion;
use super::guard::{Guards, RELEASE_MARGIN};
use super::lanes::Lanes;
use super::motion::{Crossing, Found, Span};
use super::queue::{LONGEST_STEP_S, Motion, Numbers, Queue, Waiting};
use super::roots::{self, derivative};
use super::series::{ORDER, Series, of_lane, value};
use crate::engine::events::{Guard, next_mode};
use crate::motion::Diverged;
use crate::trace::BOUND;
use nalgebra::Vector4;
use pulp::Simd;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{STEERING_RATE, State, YAW_RATE};

/// A motion that needs a step shorter than this leaves all bounds, s.
const SHORTEST_STEP_S: f64 = 1e-9;
/// Factor by which a step shrinks until it meets the tolerance, and its inverse by which it grows where that would have met it.
const SHRINK: f64 = 0.92;
/// Factors tried without asking whether they are needed: the processor would rather try than guess.
const USUAL_SHRINKS: usize = 3;
/// Factors tried before a step is given up.
const MOST_SHRINKS: usize = 300;
/// A rate of change below this (in the component's unit a second) is rounding, which has turning points of its own.
const RATE_FLOOR: f64 = 1e-13;
/// A mode shorter than this, s, is one of a row in which a motion slides along a step of its friction law, and so many of them are
/// one too many.
const SHORT_MODE_S: f64 = 1e-6;
const MOST_SHORT_MODES: usize = 1000;
/// After so many steps another of the last motions waits for its turn.
const STEPS_A_TURN: usize = 64;
/// Lengths of a tangent vector, squared, that leave room for a step's growth.
const LENGTHS_SQUARED: (f64, f64) = (1e-200, 1e200);
/// A tangent vector is lost when orthogonalisation leaves less than this share of it, squared.
const LOST_SQUARED: f64 = 1e-24;

/// What was found of the task with an index.
pub(super) type Result<const K: usize> = (usize, Found<K>);

/// Motions on their way.
pub(super) struct Flight<'a, S: Simd, const V: usize, const K: usize, E: Equation> {
    simd: S,
    span: &'a Span,
    queue: &'a Queue<'a, K>,
    /// Ends of the pieces, s from the start.
    ends_s: Vec<f64>,
    steps: usize,
    lanes: Vec<Option<Motion<'a, K>>>,
    /// How many lanes have a motion.
    aboard: usize,
    /// Whose turn it is to wait.
    turn: usize,
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
    ends_of_modes: Vec<(usize, f64)>,
    /// Lengths that tangent vectors had when they were made unit vectors, multiplied up.
    stretch: [Lanes<S, V>; K],
}

impl<'a, S: Simd, const V: usize, const K: usize, E: Equation> Flight<'a, S, V, K, E> {
    /// Up to `most` motions of the queue at once.
    pub fn new(simd: S, queue: &'a Queue<'a, K>, span: &'a Span, most: usize) -> Self {
        let splat = |number| Lanes::splat(simd, number);
        let like = queue.first();
        let mut flight = Self {
            simd,
            span,
            queue,
            ends_s: span.ends_s(),
            steps: 0,
            lanes: (0..Lanes::<S, V>::COUNT).map(|_| None).collect(),
            aboard: 0,
            turn: 0,
            results: Vec::new(),
            argument: like.argument(),
            expansion: Expansion::new(simd, &like.model, like.injection),
            guards: Guards::none(simd),
            step_s: splat(0.0),
            left_s: splat(f64::INFINITY),
            ends_of_modes: Vec::new(),
            stretch: [splat(1.0); K],
        };
        for lane in 0..Lanes::<S, V>::COUNT {
            if lane < most {
                flight.load_next(lane);
            } else {
                flight.set_numbers(lane, &Numbers::of_nobody());
            }
        }
        flight
    }

    /// Follows motions until none waits and none is aboard.
    #[inline(always)]
    pub fn run(mut self) -> Vec<Result<K>> {
        while self.aboard > 0 {
            self.step();
            if self.steps.is_multiple_of(STEPS_A_TURN) {
                self.take_turns();
            }
        }
        self.results
    }

    /// The last motions share the lanes by turns, so that none of them is left to go on alone at the end.
    #[inline(never)]
    fn take_turns(&mut self) {
        if !(1..=self.lanes.len()).contains(&self.queue.len()) {
            return;
        }
        self.turn = (self.turn + 1) % self.lanes.len();
        if let Some(motion) = self.take(self.turn) {
            self.queue.push(motion);
            self.load_next(self.turn);
        }
    }

    #[inline(always)]
    fn step(&mut self) {
        self.steps += 1;
        self.expansion.expand();
        let mut step_s = self.choose_step();
        if let Some(argument) = self.argument {
            self.find_ends_of_modes(argument, &mut step_s);
        }
        for component in 0..4 {
            if self.span.watched.turns[component] {
                self.watch_turns(component, &step_s);
            }
        }
        let mut next = [step_s; 4];
        for i in 0..4 {
            next[i] = value(&self.expansion.x[i], step_s);
        }
        if let Some((component, level)) = self.span.watched.section {
            self.watch_section(component, level, &step_s, &next);
        }
        for i in 0..4 {
            self.expansion.x[i][0] = next[i];
            for k in 0..K {
                let series = &mut self.expansion.tangents[k][i];
                series[0] = value(series, step_s);
            }
        }
        self.left_s = self.left_s - step_s;
        while let Some((lane, bound)) = self.ends_of_modes.pop() {
            self.change_mode(lane, bound, step_s.as_slice()[lane]);
        }
        self.keep_tangents_finite();
        self.end_what_has_ended();
    }

    /// The step of each lane: no longer than its last term is within the tolerance, nor than its piece.
    #[inline(always)]
    fn choose_step(&mut self) -> Lanes<S, V> {
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        let factor = SHRINK.powi(ORDER as i32);
        let tolerance = splat(self.span.tolerance);
        let last = greatest(&self.expansion.x, ORDER);
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

    /// Shortens the step of lanes whose friction mode ends within it.
    #[inline(always)]
    fn find_ends_of_modes(&mut self, argument: usize, step_s: &mut Lanes<S, V>) {
        let (x, force) = (
            &self.expansion.x[argument],
            self.expansion.forces.front_force(),
        );
        let room = self.guards.room(x, force, *step_s);
        if room.zero().all_less(room) {
            return;
        }
        let mut rest = room.at_most_zero();
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let most_s = &mut step_s.as_mut_slice()[lane];
            if let Some((instant_s, bound)) = self.guards.first_end(lane, x, force, *most_s) {
                *most_s = instant_s;
                self.ends_of_modes.push((lane, bound));
            }
        }
    }

    /// Notes the turning points of a component within the step.
    #[inline(always)]
    fn watch_turns(&mut self, component: usize, step_s: &Lanes<S, V>) {
        let x = &self.expansion.x[component];
        let mut rate = [Lanes::splat(self.simd, 0.0); ORDER + 1];
        for k in 0..ORDER {
            rate[k] = x[k + 1].scale((k + 1) as f64);
        }
        let clear =
            clearance(&rate, value(&rate, *step_s), *step_s) + Lanes::splat(self.simd, RATE_FLOOR);
        let bend = bend(&rate, *step_s);
        if bend.all_less(clear) {
            return;
        }
        for lane in 0..Lanes::<S, V>::COUNT {
            if bend.as_slice()[lane] < clear.as_slice()[lane] {
                continue;
            }
            let most_s = step_s.as_slice()[lane];
            let begin_s = self.time_s(lane);
            let path = of_lane(&self.expansion.x[component], lane);
            let tangent = match component {
                YAW_RATE => self.expansion.tangents.first(),
                _ => None,
            };
            let stretch = match self.stretch.first() {
                Some(stretch) => stretch.as_slice()[lane],
                None => 1.0,
            };
            let Some(motion) = &mut self.lanes[lane] else {
                continue;
            };
            roots::roots(&derivative(&path), most_s, |root_s, _| {
                let turn = roots::value(&path, root_s);
                motion.found.turns[component].push((begin_s + root_s, turn));
                motion.found.extend(component, turn);
                if let Some(tangent) = tangent {
                    let growth =
                        motion.growth_before + stretch.ln() + log_length(tangent, lane, root_s);
                    motion.found.growth_at_turns.push(growth);
                }
            });
        }
    }

    /// Notes the crossings of a component's level within the step.
    #[inline(always)]
    fn watch_section(
        &mut self,
        component: usize,
        level: f64,
        step_s: &Lanes<S, V>,
        next: &[Lanes<S, V>; 4],
    ) {
        let level_lanes = Lanes::splat(self.simd, level);
        let mut series = self.expansion.x[component];
        series[0] = series[0] - level_lanes;
        let clear = clearance(&series, next[component] - level_lanes, *step_s);
        let bend = bend(&series, *step_s);
        if bend.all_less(clear) {
            return;
        }
        for lane in 0..Lanes::<S, V>::COUNT {
            if bend.as_slice()[lane] < clear.as_slice()[lane] {
                continue;
            }
            let most_s = step_s.as_slice()[lane];
            let begin_s = self.time_s(lane);
            let height = of_lane(&series, lane);
            let x = &self.expansion.x;
            let Some(motion) = &mut self.lanes[lane] else {
                continue;
            };
            roots::roots(&height, most_s, |root_s, rising| {
                motion.found.crossings.push(Crossing {
                    time_s: begin_s + root_s,
                    x: x.each_ref()
                        .map(|series| roots::value(&of_lane(series, lane), root_s)),
                    rising,
                });
            });
        }
    }

    /// A lane's time from the start, s.
    fn time_s(&self, lane: usize) -> f64 {
        match &self.lanes[lane] {
            Some(motion) => self.ends_s[motion.piece] - self.left_s.as_slice()[lane],
            None => 0.0,
        }
    }

    fn state(&self, lane: usize) -> [f64; 4] {
        self.expansion.x.each_ref().map(|x| x[0].as_slice()[lane])
    }

    /// The mode of a lane ends, which `lasted_s` since the step began; the guard is at `bound`. Tangent vectors jump by the
    /// saltation matrix (M. di Bernardo et al., Piecewise-smooth Dynamical Systems, section 2.5): only the steering's
    /// acceleration jumps.
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
            let is_lower = bound == Guard::of(model, injection, from).lower;
            let beyond = if is_lower {
                bound.next_down()
            } else {
                bound.next_up()
            };
            x[argument] = beyond;
        }
        let mut to = next_mode(model, injection, from, &mut x);
        let torque_nm = model.driving_torque_nm(&x, injection).abs();
        let held_nm = model.friction_limit_nm() * (1.0 + RELEASE_MARGIN);
        if from != FrictionMode::Sticking && model.can_stick(injection) && torque_nm <= held_nm {
            to = FrictionMode::Sticking;
        }
        let before = model.derivative(&x, injection, from);
        let after = model.derivative(&x, injection, to);
        motion.mode = to;
        motion.found.events += 1;
        motion.short_modes = if lasted_s <= SHORT_MODE_S {
            motion.short_modes + 1
        } else {
            0
        };
        for i in 0..4 {
            motion.found.extend(i, x[i]);
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
    }

    /// Puts the numbers of a lane's mode into the vectors.
    fn load_mode(&mut self, lane: usize) {
        let Some(motion) = &self.lanes[lane] else {
            return;
        };
        let (model, injection) = (&motion.task.model, motion.task.injection);
        self.expansion.set_mode(lane, model, motion.mode);
        self.guards.set_lane(lane, model, injection, motion.mode);
    }

    /// Keeps a single tangent vector within the range of numbers; several at right angles and of length one, by Gram and Schmidt.
    #[inline(always)]
    fn keep_tangents_finite(&mut self) {
        if K == 0 {
            return;
        }
        if K == 1 {
            let vector = coefficients(&self.expansion.tangents[0], 0);
            let square = dot(&vector, &vector);
            let (least, most) = LENGTHS_SQUARED;
            let simd = self.simd;
            let splat = |number| Lanes::splat(simd, number);
            if !(splat(least).all_less(square) && square.all_less(splat(most))) {
                for lane in 0..Lanes::<S, V>::COUNT {
                    if !(least..most).contains(&square.as_slice()[lane]) {
                        self.count_growth(lane);
                    }
                }
            }
            return;
        }
        self.orthonormalise();
        let (least, most) = LENGTHS_SQUARED;
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        for k in 0..K {
            let stretch = self.stretch[k];
            if !(splat(least).all_less(stretch) && stretch.all_less(splat(most))) {
                for lane in 0..Lanes::<S, V>::COUNT {
                    if !(least..most).contains(&stretch.as_slice()[lane]) {
                        self.count_growth(lane);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn orthonormalise(&mut self) {
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        let tangents = &mut self.expansion.tangents;
        let mut units = [[splat(0.0); 4]; K];
        for k in 0..K {
            let mut vector = coefficients(&tangents[k], 0);
            let before = dot(&vector, &vector);
            for j in 0..k {
                let share = -dot(&vector, &units[j]);
                for i in 0..4 {
                    vector[i] = units[j][i].mul_add(share, vector[i]);
                }
            }
            let after = dot(&vector, &vector);
            let lost = before.scale(LOST_SQUARED);
            let length = lost.select_less(after, after.sqrt(), splat(0.0));
            let inverse = lost.select_less(after, splat(1.0).over(length), splat(0.0));
            self.stretch[k] = self.stretch[k] * length;
            for i in 0..4 {
                units[k][i] = vector[i] * inverse;
                tangents[k][i][0] = units[k][i];
            }
        }
    }

    /// Adds what a lane's tangent vectors have grown by to its growth, and goes on with unit vectors.
    #[inline(never)]
    fn count_growth(&mut self, lane: usize) {
        let Some(motion) = &mut self.lanes[lane] else {
            return;
        };
        if K == 1 {
            let x = &mut self.expansion.tangents[0];
            let square: f64 = x.iter().map(|x| x[0].as_slice()[lane].powi(2)).sum();
            let length = square.sqrt();
            motion.growth[0] += length.ln();
            motion.growth_before += length.ln();
            for x in x {
                x[0].as_mut_slice()[lane] /= length;
            }
            return;
        }
        motion.growth_before += self.stretch[0].as_slice()[lane].ln();
        for (growth, stretch) in motion.growth.iter_mut().zip(&mut self.stretch) {
            let stretch = &mut stretch.as_mut_slice()[lane];
            *growth += stretch.ln();
            *stretch = 1.0;
        }
    }

    /// Ends pieces and motions that are at their ends, and motions that leave all bounds.
    #[inline(always)]
    fn end_what_has_ended(&mut self) {
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        let room = splat(BOUND) - greatest(&self.expansion.x, 0);
        if splat(0.0).all_less(self.left_s.min(room)) {
            return;
        }
        for lane in 0..Lanes::<S, V>::COUNT {
            self.end_of_lane(lane);
        }
    }

    #[inline(never)]
    fn end_of_lane(&mut self, lane: usize) {
        let x = self.state(lane);
        let step_s = self.step_s.as_slice()[lane];
        let left_s = self.left_s.as_slice()[lane];
        let time_s = self.time_s(lane);
        let Some(motion) = &mut self.lanes[lane] else {
            return;
        };
        let bounded = x.iter().all(|value| value.abs() < BOUND);
        let slides = motion.short_modes > MOST_SHORT_MODES;
        if !bounded || step_s < SHORTEST_STEP_S || slides {
            motion.found.diverged = Some(Diverged { time_s });
            self.unload(lane);
        } else if left_s <= 0.0 {
            self.end_piece(lane);
        }
    }

    fn end_piece(&mut self, lane: usize) {
        if K > 0 {
            self.count_growth(lane);
        }
        let Some(motion) = &mut self.lanes[lane] else {
            return;
        };
        // The first piece is for the tangent vectors to turn into their directions.
        if motion.piece > 0 {
            motion.found.growths.push(motion.growth);
        }
        motion.growth = [0.0; K];
        if motion.piece + 1 == self.ends_s.len() {
            self.unload(lane);
            return;
        }
        motion.piece += 1;
        let length_s = self.ends_s[motion.piece] - self.ends_s[motion.piece - 1];
        self.left_s.as_mut_slice()[lane] = length_s;
    }

    /// Puts a motion's findings aside, and the next motion into its lane.
    fn unload(&mut self, lane: usize) {
        if let Some((mut motion, numbers)) = self.take(lane) {
            motion.found.end = State {
                x: numbers.x.into(),
                friction: motion.mode,
            };
            for (i, x) in numbers.x.into_iter().enumerate() {
                motion.found.extend(i, x);
            }
            self.results.push((motion.index, motion.found));
        }
        self.load_next(lane);
    }

    fn load_next(&mut self, lane: usize) {
        match self.queue.next() {
            Some(motion) => self.load(lane, motion),
            None => self.set_numbers(lane, &Numbers::of_nobody()),
        }
    }

    fn load(&mut self, lane: usize, (mut motion, numbers): Waiting<'a, K>) {
        self.set_numbers(lane, &numbers);
        let (model, injection) = (&motion.task.model, motion.task.injection);
        self.expansion.set_lane(lane, model, injection);
        motion.boarded = self.steps;
        self.lanes[lane] = Some(motion);
        self.aboard += 1;
        self.load_mode(lane);
    }

    /// Takes a motion out of its lane, which rests.
    fn take(&mut self, lane: usize) -> Option<Waiting<'a, K>> {
        let mut motion = self.lanes[lane].take()?;
        motion.found.steps += self.steps - motion.boarded;
        let numbers = Numbers {
            x: self.state(lane),
            tangents: self.expansion.tangents.each_ref().map(|tangent| {
                let coefficient = |x: &Series<S, V>| x[0].as_slice()[lane];
                tangent.each_ref().map(coefficient)
            }),
            stretch: self.stretch.map(|stretch| stretch.as_slice()[lane]),
            step_s: self.step_s.as_slice()[lane],
            left_s: self.left_s.as_slice()[lane],
        };
        self.aboard -= 1;
        self.expansion.free_lane(lane);
        self.guards.free_lane(lane);
        Some((motion, numbers))
    }

    fn set_numbers(&mut self, lane: usize, numbers: &Numbers<K>) {
        for i in 0..4 {
            self.expansion.x[i][0].as_mut_slice()[lane] = numbers.x[i];
            for k in 0..K {
                let component = &mut self.expansion.tangents[k][i][0];
                component.as_mut_slice()[lane] = numbers.tangents[k][i];
            }
        }
        for k in 0..K {
            self.stretch[k].as_mut_slice()[lane] = numbers.stretch[k];
        }
        self.step_s.as_mut_slice()[lane] = numbers.step_s;
        self.left_s.as_mut_slice()[lane] = numbers.left_s;
    }
}

/// Logarithm of the length of one lane's tangent vector, `t` from the step's beginning.
#[inline(always)]
fn log_length<S: Simd, const V: usize>(tangent: &[Series<S, V>; 4], lane: usize, t: f64) -> f64 {
    let mut square = 0.0;
    for series in tangent {
        square += roots::value(&of_lane(series, lane), t).powi(2);
    }
    0.5 * square.ln()
}

/// Bound on how far a polynomial is from its chord within (0, `t`).
#[inline(always)]
fn bend<S: Simd, const V: usize>(series: &Series<S, V>, t: Lanes<S, V>) -> Lanes<S, V> {
    let mut sum = series[ORDER].abs();
    for k in (2..ORDER).rev() {
        sum = sum.mul_add(t, series[k].abs());
    }
    sum * (t * t)
}

/// Distance from zero of a polynomial's chord over a step; negative where it changes sign.
#[inline(always)]
fn clearance<S: Simd, const V: usize>(
    series: &Series<S, V>,
    end: Lanes<S, V>,
    step_s: Lanes<S, V>,
) -> Lanes<S, V> {
    let zero = step_s.zero();
    let begin = series[0];
    let end = begin.select_less(zero, -end, end);
    begin.abs().min(end)
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

#[inline(always)]
fn dot<S: Simd, const V: usize>(a: &[Lanes<S, V>; 4], b: &[Lanes<S, V>; 4]) -> Lanes<S, V> {
    a[0].mul_add(b[0], a[1] * b[1]) + a[2].mul_add(b[2], a[3] * b[3])
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
