//! A quantity as a function of time.

use dynamics::words::Short;
use serde::Deserialize;

/// Linear interpolation between knots `[time (s), value]`; constant before the first and after the
/// last. Two knots at the same time are a step from the first value to the second.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Profile {
    knots: Vec<(f64, f64)>,
}

/// An invalid profile.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidProfile {
    /// It has no knots.
    #[error("no knots: must have at least one, [time (s), value]")]
    Empty,
    /// A time is not finite, or less than that of the preceding knot.
    #[error("knot {number} at {} s: must be a finite time, not before {} s", Short(*.time_s), Short(*.min_s))]
    Time {
        /// Number of the knot, from 1.
        number: usize,
        /// Its time, s.
        time_s: f64,
        /// Least allowed time, s.
        min_s: f64,
    },
    /// A value is not finite or not in the quantity's range.
    #[error("knot {number} = {}: must be a finite number from {} to {}", Short(*.value), Short(*.min), Short(*.max))]
    Value {
        /// Number of the knot, from 1.
        number: usize,
        /// Its value.
        value: f64,
        /// Least allowed value.
        min: f64,
        /// Greatest allowed value.
        max: f64,
    },
}

impl Profile {
    /// One value at all times.
    pub fn constant(value: f64) -> Self {
        Self {
            knots: vec![(0.0, value)],
        }
    }

    /// Replaces all knots by one value at all times.
    pub fn hold(&mut self, value: f64) {
        self.knots.clear();
        self.knots.push((0.0, value));
    }

    /// Checks that the times ascend from 0 or later, and that all values are from `min` to `max`.
    ///
    /// # Errors
    /// The first invalid knot.
    pub fn validate(&self, min: f64, max: f64) -> Result<(), InvalidProfile> {
        let mut min_s = 0.0;
        for (number, &(time_s, value)) in (1..).zip(&self.knots) {
            if !(time_s >= min_s && time_s.is_finite()) {
                return Err(InvalidProfile::Time {
                    number,
                    time_s,
                    min_s,
                });
            }
            // Rejects NaN too.
            if !(min..=max).contains(&value) {
                return Err(InvalidProfile::Value {
                    number,
                    value,
                    min,
                    max,
                });
            }
            min_s = time_s;
        }
        if self.knots.is_empty() {
            return Err(InvalidProfile::Empty);
        }
        Ok(())
    }

    /// The value at `time_s`; at a step, the value after it. NaN if the profile has no knots, which
    /// [`validate`](Self::validate) rejects.
    pub fn at(&self, time_s: f64) -> f64 {
        let next = self.knots.partition_point(|&(knot_s, _)| knot_s <= time_s);
        match (self.knots[..next].last(), self.knots.get(next)) {
            (Some(&(start_s, start)), Some(&(end_s, end))) => {
                start + (end - start) * (time_s - start_s) / (end_s - start_s)
            }
            (Some(&(_, value)), None) | (None, Some(&(_, value))) => value,
            (None, None) => f64::NAN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(knots: &[(f64, f64)]) -> Profile {
        Profile {
            knots: knots.to_vec(),
        }
    }

    #[test]
    fn lines_steps_and_ends() {
        let profile = profile(&[(1.0, 2.0), (3.0, 6.0), (3.0, -1.0), (4.0, -1.0)]);
        for (time_s, value) in [(0.0, 2.0), (1.0, 2.0), (2.5, 5.0), (3.0, -1.0), (9.0, -1.0)] {
            assert_eq!(profile.at(time_s), value, "at {time_s} s");
        }
    }

    #[test]
    fn refused_with_the_knot_and_its_bounds() {
        let message = |knots: &[(f64, f64)]| {
            let error = profile(knots).validate(0.0, 10.0);
            error.unwrap_err().to_string()
        };
        assert!(message(&[]).contains("no knots"));
        assert!(message(&[(-1.0, 0.0)]).contains("knot 1 at -1 s"));
        assert!(message(&[(2.0, 0.0), (1.0, 0.0)]).contains("not before 2 s"));
        assert!(message(&[(f64::INFINITY, 0.0)]).contains("knot 1 at inf s"));
        assert!(message(&[(0.0, 0.0), (1.0, 11.0)]).contains("knot 2 = 11"));
        assert!(message(&[(0.0, f64::NAN)]).contains("from 0 to 10"));
        assert_eq!(
            profile(&[(0.0, 0.0), (0.0, 10.0)]).validate(0.0, 10.0),
            Ok(())
        );
    }
}
