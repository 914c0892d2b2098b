//! Maxima of a sampled quantity found while the motion runs, so that long runs need no room for
//! their states.

use crate::period::{AT_REST_RAD_PER_S, maxima_of_turns};

/// Collects the turning points of a quantity from its samples: two a cycle, whatever the step.
///
/// A turning point counts at once if the quantity moves away from it by 1e-6;
/// [`maxima`](Self::maxima) then keeps those that stand out by a hundredth of the range, which is
/// known only at the end. The result is that of [`yaw_rate_maxima`](crate::period::yaw_rate_maxima)
/// on the recorded motion.
#[derive(Debug, Clone, Default)]
pub struct Extrema {
    /// Time (s) and height of each turning point; the first is a minimum, then they alternate.
    turns: Vec<(f64, f64)>,
    rising: bool,
    /// The furthest sample in the present direction, with its neighbours.
    extreme: Sample,
    previous: Option<f64>,
    low: f64,
    high: f64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sample {
    time_s: f64,
    step_s: f64,
    left: f64,
    value: f64,
    right: Option<f64>,
}

impl Sample {
    /// Time and height of the parabola's vertex through the sample and its neighbours; its error is
    /// of third order.
    fn vertex(&self) -> (f64, f64) {
        let Some(right) = self.right else {
            return (self.time_s, self.value);
        };
        let curvature = self.left - 2.0 * self.value + right;
        if curvature == 0.0 {
            return (self.time_s, self.value);
        }
        let offset = 0.5 * (self.left - right) / curvature;
        let height = self.value - 0.25 * (self.left - right) * offset;
        (self.time_s + offset * self.step_s, height)
    }
}

impl Extrema {
    /// Takes the next sample, at `time_s`, one step of `step_s` behind the last.
    pub fn push(&mut self, time_s: f64, step_s: f64, value: f64) {
        let sample = Sample {
            time_s,
            step_s,
            left: self.previous.unwrap_or(value),
            value,
            right: None,
        };
        if self.previous.replace(value).is_none() {
            (self.extreme, self.low, self.high) = (sample, value, value);
            return;
        }
        self.low = self.low.min(value);
        self.high = self.high.max(value);
        self.extreme.right.get_or_insert(value);
        let away = value - self.extreme.value;
        if away != 0.0 && (away > 0.0) == self.rising {
            self.extreme = sample;
        } else if away.abs() > AT_REST_RAD_PER_S {
            self.turns.push(self.extreme.vertex());
            self.rising = !self.rising;
            self.extreme = sample;
        }
    }

    /// Greatest value less the least.
    pub fn range(&self) -> f64 {
        self.high - self.low
    }

    /// Time (s) and height of each turning point so far.
    pub fn turns(&self) -> &[(f64, f64)] {
        &self.turns
    }

    /// Time (s) and height of the maxima that stand out by a hundredth of the range.
    pub fn maxima(&self) -> Vec<(f64, f64)> {
        let end = (self.extreme.time_s, self.extreme.value);
        let turns: Vec<_> = self.turns.iter().copied().chain([end]).collect();
        maxima_of_turns(&turns, self.range())
    }
}
