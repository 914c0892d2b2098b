//! The torque of a delayed feedback.

use super::line::DelayLine;
use crate::Real;

/// The law of a delayed feedback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law<T> {
    /// Torque per difference of the signal: N m s/rad for a rate, N m/rad for an angle.
    pub gain: T,
    /// Delay in ticks, at least 1: the orbit's period.
    pub delay_ticks: T,
    /// Weight of a period relative to the one after it, from 0 (Pyragas) to less than 1.
    pub memory: T,
    /// Greatest torque either way, N m.
    pub limit_nm: T,
    /// Rate at which the delay follows the slope of the squared difference, ticks per square of the signal's
    /// unit; 0 for a delay that stays. A delay that is wrong by some ticks then becomes the period.
    pub adaptation: T,
}

/// Greatest change of the delay by adaptation, as a share of the law's.
pub(super) const MOST_ADAPTED: f64 = 0.1;

/// Torque below which the delay adapts, as a share of the limit: the great differences of the chaos before the capture
/// say nothing of the orbit's period.
const ADAPTS_BELOW: f64 = 0.25;

/// The feedback with its delay line of `N` values.
///
/// ```
/// use shared_model::delayed_feedback::{DelayedFeedback, Law};
/// let law = Law { gain: 3.0, delay_ticks: 4.0, memory: 0.0, limit_nm: 8.0, adaptation: 0.0 };
/// let mut feedback = DelayedFeedback::<f64, 8>::new(law, 1);
/// // A signal of four ticks per period needs no torque once a period has passed.
/// let torques: Vec<f64> = (0..8).map(|k| feedback.run(f64::from(k % 4))).collect();
/// assert_eq!(torques, [0.0; 8]);
/// // One that is half a unit too great does: 3 (0 - 0.5).
/// assert_eq!(feedback.run(0.5), -1.5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayedFeedback<T, const N: usize> {
    law: Law<T>,
    line: DelayLine<T, N>,
    /// What adaptation has added to the law's delay, ticks. Apart from it: the steps are less than the rounding
    /// of a delay in f32.
    adapted_ticks: T,
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

    /// Begins again with the law's delay; the line keeps its values.
    pub fn restart(&mut self) {
        self.adapted_ticks = T::zero();
    }

    /// Another gain and another delay, as at another wheel speed; what adaptation has added stays.
    pub fn tune(&mut self, gain: T, delay_ticks: T) {
        self.law.gain = gain;
        self.law.delay_ticks = delay_ticks;
    }

    /// The present delay, ticks: the law's, unless it adapts.
    pub fn delay_ticks(&self) -> T {
        self.law.delay_ticks + self.adapted_ticks
    }

    /// A tick without torque: the line takes the signal.
    pub fn observe(&mut self, signal: T) {
        self.line.push(signal);
    }

    /// The torque at this tick with the signal's present value, N m: K (s(t - T) - y(t)), where s is the signal
    /// itself or, with memory R, (1 - R) y(t) + R s(t - T). Zero until the line reaches a delay back.
    pub fn run(&mut self, signal: T) -> T {
        let law = &self.law;
        // The line's last push is that of the tick before.
        let Some(delayed) = self.line.before(self.delay_ticks() - T::one()) else {
            self.line.push(signal);
            return T::zero();
        };
        let difference = delayed.value - signal;
        let torque_nm = law.gain * difference;
        // Down the slope of the squared difference over the delay.
        let adapted_ticks = self.adapted_ticks + law.adaptation * difference * delayed.rate;
        let is_in_range = adapted_ticks.abs() < T::from_f64(MOST_ADAPTED) * law.delay_ticks;
        if is_in_range && torque_nm.abs() < T::from_f64(ADAPTS_BELOW) * law.limit_nm {
            self.adapted_ticks = adapted_ticks;
        }
        self.line
            .push((T::one() - law.memory) * signal + law.memory * delayed.value);
        if torque_nm > law.limit_nm {
            law.limit_nm
        } else if torque_nm < -law.limit_nm {
            -law.limit_nm
        } else {
            torque_nm
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn torque_is_limited_either_way_and_without_a_full_line_there_is_none() {
        let law = Law {
            gain: 10.0,
            delay_ticks: 2.0,
            memory: 0.0,
            limit_nm: 8.0,
            adaptation: 0.0,
        };
        let mut feedback = DelayedFeedback::<f32, 4>::new(
            Law {
                gain: 10.0,
                delay_ticks: 2.0,
                memory: 0.0,
                limit_nm: 8.0,
                adaptation: 0.0,
            },
            1,
        );
        let torques: Vec<f32> = [0.0, 0.0, 1.0, -1.0, 1.5].map(|y| feedback.run(y)).into();
        assert_eq!(torques, [0.0, 0.0, -8.0, 8.0, -5.0]);
        // A delay that the line never reaches.
        let mut short = DelayedFeedback::<f64, 4>::new(
            Law {
                delay_ticks: 6.0,
                ..law
            },
            1,
        );
        assert!((0..100).all(|k| short.run(f64::from(k)) == 0.0));
    }

    /// A sine of 50 ticks, with a delay that is 3 ticks too long.
    #[test]
    fn the_delay_adapts_to_the_period() {
        let mut feedback = DelayedFeedback::<f64, 64>::new(
            Law {
                gain: 1.0,
                delay_ticks: 53.0,
                memory: 0.0,
                limit_nm: 8.0,
                adaptation: 0.5,
            },
            1,
        );
        let signal = |k: i32| libm::sin(f64::from(k) * core::f64::consts::TAU / 50.0);
        for k in 0..5000 {
            feedback.run(signal(k));
        }
        assert!((feedback.delay_ticks() - 50.0).abs() < 0.01);
        assert!(feedback.run(signal(5000)).abs() < 1e-3);
    }

    /// s(t) = (1 - R) (y(t) + R y(t - T) + R^2 y(t - 2 T) ...).
    #[test]
    fn memory_weighs_past_periods() {
        let law = Law {
            gain: 1.0,
            delay_ticks: 1.0,
            memory: 0.5,
            limit_nm: 100.0,
            adaptation: 0.0,
        };
        let mut feedback = DelayedFeedback::<f64, 2>::new(law, 1);
        feedback.run(4.0);
        feedback.run(0.0);
        // s = 0.5 * 0 + 0.5 * 4.
        assert_eq!(feedback.run(1.0), 2.0 - 1.0);
        // s = 0.5 * 1 + 0.5 * 2.
        assert_eq!(feedback.run(0.0), 1.5);
    }
}
