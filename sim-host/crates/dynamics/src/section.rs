//! A section of the state space, and its crossing within one step.

use crate::component::Component;
use nalgebra::Vector4;
use serde::Serialize;
use shared_model::dither::Injection;
use shared_model::vehicle::{Model, State};
use std::fmt;

/// In which sense the component passes the section's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Upwards.
    Rising,
    /// Downwards.
    Falling,
    /// Either.
    Both,
}

impl Direction {
    /// Whether it is that of a crossing upwards, or of one downwards.
    pub(crate) fn has(self, rising: bool) -> bool {
        match self {
            Self::Rising => rising,
            Self::Falling => !rising,
            Self::Both => true,
        }
    }
}

/// A section: a component at a value, passed in a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Section {
    /// The component.
    pub component: Component,
    /// Its value on the section, in the component's unit.
    pub value: f64,
    /// How it is passed.
    pub direction: Direction,
}

/// The section in words; a precision is that of its value.
impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let direction = match self.direction {
            Direction::Rising => "rising",
            Direction::Falling => "falling",
            Direction::Both => "either way",
        };
        let value = match f.precision() {
            Some(decimals) => format!("{:.decimals$}", self.value),
            None => self.value.to_string(),
        };
        let unit = self.component.unit;
        write!(f, "{} = {value} {unit}, {direction}", self.component)
    }
}

/// A crossing of the section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Time from the transient's end, s.
    pub time_s: f64,
    /// The state there.
    pub x: Vector4<f64>,
    /// Upwards, not downwards.
    pub rising: bool,
}

/// One step of a motion.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// State before it.
    pub start: State<f64>,
    /// State after it.
    pub end: State<f64>,
    /// Its length, s.
    pub step_s: f64,
    /// What the dither does during it.
    pub injection: Injection<f64>,
}

impl Step {
    /// The crossing of the section within the step, if there is one; its time is that from the
    /// step's start.
    pub fn crossing(&self, model: &Model<f64>, section: &Section) -> Option<Crossing> {
        let index = section.component.index;
        let (before, after) = (
            self.start.x[index] - section.value,
            self.end.x[index] - section.value,
        );
        let rising = before < 0.0 && after >= 0.0;
        let falling = before > 0.0 && after <= 0.0;
        if !(rising || falling) || !section.direction.has(rising) {
            return None;
        }
        let slope = |state: &State<f64>| {
            model.derivative(&state.x, self.injection, state.friction) * self.step_s
        };
        let (first, last) = (slope(&self.start), slope(&self.end));
        let at = |share: f64| hermite(&self.start.x, &first, &self.end.x, &last, share);
        // Bisection: the signs at the ends differ, and sixty halvings leave nothing of the step.
        let (mut near, mut far) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (near + far);
            let beyond = (at(middle)[index] - section.value) * before <= 0.0;
            if beyond {
                far = middle;
            } else {
                near = middle;
            }
        }
        Some(Crossing {
            time_s: far * self.step_s,
            x: at(far),
            rising,
        })
    }
}

/// The cubic with the given values and derivatives (times the step) at shares 0 and 1 of a step.
fn hermite(
    start: &Vector4<f64>,
    first: &Vector4<f64>,
    end: &Vector4<f64>,
    last: &Vector4<f64>,
    share: f64,
) -> Vector4<f64> {
    let rest = 1.0 - share;
    start * (rest * rest * (1.0 + 2.0 * share))
        + first * (rest * rest * share)
        + end * (share * share * (1.0 + 2.0 * rest))
        - last * (share * share * rest)
}
