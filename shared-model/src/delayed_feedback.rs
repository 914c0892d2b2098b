//! Delayed feedback: holds an unstable periodic orbit by the difference of a signal to its own value a period
//! ago, which vanishes on the orbit.
//!
//! K. Pyragas, Physics Letters A 170 (1992) 421. With memory, past periods count with weights that fall by a
//! factor each: J. E. S. Socolar, D. W. Sukow, D. J. Gauthier, Physical Review E 50 (1994) 3245.

use crate::Real;

/// The last `N` values of a signal, one per tick.
#[derive(Debug, Clone, Copy, PartialEq)]
struct DelayLine<T, const N: usize> {
    values: [T; N],
    /// Place of the newest value.
    newest: usize,
    /// Values that are there.
    count: usize,
}

impl<T: Real, const N: usize> DelayLine<T, N> {
    /// No values yet.
    fn new() -> Self {
        Self {
            values: [T::zero(); N],
            newest: 0,
            count: 0,
        }
    }

    /// The signal at this tick; the oldest value is dropped.
    fn push(&mut self, value: T) {
        let next = self.newest + 1;
        self.newest = if next < N { next } else { 0 };
        if let Some(place) = self.values.get_mut(self.newest) {
            *place = value;
        }
        if self.count < N {
            self.count += 1;
        }
    }

    /// The value that was the newest `ticks` pushes ago, by linear interpolation between two; `None` where the
    /// line does not reach so far back yet, or at all.
    fn before(&self, ticks: T) -> Option<T> {
        let whole = ticks.to_u32();
        let share = ticks - T::from_u32(whole);
        let later = self.at(whole as usize)?;
        if share == T::zero() {
            return Some(later);
        }
        let earlier = self.at((whole as usize).checked_add(1)?)?;
        Some(later + share * (earlier - later))
    }

    fn at(&self, ticks: usize) -> Option<T> {
        if ticks >= self.count {
            return None;
        }
        let place = if ticks <= self.newest {
            self.newest - ticks
        } else {
            // Not underflowing: ticks < count <= N.
            (self.newest + N).checked_sub(ticks)?
        };
        self.values.get(place).copied()
    }
}

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

/// Greatest change of the delay by adaptation, as a share of itself at the start.
const MOST_ADAPTED: f64 = 0.1;

/// The feedback with its delay line of `N` ticks.
///
/// ```
/// use shared_model::delayed_feedback::{DelayedFeedback, Law};
/// let law = Law { gain: 3.0, delay_ticks: 4.0, memory: 0.0, limit_nm: 8.0, adaptation: 0.0 };
/// let mut feedback = DelayedFeedback::<f64, 8>::new(law);
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
    /// The present delay, ticks.
    delay_ticks: T,
}

impl<T: Real, const N: usize> DelayedFeedback<T, N> {
    /// The feedback before its first tick.
    pub fn new(law: Law<T>) -> Self {
        Self {
            law,
            line: DelayLine::new(),
            delay_ticks: law.delay_ticks,
        }
    }

    /// Begins again with the law's delay; the line keeps its values.
    pub fn restart(&mut self) {
        self.delay_ticks = self.law.delay_ticks;
    }

    /// The present delay, ticks: the law's, unless it adapts.
    pub fn delay_ticks(&self) -> T {
        self.delay_ticks
    }

    /// The torque at this tick with the signal's present value, N m: K (s(t - T) - y(t)), where s is the signal
    /// itself or, with memory R, (1 - R) y(t) + R s(t - T). Zero until the line reaches a delay back.
    pub fn run(&mut self, signal: T) -> T {
        let law = &self.law;
        // The newest value is that of the tick before.
        let newest = self.delay_ticks - T::one();
        let Some(delayed) = self.line.before(newest) else {
            self.line.push(signal);
            return T::zero();
        };
        let earlier = self.line.before(newest + T::one()).unwrap_or(delayed);
        // Down the slope of the squared difference over the delay.
        let step = law.adaptation * (delayed - signal) * (delayed - earlier);
        let range = T::from_f64(MOST_ADAPTED) * law.delay_ticks;
        let (least, greatest) = (law.delay_ticks - range, law.delay_ticks + range);
        let adapted = self.delay_ticks + step;
        if adapted > least && adapted < greatest {
            self.delay_ticks = adapted;
        }
        let torque_nm = law.gain * (delayed - signal);
        self.line
            .push((T::one() - law.memory) * signal + law.memory * delayed);
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
    fn a_line_interpolates_and_ends() {
        let mut line = DelayLine::<f64, 4>::new();
        assert_eq!(line.before(0.0), None);
        for k in 0..6 {
            line.push(f64::from(k));
        }
        for (ticks, expected) in [(0.0, 5.0), (1.0, 4.0), (1.25, 3.75), (3.0, 2.0)] {
            assert_eq!(line.before(ticks), Some(expected));
        }
        for ticks in [3.5, 4.0, 1e9, f64::INFINITY] {
            assert_eq!(line.before(ticks), None, "{ticks}");
        }
    }

    #[test]
    fn torque_is_limited_either_way_and_without_a_full_line_there_is_none() {
        let law = Law {
            gain: 10.0,
            delay_ticks: 2.0,
            memory: 0.0,
            limit_nm: 8.0,
            adaptation: 0.0,
        };
        let mut feedback = DelayedFeedback::<f32, 4>::new(Law {
            gain: 10.0,
            delay_ticks: 2.0,
            memory: 0.0,
            limit_nm: 8.0,
            adaptation: 0.0,
        });
        let torques: Vec<f32> = [0.0, 0.0, 1.0, -1.0, 1.5].map(|y| feedback.run(y)).into();
        assert_eq!(torques, [0.0, 0.0, -8.0, 8.0, -5.0]);
        // A delay that the line never reaches.
        let mut short = DelayedFeedback::<f64, 4>::new(Law {
            delay_ticks: 6.0,
            ..law
        });
        assert!((0..100).all(|k| short.run(f64::from(k)) == 0.0));
    }

    /// A sine of 50 ticks, with a delay that is 3 ticks too long.
    #[test]
    fn the_delay_adapts_to_the_period() {
        let mut feedback = DelayedFeedback::<f64, 64>::new(Law {
            gain: 1.0,
            delay_ticks: 53.0,
            memory: 0.0,
            limit_nm: 8.0,
            adaptation: 0.5,
        });
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
        let mut feedback = DelayedFeedback::<f64, 2>::new(law);
        feedback.run(4.0);
        feedback.run(0.0);
        // s = 0.5 * 0 + 0.5 * 4.
        assert_eq!(feedback.run(1.0), 2.0 - 1.0);
        // s = 0.5 * 1 + 0.5 * 2.
        assert_eq!(feedback.run(0.0), 1.5);
    }
}
