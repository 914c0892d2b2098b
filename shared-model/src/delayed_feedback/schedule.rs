//! Periods of the orbits and gains that hold them, by wheel speed.

use super::law::MOST_ADAPTED;
use crate::Real;
use core::fmt;

/// Period and gain at a wheel speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning<T> {
    /// Period of the orbit, s.
    pub period_s: T,
    /// Gain K, N m s/rad.
    pub gain: T,
}

/// Periods and gains at equally spaced wheel speeds, between which they are interpolated. There is no orbit to
/// hold below the first and above the last, and they are those of one torque of the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitSchedule<T, const POINTS: usize> {
    /// Motor's current, A.
    pub motor_current_a: T,
    /// First wheel speed, rpm.
    pub first_rpm: T,
    /// From one wheel speed to the next, rpm; greater than 0.
    pub step_rpm: T,
    /// Period of the orbit at each wheel speed, s.
    pub periods_s: [T; POINTS],
    /// Gain K at each wheel speed, N m s/rad.
    pub gains: [T; POINTS],
}

impl<T: Real, const POINTS: usize> OrbitSchedule<T, POINTS> {
    /// Period and gain at a wheel speed; `None` below the first, above the last, and for NaN.
    ///
    /// ```
    /// use shared_model::delayed_feedback::{OrbitSchedule, Tuning};
    /// let schedule = OrbitSchedule {
    ///     motor_current_a: 10.0,
    ///     first_rpm: 1600.0,
    ///     step_rpm: 100.0,
    ///     periods_s: [1.5, 2.0],
    ///     gains: [4.0, 6.0],
    /// };
    /// assert_eq!(schedule.at(1650.0), Some(Tuning { period_s: 1.75, gain: 5.0 }));
    /// assert!(schedule.at(1700.0).is_some() && schedule.at(1700.1).is_none());
    /// assert!(schedule.at(1599.9).is_none() && schedule.at(f64::NAN).is_none());
    /// ```
    pub fn at(&self, wheel_speed_rpm: T) -> Option<Tuning<T>> {
        let place = (wheel_speed_rpm - self.first_rpm) / self.step_rpm;
        let last = POINTS.saturating_sub(1);
        // False for NaN too.
        if !(place >= T::zero() && place <= T::from_u32(last as u32)) {
            return None;
        }
        let whole = place.to_u32();
        let share = place - T::from_u32(whole);
        let slower = (whole as usize).min(last);
        // At the last speed itself there is no faster one, nor a share of it.
        let faster = (slower + 1).min(last);
        let between = |values: &[T; POINTS]| {
            let (slower, faster) = (*values.get(slower)?, *values.get(faster)?);
            Some(slower + share * (faster - slower))
        };
        Some(Tuning {
            period_s: between(&self.periods_s)?,
            gain: between(&self.gains)?,
        })
    }

    /// Last wheel speed, rpm.
    pub fn last_rpm(&self) -> T {
        self.first_rpm + self.step_rpm * T::from_u32(POINTS.saturating_sub(1) as u32)
    }

    /// Checks that there is a period and a gain at every wheel speed, and that a line of `line_s` reaches each
    /// period back, adapted too.
    ///
    /// # Errors
    /// The first number that is wrong.
    pub fn validate(&self, line_s: T) -> Result<(), InvalidOrbits> {
        // Each is false for NaN.
        if !(self.first_rpm > T::zero() && self.step_rpm > T::zero() && self.last_rpm().is_finite())
        {
            return Err(InvalidOrbits::Speeds);
        }
        let longest_s = line_s / T::from_f64(1.0 + MOST_ADAPTED);
        let mut wheel_speed_rpm = self.first_rpm;
        for (&period_s, &gain) in self.periods_s.iter().zip(&self.gains) {
            if !(period_s > T::zero() && period_s <= longest_s) {
                return Err(InvalidOrbits::Period {
                    wheel_speed_rpm: wheel_speed_rpm.to_f64(),
                    period_s: period_s.to_f64(),
                    longest_s: longest_s.to_f64(),
                });
            }
            if !(gain > T::zero() && gain.is_finite()) {
                return Err(InvalidOrbits::Gain {
                    wheel_speed_rpm: wheel_speed_rpm.to_f64(),
                    gain: gain.to_f64(),
                });
            }
            wheel_speed_rpm += self.step_rpm;
        }
        Ok(())
    }
}

/// Why a schedule is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InvalidOrbits {
    /// The wheel speeds are not ascending from above 0.
    Speeds,
    /// A period is not positive, or longer than the delay line with room for adaptation.
    Period {
        /// Wheel speed, rpm.
        wheel_speed_rpm: f64,
        /// The period, s.
        period_s: f64,
        /// Longest period, s.
        longest_s: f64,
    },
    /// A gain is not positive and finite.
    Gain {
        /// Wheel speed, rpm.
        wheel_speed_rpm: f64,
        /// The gain, N m s/rad.
        gain: f64,
    },
}

impl fmt::Display for InvalidOrbits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Speeds => write!(f, "the wheel speeds must ascend from above 0 rpm"),
            Self::Period {
                wheel_speed_rpm,
                period_s,
                longest_s,
            } => write!(
                f,
                "period {period_s} s at {wheel_speed_rpm} rpm: must be above 0 and at most {longest_s} s, for \
                 which the delay line has room"
            ),
            Self::Gain {
                wheel_speed_rpm,
                gain,
            } => write!(
                f,
                "gain {gain} N m s/rad at {wheel_speed_rpm} rpm: must be finite and above 0"
            ),
        }
    }
}

impl core::error::Error for InvalidOrbits {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    const GOOD: OrbitSchedule<f64, 3> = OrbitSchedule {
        motor_current_a: 10.0,
        first_rpm: 1600.0,
        step_rpm: 50.0,
        periods_s: [2.0; 3],
        gains: [5.0; 3],
    };

    #[test]
    fn it_is_linear_between_the_speeds_and_ends_with_them() {
        let rising = OrbitSchedule {
            periods_s: [1.0, 2.0, 4.0],
            gains: [8.0, 4.0, 3.0],
            ..GOOD
        };
        let at = |rpm: f64| rising.at(rpm).map(|tuning| (tuning.period_s, tuning.gain));
        for (rpm, wanted) in [
            (1599.9, None),
            (1600.0, Some((1.0, 8.0))),
            (1612.5, Some((1.25, 7.0))),
            (1650.0, Some((2.0, 4.0))),
            (1675.0, Some((3.0, 3.5))),
            (1700.0, Some((4.0, 3.0))),
            (1700.1, None),
            (-1650.0, None),
            (f64::NAN, None),
            (f64::INFINITY, None),
        ] {
            assert_eq!(at(rpm), wanted, "{rpm}");
        }
    }

    #[test]
    fn a_schedule_has_a_period_and_a_gain_at_every_speed() {
        assert_eq!(GOOD.validate(2.2 + 1e-9), Ok(()));
        assert_eq!(GOOD.last_rpm(), 1700.0);
        let with = |change: fn(&mut OrbitSchedule<f64, 3>)| {
            let mut schedule = GOOD;
            change(&mut schedule);
            schedule.validate(2.21).unwrap_err().to_string()
        };
        for change in [
            (|s| s.step_rpm = 0.0) as fn(&mut OrbitSchedule<f64, 3>),
            |s| s.step_rpm = -1.0,
            |s| s.step_rpm = f64::NAN,
            |s| s.first_rpm = 0.0,
            |s| s.first_rpm = f64::INFINITY,
        ] {
            assert!(with(change).contains("ascend"));
        }
        for (change, value) in [
            (
                (|s| s.periods_s[1] = 0.0) as fn(&mut OrbitSchedule<f64, 3>),
                "0 s",
            ),
            (|s| s.periods_s[1] = -2.0, "-2 s"),
            (|s| s.periods_s[1] = f64::NAN, "NaN s"),
            (|s| s.periods_s[1] = 2.1, "2.1 s"),
        ] {
            let said = with(change);
            assert!(
                said.starts_with(&std::format!("period {value} at 1650 rpm")),
                "{said}"
            );
        }
        for (change, value) in [
            (
                (|s| s.gains[2] = 0.0) as fn(&mut OrbitSchedule<f64, 3>),
                "0 N",
            ),
            (|s| s.gains[2] = -5.0, "-5 N"),
            (|s| s.gains[2] = f64::NAN, "NaN N"),
            (|s| s.gains[2] = f64::INFINITY, "inf N"),
        ] {
            let said = with(change);
            assert!(
                said.starts_with(&std::format!("gain {value} m s/rad at 1700 rpm")),
                "{said}"
            );
        }
    }
}
