//! Reference integrator: the motion between friction events to a tolerance, and the events' instants to 1e-12 s.
//!
//! Between events the right-hand side is smooth. There Gragg's modified midpoint rule is extrapolated to high order
//! (Bulirsch and Stoer; E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, section II.9), each
//! step being halved until two successive orders agree. Where an event lies within a step, its instant is found by integrating
//! to trial instants, and the motion goes on from there in the new mode. What the ECU's fixed step makes of the same motion is
//! compared against it.

use crate::engine::dual::Dual;
use crate::engine::events::next_mode;
use nalgebra::Vector4;
use shared_model::dither::{Application, Injection};
use shared_model::friction::{FrictionMode, Sign};
use shared_model::vehicle::{Model, State};
use shared_model::{InvalidScenario, Scenario};

/// Columns of the extrapolation: order 12.
const COLUMNS: usize = 6;
/// Longest step, s: short against any motion of the vehicle, so that an event function has at most one extremum in it.
const LONGEST_STEP_S: f64 = 0.01;
/// Shortest step, s; where even it does not meet the tolerance, rounding is all that is left.
const SHORTEST_STEP_S: f64 = 1e-7;
/// To this an event's instant is found, s.
pub const EVENT_TOLERANCE_S: f64 = 1e-12;
/// Most trial instants for one event; bisection alone would need 34.
const MOST_TRIALS: usize = 60;

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

/// A motion of the averaged system under the reference integrator. The dither, if there is one, is on from the start.
#[derive(Debug, Clone)]
pub struct Reference {
    model: Model<f64>,
    tangent_model: Model<Dual<1>>,
    injection: Injection<f64>,
    tolerance: f64,
    step_s: f64,
    time_s: f64,
    state: State<f64>,
    events: Vec<Event>,
}

impl Reference {
    /// The motion of a scenario from its start; each smooth step is accurate to `tolerance` in every component.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<f64>, tolerance: f64) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
        let model = Model::new(&averaged);
        let injection = averaged.dither.injection(0.0);
        let mut state = model.initial_state(&averaged);
        state.friction = model.mode_at(&state.x, injection);
        Ok(Self {
            tangent_model: Model::new(&averaged.map(&Dual::constant)),
            injection,
            tolerance,
            step_s: LONGEST_STEP_S,
            time_s: 0.0,
            events: Vec::new(),
            state,
            model,
        })
    }

    /// The present state.
    pub fn state(&self) -> &State<f64> {
        &self.state
    }

    /// All changes of mode so far.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Goes on for `span_s` seconds.
    pub fn run(&mut self, span_s: f64) -> &State<f64> {
        let end_s = self.time_s + span_s;
        // What rounding of the sum leaves is no step.
        while end_s - self.time_s > EVENT_TOLERANCE_S {
            self.step(end_s - self.time_s);
        }
        self.time_s = end_s;
        &self.state
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

    /// Gragg's modified midpoint rule with an even number of substeps: its error has even powers of the substep only.
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

    /// Where the present mode ends: positive inside it. Infinite for a mode that never ends.
    fn margin<T: shared_model::Real>(
        model: &Model<T>,
        x: &Vector4<T>,
        injection: Injection<T>,
        mode: FrictionMode,
    ) -> T {
        let argument = x[model.friction_argument()];
        let least = |a: T, b: T| if a < b { a } else { b };
        match (mode, model.friction_sign(injection)) {
            (FrictionMode::Sticking, _) => {
                model.friction_limit_nm() - model.driving_torque_nm(x, injection).abs()
            }
            (FrictionMode::Positive, Sign::Stepped { upper, .. }) => argument - upper,
            (FrictionMode::Negative, Sign::Stepped { lower, .. }) => lower - argument,
            (FrictionMode::Neutral, Sign::Stepped { lower, upper }) if lower < upper => {
                least(argument - lower, upper - argument)
            }
            _ => T::from_f64(f64::INFINITY),
        }
    }

    /// The margin at a state, and its rate of change along the motion.
    fn margin_and_rate(&self, x: &Vector4<f64>) -> (f64, f64) {
        let along = x.zip_map(&self.slope(x), |value, slope| Dual::new(value, [slope]));
        let injection = self.injection.map(Dual::constant);
        let margin = Self::margin(&self.tangent_model, &along, injection, self.state.friction);
        (margin.value, margin.tangent[0])
    }

    /// The first instant of a step, from its start, at which the present mode ends.
    fn first_event(&self, step_s: f64, end: &Vector4<f64>) -> Option<f64> {
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

    /// Instant in a step at which `f` goes from positive to negative, by the Illinois form of regula falsi, and by bisection
    /// where that is slow.
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
        self.state = State { x, friction: to };
        self.step_s = LONGEST_STEP_S;
        let time_s = self.time_s;
        self.events.push(Event { time_s, from, to });
    }
}
