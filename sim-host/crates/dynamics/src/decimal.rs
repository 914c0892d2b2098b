//! Equally spaced numbers as a reader counts them: 0, 0.1, 0.2, 0.3, each the double nearest to its
//! decimal value.

/// The numbers `(first + k * rise / per) * 10^exponent`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spaced {
    first: i128,
    rise: i128,
    per: i128,
    exponent: i32,
    count: usize,
}

/// Why there are no such numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotSpaced {
    /// More digits than can be counted in lie between the greatest and the least.
    SizesDiffer,
    /// More of them than asked for at most.
    Count,
    /// Neighbours round to the same double.
    SameNumber,
}

/// Digits of a quotient: more than a double has, and enough to tell on which side of a tie it lies.
const DIGITS: usize = 40;

impl Spaced {
    /// The numbers from `from` in steps of `step`, not beyond `to` and at most `most`; ascending,
    /// also if `to` is the lower one. All must be finite, the step not 0.
    ///
    /// # Errors
    /// See [`NotSpaced`].
    pub(crate) fn in_steps(from: f64, to: f64, step: f64, most: usize) -> Result<Self, NotSpaced> {
        if ((to - from) / step).abs() > most as f64 {
            return Err(NotSpaced::Count);
        }
        let ([from, to, step], exponent) = scaled([from, to, step])?;
        let steps = (to - from).unsigned_abs() / step.unsigned_abs();
        if steps >= most as u128 {
            return Err(NotSpaced::Count);
        }
        let rise = step.abs();
        let below = if to < from { steps as i128 * rise } else { 0 };
        Self {
            first: from - below,
            rise,
            per: 1,
            exponent,
            count: steps as usize + 1,
        }
        .checked()
    }

    /// `count` numbers, at least 1, with `from` and `to` as the first and the last; ascending. Of
    /// one number both are the same.
    ///
    /// # Errors
    /// See [`NotSpaced`].
    pub fn between(from: f64, to: f64, count: usize) -> Result<Self, NotSpaced> {
        let ([first, last], exponent) = scaled([from.min(to), from.max(to)])?;
        Self {
            first,
            rise: last - first,
            per: count.saturating_sub(1).max(1) as i128,
            exponent,
            count,
        }
        .checked()
    }

    fn checked(self) -> Result<Self, NotSpaced> {
        let last = self.count as i128 - 1;
        self.first
            .checked_mul(self.per)
            .and_then(|first| first.checked_add(last.checked_mul(self.rise)?))
            .filter(|sum| sum.checked_mul(10).is_some())
            .ok_or(NotSpaced::SizesDiffer)?;
        let same = |k| self.at(k) == self.at(k + 1);
        if self.count > 1 && (same(0) || same(self.count - 2)) {
            return Err(NotSpaced::SameNumber);
        }
        Ok(self)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number `k`, from 0 on.
    pub fn at(&self, k: usize) -> f64 {
        let sum = self.first * self.per + k as i128 * self.rise;
        let (mut digits, mut rest) = (
            format!("{}", sum / self.per),
            sum.unsigned_abs() % self.per.unsigned_abs(),
        );
        if sum < 0 && !digits.starts_with('-') {
            digits.insert(0, '-');
        }
        let mut exponent = self.exponent;
        while rest != 0 && digits.len() < DIGITS {
            rest *= 10;
            digits.push_str(&(rest / self.per.unsigned_abs()).to_string());
            rest %= self.per.unsigned_abs();
            exponent -= 1;
        }
        // What is left makes it a little more than the digits.
        let more = if rest == 0 { "" } else { ".1" };
        let number = format!("{digits}{more}e{exponent}");
        number.parse().expect("digits and an exponent are a number")
    }
}

/// Numbers as multiples of the same power of ten, by the shortest digits that are read back as
/// them: those that a reader types.
fn scaled<const N: usize>(numbers: [f64; N]) -> Result<([i128; N], i32), NotSpaced> {
    let parts = numbers.map(|number| {
        let text = format!("{number:e}");
        let (digits, exponent) = text.split_once('e').expect("it has an exponent");
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        let digits: i128 = format!("{whole}{fraction}").parse().expect("digits");
        let exponent: i32 = exponent.parse().expect("an exponent");
        (digits, exponent - fraction.len() as i32)
    });
    let of_numbers = parts.iter().filter(|(digits, _)| *digits != 0);
    let least = of_numbers.map(|&(_, exponent)| exponent).min().unwrap_or(0);
    let mut multiples = [0; N];
    for (multiple, (digits, exponent)) in multiples.iter_mut().zip(parts) {
        if digits != 0 {
            let power = 10_i128.checked_pow(exponent.abs_diff(least));
            let scaled = power.and_then(|power| digits.checked_mul(power));
            *multiple = scaled
                .filter(|n| n.abs() < i128::MAX / 4)
                .ok_or(NotSpaced::SizesDiffer)?;
        }
    }
    Ok((multiples, least))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(spaced: Result<Spaced, NotSpaced>) -> Vec<f64> {
        let spaced = spaced.unwrap();
        (0..spaced.count()).map(|k| spaced.at(k)).collect()
    }

    fn steps(from: f64, to: f64, step: f64) -> Result<Spaced, NotSpaced> {
        Spaced::in_steps(from, to, step, 1000)
    }

    #[test]
    fn steps_are_those_that_a_reader_types() {
        for (from, to, step, typed) in [
            (0.0, 0.3, 0.1, &[0.0, 0.1, 0.2, 0.3][..]),
            (0.0, 0.35, 0.1, &[0.0, 0.1, 0.2, 0.3]),
            (0.3, 0.0, 0.1, &[0.0, 0.1, 0.2, 0.3]),
            (0.35, 0.0, 0.1, &[0.05, 0.15, 0.25, 0.35]),
            (0.35, 0.0, -0.1, &[0.05, 0.15, 0.25, 0.35]),
            (-0.3, 0.3, 0.2, &[-0.3, -0.1, 0.1, 0.3]),
            (1.2, 1.4, 0.1, &[1.2, 1.3, 1.4]),
            (1e-9, 3e-9, 1e-9, &[1e-9, 2e-9, 3e-9]),
            (1e300, 1e300, 1.0e290, &[1e300]),
            (5.0, 5.0, 10.0, &[5.0]),
            (0.0, 0.0, 0.1, &[0.0]),
        ] {
            assert_eq!(all(steps(from, to, step)), typed, "{from} {to} {step}");
        }
    }

    /// By the decimal texts of whole multiples, for many steps and starts.
    #[test]
    fn the_kth_is_its_decimal_text() {
        for (places, from, step) in [
            (1, -35, 1),
            (2, 7, 5),
            (3, 155_000, 2),
            (5, -12_345, 678),
            (9, 1, 3),
        ] {
            let decimal = |n: i64| format!("{n}e-{places}").parse::<f64>().unwrap();
            let to = from + 999 * step;
            let found = all(steps(decimal(from), decimal(to), decimal(step)));
            let typed: Vec<f64> = (0..1000).map(|k| decimal(from + k * step)).collect();
            assert_eq!(found, typed);
            // The same by their number.
            assert_eq!(
                all(Spaced::between(decimal(from), decimal(to), 1000)),
                typed
            );
            assert_eq!(
                all(Spaced::between(decimal(to), decimal(from), 1000)),
                typed
            );
        }
    }

    #[test]
    fn quotients_are_the_nearest_doubles() {
        assert_eq!(
            all(Spaced::between(0.0, 1.0, 4)),
            [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]
        );
        assert_eq!(
            all(Spaced::between(-1.0, 0.0, 4)),
            [-1.0, -2.0 / 3.0, -1.0 / 3.0, 0.0]
        );
        assert_eq!(all(Spaced::between(0.14, 0.14, 1)), [0.14]);
        let values = all(Spaced::between(0.0, 2.0, 256));
        for (k, value) in values.iter().enumerate() {
            assert_eq!(*value, 2.0 * k as f64 / 255.0);
        }
    }

    #[test]
    fn what_cannot_be_counted_is_refused() {
        assert_eq!(steps(0.0, 1000.0, 1.0), Err(NotSpaced::Count));
        assert_eq!(steps(-1e308, 1e308, 1.0), Err(NotSpaced::Count));
        assert_eq!(
            steps(1.0, 1.000_000_000_000_01, 1e-17),
            Err(NotSpaced::Count)
        );
        assert_eq!(
            steps(1.0, 1.000_000_000_000_001, 1e-17),
            Err(NotSpaced::SameNumber)
        );
        assert_eq!(steps(1e-300, 1.0, 0.1), Err(NotSpaced::SizesDiffer));
        assert_eq!(
            Spaced::between(1e-30, 1e30, 10),
            Err(NotSpaced::SizesDiffer)
        );
        assert_eq!(Spaced::between(1.0, 1.0, 2), Err(NotSpaced::SameNumber));
        assert_eq!(
            Spaced::between(0.0, 1.0, usize::MAX),
            Err(NotSpaced::SameNumber)
        );
    }
}
