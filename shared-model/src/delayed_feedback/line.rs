//! The past of a signal.

use crate::Real;

/// A value of the past.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Past<T> {
    /// The value.
    pub value: T,
    /// Its rate of change, per tick.
    pub rate: T,
}

/// Every so many ticks a value of a signal, the last `N` of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct DelayLine<T, const N: usize> {
    values: [T; N],
    /// Place of the newest value.
    newest: usize,
    /// Values that are there.
    count: usize,
    /// Ticks from one value to the next.
    spacing_ticks: u32,
    /// Ticks since the newest value.
    age_ticks: u32,
}

/// Without the values: the ECU compares its channels in every control tick, and a value that differs is found
/// by the torque once it is read.
impl<T, const N: usize> PartialEq for DelayLine<T, N> {
    fn eq(&self, other: &Self) -> bool {
        self.newest == other.newest
            && self.count == other.count
            && self.spacing_ticks == other.spacing_ticks
            && self.age_ticks == other.age_ticks
    }
}

impl<T: Real, const N: usize> DelayLine<T, N> {
    /// No values yet; the first tick's will be kept, and then one in `spacing_ticks`, at least 1.
    pub fn new(spacing_ticks: u32) -> Self {
        Self {
            values: [T::zero(); N],
            newest: 0,
            count: 0,
            spacing_ticks: spacing_ticks.max(1),
            age_ticks: 0,
        }
    }

    /// The signal at this tick.
    pub fn push(&mut self, value: T) {
        self.age_ticks = self.age_ticks.saturating_add(1);
        if self.count > 0 && self.age_ticks < self.spacing_ticks {
            return;
        }
        self.age_ticks = 0;
        let next = self.newest + 1;
        self.newest = if next < N { next } else { 0 };
        if let Some(place) = self.values.get_mut(self.newest) {
            *place = value;
        }
        if self.count < N {
            self.count += 1;
        }
    }

    /// The value `ticks` before the last push, by a cubic through the four values around it; `None` where the
    /// line does not reach so far back yet, or at all, and at its ends unless it is one of its values.
    pub fn before(&self, ticks: T) -> Option<Past<T>> {
        let spacing = T::from_u32(self.spacing_ticks);
        let place = (ticks - T::from_u32(self.age_ticks)) / spacing;
        // False for NaN too.
        if !(place >= T::zero()) {
            return None;
        }
        let whole = place.to_u32();
        let share = place - T::from_u32(whole);
        let whole = whole as usize;
        let value = self.at(whole)?;
        let around = || {
            let later = self.at(whole.checked_sub(1)?)?;
            let earlier = self.at(whole.checked_add(1)?)?;
            Some([later, earlier, self.at(whole.checked_add(2)?)?])
        };
        match around() {
            Some([later, earlier, earliest]) => {
                let (value, slope) = cubic([later, value, earlier, earliest], share);
                Some(Past {
                    value,
                    rate: -slope / spacing,
                })
            }
            None if share == T::zero() => Some(Past {
                value,
                rate: T::zero(),
            }),
            None => None,
        }
    }

    fn at(&self, back: usize) -> Option<T> {
        if back >= self.count {
            return None;
        }
        let place = if back <= self.newest {
            self.newest - back
        } else {
            // Not underflowing: back < count <= N.
            (self.newest + N).checked_sub(back)?
        };
        self.values.get(place).copied()
    }
}

/// Value and slope at `x` of the cubic that has these values at -1, 0, 1 and 2; at 0 exactly the second.
fn cubic<T: Real>([a, b, c, d]: [T; 4], x: T) -> (T, T) {
    let (half, third, sixth) = (
        T::from_f64(0.5),
        T::from_f64(1.0 / 3.0),
        T::from_f64(1.0 / 6.0),
    );
    let first = c - third * a - half * b - sixth * d;
    let second = half * (a + c) - b;
    let third = half * (b - c) + sixth * (d - a);
    let value = ((third * x + second) * x + first) * x + b;
    let slope = (T::from_f64(3.0) * third * x + (second + second)) * x + first;
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values<const N: usize>(line: &DelayLine<f64, N>, ticks: f64) -> Option<f64> {
        line.before(ticks).map(|past| past.value)
    }

    #[test]
    fn a_line_interpolates_and_ends() {
        let mut line = DelayLine::<f64, 6>::new(1);
        assert_eq!(line.before(0.0), None);
        for k in 0..8 {
            line.push(f64::from(k));
        }
        for (ticks, expected) in [(0.0, 7.0), (1.0, 6.0), (1.25, 5.75), (3.5, 3.5), (5.0, 2.0)] {
            assert_eq!(values(&line, ticks), Some(expected));
        }
        for ticks in [0.5, 4.5, 6.0, 1e9, -1.0, f64::INFINITY, f64::NAN] {
            assert_eq!(line.before(ticks), None, "{ticks}");
        }
    }

    /// A cubic polynomial, from every fifth of its values, with its rate.
    #[test]
    fn a_cubic_is_exact_between_the_values_kept() {
        let signal = |tick: f64| (0.01 * tick - 1.0) * tick * tick + 3.0;
        let rate = |tick: f64| (0.03 * tick - 2.0) * tick;
        let mut line = DelayLine::<f64, 12>::new(5);
        for now in 0..100 {
            line.push(signal(f64::from(now)));
            for ticks in [10.0, 12.0, 23.75, 40.0] {
                let then = f64::from(now) - ticks;
                let Some(past) = line.before(ticks) else {
                    assert!(then < 10.0, "{now} {ticks}");
                    continue;
                };
                assert!((past.value - signal(then)).abs() < 1e-9);
                // At its end it has the value alone.
                assert!(then < 10.0 || (past.rate - rate(then)).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn lines_are_compared_by_their_places() {
        let mut line = DelayLine::<f64, 6>::new(2);
        line.push(1.0);
        let mut other = line;
        other.values[3] = 7.0;
        assert_eq!(line, other);
        other.push(1.0);
        assert_ne!(line, other);
        for other in [
            DelayLine { newest: 3, ..line },
            DelayLine { count: 3, ..line },
            DelayLine {
                spacing_ticks: 3,
                ..line
            },
            DelayLine {
                age_ticks: 3,
                ..line
            },
        ] {
            assert_ne!(line, other);
        }
    }
}
