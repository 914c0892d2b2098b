//! The steps: many motions in lanes, each with its own time.

use super::expansion::{Expansion, ORDER, Series, System, value};
use super::lanes::Lanes;
use super::motion::{Crossing, Found, Span, Task};
use super::roots::{self, derivative};
use crate::engine::events::{Guard, next_mode};
use crate::motion::Diverged;
use crate::trace::BOUND;
use nalgebra::Vector4;
use pulp::Simd;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{STEERING_RATE, State};

/// Longest step, s.
const LONGEST_STEP_S: f64 = 0.2;
/// A motion that needs a step shorter than this leaves all bounds, s.
const SHORTEST_STEP_S: f64 = 1e-9;
/// Factor by which a step shrinks until it meets the tolerance, and its inverse by which it grows where that would have met it.
const SHRINK: f64 = 0.92;
/// Factors tried before a step is given up.
const MOST_SHRINKS: usize = 300;
/// A rate of change below this (in the component's unit a second) is rounding, which has turning points of its own.
const RATE_FLOOR: f64 = 1e-13;
/// Least time between two changes of mode, s: an end sooner than that is rounding of the torque at its limit.
const SHORTEST_MODE_S: f64 = 1e-9;
/// A mode shorter than this, s, is one of a row in which a motion slides along a step of its friction law, and so many of them are
/// one too many.
const SHORT_MODE_S: f64 = 1e-6;
const MOST_SHORT_MODES: usize = 1000;
/// Share of the friction limit by which the torque must exceed it before the steering leaves rest. At rest right at the limit
/// rounding would otherwise release it and stop it for ever.
const RELEASE_MARGIN: f64 = 1e-10;
/// Lengths of a tangent vector, squared, that leave room for a step's growth.
const LENGTHS_SQUARED: (f64, f64) = (1e-200, 1e200);
/// A tangent vector is lost when orthogonalisation leaves less than this share of it, squared.
const LOST_SQUARED: f64 = 1e-24;

/// One motion in its lane.
struct Lane<'a, const K: usize> {
    task: &'a Task,
    /// Index of the task.
    index: usize,
    /// Steps of the flight before it.
    steps_before: usize,
    mode: FrictionMode,
    /// Changes of mode in a row that came too soon.
    short_modes: usize,
    /// Index of the piece that it is in.
    piece: usize,
    /// Logarithms of the tangent vectors' growth since the piece began.
    growth: [f64; K],
    found: Found<K>,
}

/// Motions on their way.
pub(super) struct Flight<'a, S: Simd, const V: usize, const K: usize> {
    simd: S,
    span: &'a Span,
    tasks: &'a [Task],
    /// Ends of the pieces, s from the start.
    ends_s: Vec<f64>,
    next_task: usize,
    steps: usize,
    lanes: Vec<Option<Lane<'a, K>>>,
    results: Vec<Option<Found<K>>>,
    /// Index of the friction law's argument in a state, if a mode can end at all.
    argument: Option<usize>,
    system: System<Lanes<S, V>>,
    expansion: Expansion<S, V, K>,
    guard: GuardLanes<Lanes<S, V>>,
    /// The step that the tolerance allows, s.
    step_s: Lanes<S, V>,
    /// What is left of the piece, s; infinite in an empty lane.
    left_s: Lanes<S, V>,
    /// Lanes whose friction mode ends in the present step, each with the bound that ends it.
    ends_of_modes: Vec<(usize, f64)>,
    /// Lengths that tangent vectors had when they were made unit vectors, multiplied up.
    stretch: [Lanes<S, V>; K],
}

/// [`Guard`]s in lanes, of the quantity `argument + per_force * F_f`.
struct GuardLanes<L> {
    lower: L,
    upper: L,
    /// Minus the trail while sticking, else 0.
    per_force: L,
}

impl<'a, S: Simd, const V: usize, const K: usize> Flight<'a, S, V, K> {
    /// Motions at their starts, all with the same friction argument.
    pub fn new(simd: S, tasks: &'a [Task], span: &'a Span) -> Self {
        let splat = |number| Lanes::splat(simd, number);
        let mut flight = Self {
            simd,
            span,
            tasks,
            ends_s: span.ends_s(),
            next_task: 0,
            steps: 0,
            lanes: Vec::new(),
            results: tasks.iter().map(|_| None).collect(),
            argument: tasks.first().and_then(Task::argument),
            system: System::still(simd),
            expansion: Expansion::new(simd),
            guard: GuardLanes {
                lower: splat(f64::NEG_INFINITY),
                upper: splat(f64::INFINITY),
                per_force: splat(0.0),
            },
            step_s: splat(0.0),
            left_s: splat(f64::INFINITY),
            ends_of_modes: Vec::new(),
            stretch: [splat(1.0); K],
        };
        for lane in 0..Lanes::<S, V>::COUNT {
            flight.lanes.push(None);
            flight.load_next(lane);
        }
        flight
    }

    /// Follows all motions to their ends.
    #[inline(always)]
    pub fn run(mut self) -> Vec<Found<K>> {
        while self.lanes.iter().any(Option::is_some) {
            self.step();
        }
        let results = self.results.into_iter();
        results
            .map(|found| found.expect("every motion ends"))
            .collect()
    }

    #[inline(always)]
    fn step(&mut self) {
        self.steps += 1;
        self.expansion.expand(&self.system);
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
                let series = &mut self.expansion.tangents[k].x[i];
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
        let last = greatest(&self.expansion, ORDER);
        let mut step_s = self.step_s;
        let mut error = last * power(step_s);
        for _ in 0..MOST_SHRINKS {
            if error.all_less(tolerance) {
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
        let (x, force) = (&self.expansion.x[argument], self.expansion.front_force());
        let guard = &self.guard;
        let mut series = *x;
        for k in 0..ORDER {
            series[k] = guard.per_force.mul_add(force[k], x[k]);
        }
        let (begin, end) = (series[0], value(&series, *step_s));
        let lowest = begin.min(end) - guard.lower;
        let highest = guard.upper - begin.max(end);
        let least = lowest.min(highest);
        let bend = bend(&series, *step_s);
        if bend.all_less(least) {
            return;
        }
        for lane in 0..Lanes::<S, V>::COUNT {
            if bend.as_slice()[lane] < least.as_slice()[lane] || self.lanes[lane].is_none() {
                continue;
            }
            let polynomial = series.each_ref().map(|c| c.as_slice()[lane]);
            let bounds = [guard.lower, guard.upper].map(|bound| bound.as_slice()[lane]);
            let most_s = step_s.as_slice()[lane];
            if let Some((instant_s, bound)) = first_end(&polynomial, bounds, most_s) {
                step_s.as_mut_slice()[lane] = instant_s;
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
            let series = self.expansion.x[component].each_ref();
            let polynomial = series.map(|c| c.as_slice()[lane]);
            let Some(lane) = &mut self.lanes[lane] else {
                continue;
            };
            roots::roots(&derivative(&polynomial), most_s, |root_s| {
                let turn = roots::value(&polynomial, root_s);
                lane.found.turns[component].push((begin_s + root_s, turn));
                lane.found.extend(component, turn);
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
            let polynomial = series.each_ref().map(|c| c.as_slice()[lane]);
            let slope = derivative(&polynomial);
            let x = &self.expansion.x;
            let at =
                |i: usize, t: f64| roots::value(&x[i].each_ref().map(|c| c.as_slice()[lane]), t);
            let Some(lane) = &mut self.lanes[lane] else {
                continue;
            };
            roots::roots(&polynomial, most_s, |root_s| {
                lane.found.crossings.push(Crossing {
                    time_s: begin_s + root_s,
                    x: std::array::from_fn(|i| at(i, root_s)),
                    rising: roots::value(&slope, root_s) > 0.0,
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
            let along = tangent.x[argument][0].as_slice()[lane];
            let rate = &mut tangent.x[STEERING_RATE][0].as_mut_slice()[lane];
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
        let system = System::new(model, injection, motion.mode);
        self.system
            .set_lane(lane, system.expect("every task was checked"));
        let guard = Guard::of(model, injection, motion.mode);
        let constants = model.constants();
        // While sticking the guard is the driving torque, whose constant goes over to the bounds.
        let (per_force, shift, wider) = match motion.mode {
            FrictionMode::Sticking => (
                -constants.trail_m,
                constants.motor_torque_nm,
                1.0 + RELEASE_MARGIN,
            ),
            _ => (0.0, 0.0, 1.0),
        };
        self.guard.per_force.as_mut_slice()[lane] = per_force;
        self.guard.lower.as_mut_slice()[lane] = guard.lower * wider - shift;
        self.guard.upper.as_mut_slice()[lane] = guard.upper * wider - shift;
    }

    /// Keeps a single tangent vector within the range of numbers; several at right angles and of length one, by Gram and Schmidt.
    #[inline(always)]
    fn keep_tangents_finite(&mut self) {
        if K == 0 {
            return;
        }
        if K == 1 {
            let vector = coefficients(&self.expansion.tangents[0].x, 0);
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
            let mut vector = coefficients(&tangents[k].x, 0);
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
                tangents[k].x[i][0] = units[k][i];
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
            let x = &mut self.expansion.tangents[0].x;
            let square: f64 = x.iter().map(|x| x[0].as_slice()[lane].powi(2)).sum();
            let length = square.sqrt();
            motion.growth[0] += length.ln();
            for x in x {
                x[0].as_mut_slice()[lane] /= length;
            }
            return;
        }
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
        let room = splat(BOUND) - greatest(&self.expansion, 0);
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
        let x = self.state(lane);
        if let Some(mut motion) = self.lanes[lane].take() {
            motion.found.steps = self.steps - motion.steps_before;
            motion.found.end = State {
                x: x.into(),
                friction: motion.mode,
            };
            for (i, x) in x.into_iter().enumerate() {
                motion.found.extend(i, x);
            }
            self.results[motion.index] = Some(motion.found);
        }
        self.load_next(lane);
    }

    fn load_next(&mut self, lane: usize) {
        self.system.set_lane(lane, System::STILL);
        self.guard.lower.as_mut_slice()[lane] = f64::NEG_INFINITY;
        self.guard.upper.as_mut_slice()[lane] = f64::INFINITY;
        self.guard.per_force.as_mut_slice()[lane] = 0.0;
        let task = self.tasks.get(self.next_task);
        let start = task.map_or([0.0; 4], |task| task.start.x.into());
        for i in 0..4 {
            self.expansion.x[i][0].as_mut_slice()[lane] = start[i];
            for (k, tangent) in self.expansion.tangents.iter_mut().enumerate() {
                // Linearly independent, and none along an axis, which may be invariant; a steering that sticks has no rate.
                let sticks = task.is_some_and(|t| t.start.friction == FrictionMode::Sticking);
                let part = match i {
                    STEERING_RATE if sticks => 0.0,
                    _ if i == k => 1.5,
                    _ => 0.5,
                };
                tangent.x[i][0].as_mut_slice()[lane] = part;
            }
        }
        for stretch in &mut self.stretch {
            stretch.as_mut_slice()[lane] = 1.0;
        }
        let (step_s, left_s) = match task {
            Some(_) => (LONGEST_STEP_S, self.ends_s[0]),
            None => (0.0, f64::INFINITY),
        };
        self.step_s.as_mut_slice()[lane] = step_s;
        self.left_s.as_mut_slice()[lane] = left_s;
        self.lanes[lane] = task.map(|task| Lane {
            task,
            index: self.next_task,
            steps_before: self.steps,
            mode: task.start.friction,
            short_modes: 0,
            piece: 0,
            growth: [0.0; K],
            found: Found::at(&task.start),
        });
        self.next_task += 1;
        self.load_mode(lane);
    }
}

/// The first instant within `most_s` at which a quantity leaves its bounds, and the bound.
#[inline(never)]
fn first_end(
    polynomial: &[f64; ORDER + 1],
    [lower, upper]: [f64; 2],
    most_s: f64,
) -> Option<(f64, f64)> {
    let above = |bound: f64| {
        let mut room = *polynomial;
        room[0] -= bound;
        room
    };
    let ends = [(lower, above(lower)), (upper, above(upper).map(|c| -c))];
    let mut first: Option<(f64, f64)> = None;
    for (bound, room) in ends {
        if !bound.is_finite() {
            continue;
        }
        let until = first.map_or(most_s, |(instant_s, _)| instant_s);
        if let Some(instant_s) = first_fall(room, until) {
            first = Some((instant_s, bound));
        }
    }
    first
}

/// The first instant in (0, `most_s`] at which a polynomial goes from positive to negative; one that begins at zero counts from the
/// shortest time of a mode on.
fn first_fall(mut room: [f64; ORDER + 1], most_s: f64) -> Option<f64> {
    let soon_s = SHORTEST_MODE_S.min(most_s);
    if room[0] == 0.0 {
        // On the bound: the root at the beginning is the last change of mode.
        room.rotate_left(1);
    }
    if roots::value(&room, soon_s) < 0.0 {
        return Some(soon_s);
    }
    let slope = derivative(&room);
    let mut first = None;
    roots::roots(&room, most_s, |root_s| {
        if root_s > soon_s && roots::value(&slope, root_s) < 0.0 {
            first.get_or_insert(root_s);
        }
    });
    first
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
fn greatest<S: Simd, const V: usize, const K: usize>(
    expansion: &Expansion<S, V, K>,
    n: usize,
) -> Lanes<S, V> {
    let [a, b, c, d] = coefficients(&expansion.x, n);
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
