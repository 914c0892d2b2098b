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

/// The last `N` values of a signal, one every `spacing_ticks`.
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
        // Less than the spacing before.
        self.age_ticks = self.age_ticks.wrapping_add(1);
        if self.count > 0 && self.age_ticks < self.spacing_ticks {
            return;
        }
        self.age_ticks = 0;
        self.newest = after::<N>(self.newest);
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
        let is_past = place >= T::zero();
        if !is_past {
            return None;
        }
        let whole = place.to_u32();
        let share = place - T::from_u32(whole);
        let whole = whole as usize;
        if whole >= self.count {
            return None;
        }
        let middle = self.place(whole);
        let value = self.at(middle)?;
        let around = || {
            if whole == 0 || self.count - whole <= 2 {
                return None;
            }
            let earlier = before::<N>(middle);
            let earliest = before::<N>(earlier);
            let later = after::<N>(middle);
            Some([self.at(later)?, self.at(earlier)?, self.at(earliest)?])
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

    /// Place of the value that number of values before the newest, of those that are there.
    fn place(&self, back: usize) -> usize {
        let place = self.newest.wrapping_sub(back);
        if back <= self.newest {
            place
        } else {
            place.wrapping_add(N)
        }
    }

    fn at(&self, place: usize) -> Option<T> {
        self.values.get(place).copied()
    }
}

/// The place of the next value.
fn after<const N: usize>(place: usize) -> usize {
    let next = place.wrapping_add(1);
    if next < N { next } else { 0 }
}

/// The place of the value before.
fn before<const N: usize>(place: usize) -> usize {
    if place == 0 {
        N.saturating_sub(1)
    } else {
        place.wrapping_sub(1)
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
}
