//! The dither's schedule: the amplitude that suppresses the chaos, by wheel speed.
//!
//! The ECU carries one for each waveform, [`crate::schedule_table`], made by `sim-host schedule`.

use crate::Real;

/// Amplitudes of one waveform at equally spaced wheel speeds. Small and `Copy`: each channel of the
/// ECU holds its own in RAM. Two schedules are equal if all bits of their numbers are.
#[derive(Debug, Clone, Copy)]
pub struct Schedule<T: Real, const POINTS: usize> {
    /// First wheel speed, rpm. Below it the dither is off.
    pub first_rpm: T,
    /// From one wheel speed to the next, rpm; greater than 0.
    pub step_rpm: T,
    /// Amplitude W at each wheel speed, V; 0 where the motion needs no dither.
    pub amplitudes_v: [T; POINTS],
}

impl<T: Real, const POINTS: usize> Schedule<T, POINTS> {
    /// Greatest amplitude, V.
    pub fn peak_v(&self) -> T {
        let larger = |a: T, b: &T| if *b > a { *b } else { a };
        self.amplitudes_v.iter().fold(T::zero(), larger)
    }

    /// Least amplitude at a wheel speed and above, V.
    ///
    /// ```
    /// use shared_model::schedule::Schedule;
    /// let schedule = Schedule { first_rpm: 1500.0_f32, step_rpm: 50.0, amplitudes_v: [0.0, 0.12, 0.1] };
    /// assert_eq!(schedule.least_above_v(1499.0), 0.0);
    /// assert_eq!(schedule.least_above_v(1510.0), 0.1);
    /// ```
    pub fn least_above_v(&self, wheel_speed_rpm: T) -> T {
        let mut least_v = self.amplitude_v(wheel_speed_rpm);
        let mut speed_rpm = self.first_rpm;
        // Constant from each speed of the schedule to the next.
        for _ in &self.amplitudes_v {
            let amplitude_v = self.amplitude_v(speed_rpm);
            if speed_rpm > wheel_speed_rpm && amplitude_v < least_v {
                least_v = amplitude_v;
            }
            speed_rpm += self.step_rpm;
        }
        least_v
    }

    /// Amplitude for a wheel speed, V; see [`amplitude_v`].
    ///
    /// ```
    /// use shared_model::schedule::Schedule;
    /// let schedule = Schedule { first_rpm: 1500.0_f32, step_rpm: 50.0, amplitudes_v: [0.0, 0.1, 0.12] };
    /// assert_eq!(schedule.amplitude_v(1499.9), 0.0); // below the first: off
    /// assert_eq!(schedule.amplitude_v(1510.0), 0.1); // the larger of its two neighbours
    /// assert_eq!(schedule.amplitude_v(1900.0), 0.12); // above the last: the last
    /// ```
    pub fn amplitude_v(&self, wheel_speed_rpm: T) -> T {
        let Self {
            first_rpm,
            step_rpm,
            amplitudes_v,
        } = self;
        amplitude_v(*first_rpm, *step_rpm, amplitudes_v, wheel_speed_rpm)
    }

    /// The same schedule in another arithmetic.
    pub fn map<U: Real>(&self, f: &impl Fn(T) -> U) -> Schedule<U, POINTS> {
        Schedule {
            first_rpm: f(self.first_rpm),
            step_rpm: f(self.step_rpm),
            amplitudes_v: self.amplitudes_v.map(f),
        }
    }
}

/// Without a branch per number: the channels of the ECU are compared in every control tick.
impl<T: Real, const POINTS: usize> PartialEq for Schedule<T, POINTS> {
    fn eq(&self, other: &Self) -> bool {
        let speeds = self.first_rpm.differing_bits(other.first_rpm)
            | self.step_rpm.differing_bits(other.step_rpm);
        let amplitudes = self.amplitudes_v.iter().zip(&other.amplitudes_v);
        amplitudes.fold(speeds, |bits, (a, b)| bits | a.differing_bits(*b)) == 0
    }
}

/// Amplitude for a wheel speed, V, from amplitudes at equally spaced wheel speeds: the larger of
/// its two neighbours'.
///
/// Not interpolated: between a speed that needs no dither and one that does, a fraction of the
/// least amplitude would not suppress the chaos, and weak dither can turn period one into chaos. In
/// steps, only amplitudes are used that suppress it at the speeds on both sides.
///
/// Below the first speed 0: the motion is at rest or of period one. Above the last the last
/// amplitude, as switching the dither off where the chaos is worst would be more harmful; the
/// greatest speed of the vehicle is not decided here. A speed that is NaN or infinite gives 0.
/// Amplitudes are returned unchecked.
pub fn amplitude_v<T: Real>(
    first_rpm: T,
    step_rpm: T,
    amplitudes_v: &[T],
    wheel_speed_rpm: T,
) -> T {
    let place = (wheel_speed_rpm - first_rpm) / step_rpm;
    // Written so that NaN is off.
    if !(place >= T::zero() && wheel_speed_rpm.is_finite()) {
        return T::zero();
    }
    let below = place.to_u32() as usize;
    match amplitudes_v.get(below..) {
        Some([lower, upper, ..]) if upper > lower => *upper,
        Some([lower, ..]) => *lower,
        _ => amplitudes_v.last().copied().unwrap_or(T::zero()),
    }
}
