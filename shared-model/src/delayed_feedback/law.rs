//! The torque of a delayed feedback.

use super::line::DelayLine;
use crate::Real;
use crate::limit::within;

/// The law of a delayed feedback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law<T> {
    /// Weight of a period relative to the one after it, from 0 (Pyragas) to less than 1.
    pub memory: T,
    /// Greatest torque either way, N m.
    pub limit_nm: T,
    /// Rate at which the delay follows the slope of the squared difference, ticks per square of the signal's
    /// unit, while the torque is less than a quarter of the limit; 0 for a constant delay. A delay that is wrong by
    /// some ticks then becomes the period.
    pub adaptation: T,
}

/// Greatest change of the delay by adaptation, as a share of it.
pub(super) const MOST_ADAPTED: f64 = 0.1;

/// Torque below which the delay adapts, as a share of the limit: the great differences of the chaos before the capture
/// say nothing of the orbit's period.
const ADAPTS_BELOW: f64 = 0.25;

/// The feedback with its delay line of `N` values. Two are equal if all bits of their numbers are; the line is not
/// compared, as a difference in it is one of the torque once it is read.
///
/// ```
/// use shared_model::delayed_feedback::{DelayedFeedback, Law};
/// let law = Law { memory: 0.0, limit_nm: 8.0, adaptation: 0.0 };
/// let mut feedback = DelayedFeedback::<f64, 8>::new(law, 1);
/// // A signal of four ticks per period needs no torque once a period has passed.
/// let torques: Vec<f64> = (0..8).map(|k| feedback.run(f64::from(k % 4), 3.0, 4.0)).collect();
/// assert_eq!(torques, [0.0; 8]);
/// // One that is half a unit too great does: 3 (0 - 0.5).
/// assert_eq!(feedback.run(0.5, 3.0, 4.0), -1.5);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct DelayedFeedback<T: Real, const N: usize> {
    law: Law<T>,
    line: DelayLine<T, N>,
    /// What adaptation has added to the delay, ticks. Apart from it: the steps are less than the rounding of a delay in
    /// f32.
    adapted_ticks: T,
}

/// Without a branch per number: the channels of the ECU are compared in every control tick.
impl<T: Real, const N: usize> PartialEq for DelayedFeedback<T, N> {
    fn eq(&self, other: &Self) -> bool {
        let (law, others) = (&self.law, &other.law);
        let bits = law.memory.differing_bits(others.memory)
            | law.limit_nm.differing_bits(others.limit_nm)
            | law.adaptation.differing_bits(others.adaptation)
            | self.adapted_ticks.differing_bits(other.adapted_ticks);
        bits == 0
    }
}

impl<T: Real, const N: usize> DelayedFeedback<T, N> {
    /// The feedback before its first tick. Its line keeps the value of one tick in `spacing_ticks`, and
    /// interpolates between them.
    pub fn new(law: Law<T>, spacing_ticks: u32) -> Self {
        Self {
            law,
            line: DelayLine::new(spacing_ticks),
            adapted_ticks: T::zero(),
        }
    }

    /// Forgets what adaptation has added; the line keeps its values.
    pub fn restart(&mut self) {
        self.adapted_ticks = T::zero();
    }

    /// What adaptation has added to the delay, ticks.
    pub fn adapted_ticks(&self) -> T {
        self.adapted_ticks
    }

    /// A tick without torque: the line takes the signal.
    pub fn observe(&mut self, signal: T) {
        self.line.push(signal);
    }

    /// The torque at this tick with the signal's present value, N m: K (s(t - T) - y(t)), where s is the signal
    /// itself or, with memory R, (1 - R) y(t) + R s(t - T). Zero until the line reaches the delay back. The gain K is in
    /// N m s/rad for a rate and N m/rad for an angle; the delay T, at least one tick, is the orbit's period, and what
    /// adaptation has added comes on top.
    pub fn run(&mut self, signal: T, gain: T, delay_ticks: T) -> T {
        let law = &self.law;
        // The line's last push is that of the tick before.
        let Some(delayed) = self
            .line
            .before(delay_ticks + self.adapted_ticks - T::one())
        else {
            self.line.push(signal);
            return T::zero();
        };
        let difference = delayed.value - signal;
        let torque_nm = gain * difference;
        // Down the slope of the squared difference over the delay.
        let adapted_ticks = self.adapted_ticks + law.adaptation * difference * delayed.rate;
        let is_in_range = adapted_ticks.abs() < T::from_f64(MOST_ADAPTED) * delay_ticks;
        if is_in_range && torque_nm.abs() < T::from_f64(ADAPTS_BELOW) * law.limit_nm {
            self.adapted_ticks = adapted_ticks;
        }
        self.line
            .push((T::one() - law.memory) * signal + law.memory * delayed.value);
        within(torque_nm, (-law.limit_nm, law.limit_nm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: Law<f64> = Law {
        memory: 0.0,
        limit_nm: 8.0,
        adaptation: 0.0,
    };

    #[test]
    fn torque_is_limited_either_way_and_without_a_full_line_there_is_none() {
        let mut feedback = DelayedFeedback::<f64, 4>::new(LAW, 1);
        let torques = [0.0, 0.0, 1.0, -1.0, 1.5].map(|y| feedback.run(y, 10.0, 2.0));
        assert_eq!(torques, [0.0, 0.0, -8.0, 8.0, -5.0]);
        // A delay that the line never reaches.
        let mut short = DelayedFeedback::<f64, 4>::new(LAW, 1);
        assert!((0..100).all(|k| short.run(f64::from(k), 10.0, 6.0) == 0.0));
    }

    /// Also where the same bit of two of them differs.
    #[test]
    fn two_are_equal_if_their_numbers_are() {
        let one = DelayedFeedback::<f64, 4>::new(LAW, 1);
        let mut later = one;
        later.observe(1.0);
        assert!(one == later, "the line is found by the torque");
        let flip = |number: &mut f64| *number = f64::from_bits(number.to_bits() ^ 1);
        let places: [fn(&mut DelayedFeedback<f64, 4>) -> &mut f64; 4] = [
            |other| &mut other.law.memory,
            |other| &mut other.law.limit_nm,
            |other| &mut other.law.adaptation,
            |other| &mut other.adapted_ticks,
        ];
        for (k, place) in places.iter().enumerate() {
            let mut other = one;
            flip(place(&mut other));
            assert!(one != other, "{k}");
            for second in &places[k + 1..] {
                let mut both = other;
                flip(second(&mut both));
                assert!(one != both, "{k} and another");
            }
        }
    }

    /// A ramp has no period: the delay adapts up to its bound.
    #[test]
    fn the_delay_adapts_by_a_tenth_at_most() {
        let law = Law {
            adaptation: 0.01,
            limit_nm: 1e3,
            ..LAW
        };
        let mut feedback = DelayedFeedback::<f64, 64>::new(law, 1);
        for k in 0..1000 {
            feedback.run(f64::from(k), 1.0, 40.0);
        }
        let adapted_ticks = feedback.adapted_ticks();
        assert!((-4.0..-3.5).contains(&adapted_ticks), "{adapted_ticks}");
    }

    /// A sine of 50 ticks, with a delay that is 3 ticks too long.
    #[test]
    fn the_delay_adapts_to_the_period() {
        let law = Law {
            adaptation: 0.5,
            ..LAW
        };
        let mut feedback = DelayedFeedback::<f64, 64>::new(law, 1);
        let signal = |k: i32| libm::sin(f64::from(k) * core::f64::consts::TAU / 50.0);
        for k in 0..5000 {
            feedback.run(signal(k), 1.0, 53.0);
        }
        assert!((feedback.adapted_ticks() + 3.0).abs() < 0.01);
        assert!(feedback.run(signal(5000), 1.0, 53.0).abs() < 1e-3);
        feedback.restart();
        assert_eq!(feedback.adapted_ticks(), 0.0);
    }

    /// While the torque is a quarter of its limit or more the delay stays.
    #[test]
    fn the_delay_does_not_adapt_far_from_an_orbit() {
        let adapted = |limit_nm: f64| {
            let law = Law {
                adaptation: 0.05,
                limit_nm,
                ..LAW
            };
            let mut feedback = DelayedFeedback::<f64, 8>::new(law, 1);
            for k in 0..8 {
                feedback.run(f64::from(k), 1.0, 4.0);
            }
            feedback.adapted_ticks()
        };
        // The difference is -4 at each tick from the fifth on: a delay of no ticks would have none.
        assert_eq!(adapted(16.0), 0.0);
        assert!(adapted(16.1) < 0.0);
    }

    /// s(t) = (1 - R) (y(t) + R y(t - T) + R^2 y(t - 2 T) ...).
    #[test]
    fn memory_weighs_past_periods() {
        let law = Law { memory: 0.5, ..LAW };
        let mut feedback = DelayedFeedback::<f64, 2>::new(law, 1);
        feedback.run(4.0, 1.0, 1.0);
        feedback.run(0.0, 1.0, 1.0);
        // s = 0.5 * 0 + 0.5 * 4.
        assert_eq!(feedback.run(1.0, 1.0, 1.0), 2.0 - 1.0);
        // s = 0.5 * 1 + 0.5 * 2.
        assert_eq!(feedback.run(0.0, 1.0, 1.0), 1.5);
    }
}
