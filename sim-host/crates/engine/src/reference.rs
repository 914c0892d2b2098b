//! Reference integrator: the motion between friction events to a tolerance, and the events'
//! instants to 1e-12 s.
//!
//! Between events the right-hand side is smooth. There Gragg's modified midpoint rule is
//! extrapolated to high order (Bulirsch and Stoer; E. Hairer, S. P. Norsett, G. Wanner, Solving
//! Ordinary Differential Equations I, section II.9), each step being halved until two successive
//! orders agree. Where an event lies within a step, its instant is found by integrating
//! to trial instants, and the motion continues from there in the new mode. What the ECU's fixed step
//! makes of the same motion is compared against it.

use crate::events::{Guard, next_mode};
use measures::dual::Dual;
use measures::{EarlyEnd, Reason, is_bounded};
use nalgebra::Vector4;
use shared_model::dither::{Application, Injection};
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Scenario};

/// Columns of the extrapolation: order 12.
const COLUMNS: usize = 6;
/// Longest step, s: short against any motion of the vehicle, so that an event function has at most
/// one extremum in it.
const LONGEST_STEP_S: f64 = 0.01;
/// Shortest step, s; where even it does not meet the tolerance, rounding is all that is left.
const SHORTEST_STEP_S: f64 = 1e-7;
/// To this an event's instant is found, s.
pub(crate) const EVENT_TOLERANCE_S: f64 = 1e-12;
/// Most trial instants for one event; bisection alone would need 34.
const MOST_TRIALS: usize = 60;
/// Steps, events included, that a run may take: at once, and per second of motion. The motions of
/// the paper take some 150 per second.
const STEPS_AT_ONCE: f64 = 1e4;
const STEPS_PER_S: f64 = 1e5;
/// Tolerance of the solution that decides whether a motion diverges.
pub const DECISIVE_TOLERANCE: f64 = 1e-8;
/// By this much later it may diverge than the numerical solution, s.
pub const DECISIVE_MARGIN_S: f64 = 1.0;

/// Why a numerical solution of a motion left all bounds within `time_s` from `start`: the motion
/// itself does, or it stays bounded when it is integrated to a tolerance.
pub fn why_unbounded(
    model: &Model<f64>,
    injection: Injection<f64>,
    start: &State<f64>,
    time_s: f64,
) -> Reason {
    let mut reference = Reference::from_state(model, injection, start, DECISIVE_TOLERANCE);
    match reference.run(time_s + DECISIVE_MARGIN_S) {
        Err(end) if end.reason == Reason::Diverges => Reason::Diverges,
        _ => Reason::StepTooLong,
    }
}

/// A change of friction mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// When, s.
    pub time_s: f64,
    /// Mode before.
    pub from: FrictionMode,
    /// Mode behind.
    pub to: FrictionMode,
}

/// A motion of the averaged system under the reference integrator. The dither, if there is one, is
/// on from the start.
#[derive(Debug, Clone)]
pub struct Reference {
    model: Model<f64>,
    tangent_model: Model<Dual<1>>,
    injection: Injection<f64>,
    tolerance: f64,
    step_s: f64,
    time_s: f64,
    steps: usize,
    state: State<f64>,
    guard: Guard,
    events: Vec<Event>,
}

impl Reference {
    /// The motion of a scenario from its start; each smooth step is accurate to `tolerance` in
    /// every component.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<f64>, tolerance: f64) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
        let model = Model::new(&averaged);
        let injection = averaged.dither.injection(0.0);
        let start = model.initial_state(&averaged);
        Ok(Self::from_state(&model, injection, &start, tolerance))
    }

    /// The motion of a model from a state; each smooth step is accurate to `tolerance` in every
    /// component.
    pub fn from_state(
        model: &Model<f64>,
        injection: Injection<f64>,
        start: &State<f64>,
        tolerance: f64,
    ) -> Self {
        let friction = model.mode_at(&start.x, injection);
        Self {
            model: *model,
            tangent_model: model.map(&Dual::constant),
            injection,
            tolerance,
            step_s: LONGEST_STEP_S,
            time_s: 0.0,
            steps: 0,
            state: State { friction, ..*start },
            guard: Guard::of(model, injection, friction, &start.x),
            events: Vec::new(),
        }
    }

    /// Continues under another effect of the dither.
    pub fn set_injection(&mut self, injection: Injection<f64>) {
        if injection != self.injection {
            self.injection = injection;
            self.set_mode(self.model.mode_at(&self.state.x, injection));
        }
    }

    fn set_mode(&mut self, mode: FrictionMode) {
        self.state.friction = mode;
        self.guard = Guard::of(&self.model, self.injection, mode, &self.state.x);
    }

    /// The present state.
    pub fn state(&self) -> &State<f64> {
        &self.state
    }

    /// All changes of mode so far.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Continues for `span_s` seconds.
    ///
    /// # Errors
    /// If the motion diverges, or takes more steps or mode transitions than a motion of that length
    /// may. The present state is then the last one.
    pub fn run(&mut self, span_s: f64) -> Result<&State<f64>, EarlyEnd> {
        let end_s = self.time_s + span_s;
        // What rounding of the sum leaves is no step.
        while end_s - self.time_s > EVENT_TOLERANCE_S {
            interrupt::check();
            self.step(end_s - self.time_s);
            self.check_step()?;
        }
        self.time_s = end_s;
        Ok(&self.state)
    }

    fn check_step(&mut self) -> Result<(), EarlyEnd> {
        self.steps += 1;
        let early = |reason| EarlyEnd {
            time_s: self.time_s,
            reason,
        };
        if !is_bounded(&self.state.x) {
            return Err(early(Reason::Diverges));
        }
        if self.steps as f64 <= STEPS_AT_ONCE + STEPS_PER_S * self.time_s {
            return Ok(());
        }
        let chatters = 2 * self.events.len() > self.steps;
        Err(early(if chatters {
            Reason::Chattering
        } else {
            Reason::TooManySteps
        }))
    }

    /// One smooth step of at most `most_s`, or less if an event ends it.
    fn step(&mut self, most_s: f64) {
        let (step_s, end) = self.smooth_step(self.step_s.min(most_s));
        match self.first_event(step_s, &end) {
            None => {
                self.time_s += step_s;
                self.state.x = end;
            }
            Some(instant_s) => self.change_mode(instant_s),
        }
    }

    /// The longest step of at most `step_s` that meets the tolerance, and the state behind it.
    fn smooth_step(&mut self, mut step_s: f64) -> (f64, Vector4<f64>) {
        loop {
            let (end, error) = self.extrapolate(step_s);
            if error <= self.tolerance || step_s <= SHORTEST_STEP_S {
                self.step_s = (2.0 * step_s).min(LONGEST_STEP_S);
                return (step_s, end);
            }
            step_s *= 0.5;
        }
    }

    /// State a step on, and the difference of the two highest orders.
    fn extrapolate(&self, step_s: f64) -> (Vector4<f64>, f64) {
        let mut previous: Vec<Vector4<f64>> = Vec::with_capacity(COLUMNS);
        let mut error = f64::INFINITY;
        for row in 0..COLUMNS {
            let mut current = vec![self.midpoint(step_s, 2 * (row + 1))];
            for column in 0..row {
                let ratio = (row + 1) as f64 / (row - column) as f64;
                let correction = (current[column] - previous[column]) / (ratio * ratio - 1.0);
                current.push(current[column] + correction);
            }
            if row > 0 {
                error = (current[row] - current[row - 1]).amax();
            }
            previous = current;
        }
        (previous[COLUMNS - 1], error)
    }

    /// Gragg's modified midpoint rule with an even number of substeps: its error has even powers of
    /// the substep only.
    fn midpoint(&self, step_s: f64, substeps: usize) -> Vector4<f64> {
        let h = step_s / substeps as f64;
        let mut before = self.state.x;
        let mut at = before + self.slope(&before) * h;
        for _ in 1..substeps {
            let after = before + self.slope(&at) * (2.0 * h);
            before = at;
            at = after;
        }
        (before + at + self.slope(&at) * h) * 0.5
    }

    fn slope(&self, x: &Vector4<f64>) -> Vector4<f64> {
        self.model
            .derivative(x, self.injection, self.state.friction)
    }

    /// How far a state is within the bounds of the present mode, and the rate at which that changes
    /// along the motion. Infinite for a mode that never ends.
    fn margin_and_rate(&self, x: &Vector4<f64>) -> (f64, f64) {
        let along = x.zip_map(&self.slope(x), |value, slope| Dual::new(value, [slope]));
        let guarded: Dual<1> = match self.state.friction {
            FrictionMode::Sticking => self
                .tangent_model
                .driving_torque_nm(&along, self.injection.map(Dual::constant)),
            _ => along[self.model.friction_argument()],
        };
        let (value, rate) = (guarded.value, guarded.tangent[0]);
        let (above, below) = (value - self.guard.lower, self.guard.upper - value);
        if above < below {
            (above, rate)
        } else {
            (below, -rate)
        }
    }

    /// The first instant of a step, from its start, at which the present mode ends.
    fn first_event(&self, step_s: f64, end: &Vector4<f64>) -> Option<f64> {
        if self.guard.never_ends() {
            return None;
        }
        let (margin, rate) = self.margin_and_rate(end);
        if margin < 0.0 {
            return Some(self.root(step_s, |x| self.margin_and_rate(x).0));
        }
        // The margin may dip below zero and come back.
        let (_, first_rate) = self.margin_and_rate(&self.state.x);
        if first_rate < 0.0 && rate > 0.0 {
            let lowest_s = self.root(step_s, |x| -self.margin_and_rate(x).1);
            let (lowest, _) = self.extrapolate(lowest_s);
            if self.margin_and_rate(&lowest).0 < 0.0 {
                return Some(self.root(lowest_s, |x| self.margin_and_rate(x).0));
            }
        }
        None
    }

    /// Instant in a step at which `f` goes from positive to negative, by the Illinois form of
    /// regula falsi, and by bisection where that is slow.
    fn root(&self, step_s: f64, f: impl Fn(&Vector4<f64>) -> f64) -> f64 {
        let at = |instant_s: f64| f(&self.extrapolate(instant_s).0);
        let (mut low, mut high) = (0.0, step_s);
        let (mut f_low, mut f_high) = (f(&self.state.x).max(0.0), at(step_s));
        for trial in 0..MOST_TRIALS {
            if high - low <= EVENT_TOLERANCE_S {
                break;
            }
            let secant = low + (high - low) * f_low / (f_low - f_high);
            let inside = secant > low && secant < high && trial % 3 < 2;
            let middle = if inside { secant } else { 0.5 * (low + high) };
            let value = at(middle);
            if value < 0.0 {
                (high, f_high) = (middle, value);
                f_low *= 0.5;
            } else {
                (low, f_low) = (middle, value);
                f_high *= 0.5;
            }
        }
        high
    }

    fn change_mode(&mut self, instant_s: f64) {
        let (mut x, _) = self.extrapolate(instant_s);
        let from = self.state.friction;
        let to = next_mode(&self.model, self.injection, from, &mut x);
        self.time_s += instant_s;
        self.state.x = x;
        self.set_mode(to);
        self.step_s = LONGEST_STEP_S;
        let time_s = self.time_s;
        self.events.push(Event { time_s, from, to });
    }
}
