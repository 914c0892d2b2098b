//! Axes with round ticks, linear or logarithmic.

/// An axis of a panel. Values beyond its ends are drawn on them.
#[derive(Debug, Clone)]
pub struct Axis {
    /// What it shows, with its unit; empty for an axis without name.
    pub name: String,
    /// Value at its lower end.
    pub low: f64,
    /// Value at its upper end.
    pub high: f64,
    /// Values of its ticks.
    pub ticks: Vec<f64>,
    scale: Scale,
}

#[derive(Debug, Clone, Copy)]
enum Scale {
    Linear { decimals: usize },
    Logarithmic,
}

/// The greatest number of decades on a logarithmic axis.
const MOST_DECADES: f64 = 14.0;
/// Logarithmic axes end at this power of ten, and at its inverse.
const MOST_DECADE: f64 = 300.0;
/// Values further out than this are not drawn to scale: they would overflow the arithmetic.
const GREATEST: f64 = 1e30;

impl Axis {
    /// A linear axis from `low` to `high` with at most about `ticks` ticks.
    pub fn linear(name: &str, low: f64, high: f64, ticks: usize) -> Self {
        let low = low.clamp(-GREATEST, GREATEST);
        let mut high = high.clamp(-GREATEST, GREATEST);
        if high - low <= 1e-9 * low.abs().max(high.abs()).max(1e-3) {
            high = low + 1.0_f64.max(low.abs() * 0.01);
        }
        let (step, decimals) = round_step((high - low) / ticks.max(1) as f64);
        let first = (low / step - 1e-9).ceil();
        let last = (high / step + 1e-9).floor();
        let count = (last - first) as i32;
        Self {
            name: name.into(),
            low,
            high,
            ticks: (0..=count)
                .map(|n| (first + f64::from(n)) * step + 0.0)
                .collect(),
            scale: Scale::Linear { decimals },
        }
    }

    /// A linear axis around the values with a margin; from 0 to 1 if there are none.
    pub fn around(name: &str, values: impl IntoIterator<Item = f64>, ticks: usize) -> Self {
        let Some((low, high)) = bounds(values) else {
            return Self::linear(name, 0.0, 1.0, ticks);
        };
        let (low, high) = (low.max(-GREATEST), high.min(GREATEST));
        let span = high - low;
        let margin = if span > 1e-9 * low.abs().max(high.abs()) {
            0.06 * span
        } else {
            (0.05 * low.abs()).max(1e-3)
        };
        Self::linear(name, low - margin, high + margin, ticks)
    }

    /// A logarithmic axis of whole decades around the values that are greater than 0, with at most
    /// about `ticks` ticks.
    pub fn decades(name: &str, values: impl IntoIterator<Item = f64>, ticks: usize) -> Self {
        let logs = values
            .into_iter()
            .filter(|value| *value > 0.0)
            .map(|value| value.log10().clamp(-MOST_DECADE, MOST_DECADE));
        let (low, high) = bounds(logs).unwrap_or((0.0, 1.0));
        let high = high.ceil().max(low.floor() + 1.0);
        let low = low.floor().max(high - MOST_DECADES);
        Self::logarithmic(name, 10_f64.powf(low), 10_f64.powf(high), ticks)
    }

    /// A logarithmic axis from `low` to `high`, both greater than 0, with at most about `ticks`
    /// ticks: at powers of ten, or at 1, 2 and 5 times them where the axis spans less than two
    /// decades.
    pub fn logarithmic(name: &str, low: f64, high: f64, ticks: usize) -> Self {
        let bounded = |value: f64| value.log10().clamp(-MOST_DECADE, MOST_DECADE);
        let from = bounded(low);
        let to = bounded(high).max(from + 1e-3);
        let step = ((to - from) / ticks.max(1) as f64).ceil().max(1.0);
        let factors: &[f64] = if to - from < 2.0 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let first = (from / step - 1e-9).floor() as i32;
        let last = (to / step + 1e-9).floor() as i32;
        let within = |tick: &f64| tick.log10() >= from - 1e-9 && tick.log10() <= to + 1e-9;
        Self {
            name: name.into(),
            low: 10_f64.powf(from),
            high: 10_f64.powf(to),
            ticks: (first..=last)
                .flat_map(|n| {
                    let power = 10_f64.powf(f64::from(n) * step);
                    factors.iter().map(move |factor| factor * power)
                })
                .filter(within)
                .collect(),
            scale: Scale::Logarithmic,
        }
    }

    /// The same axis with another name.
    pub fn named(&self, name: &str) -> Self {
        Self {
            name: name.into(),
            ..self.clone()
        }
    }

    /// The quantity that is proportional to length on the axis: the value, or its decimal
    /// logarithm.
    pub fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear { .. } => value,
            Scale::Logarithmic => value.max(f64::MIN_POSITIVE).log10(),
        }
    }

    /// The value at a place; the inverse of [`place`](Self::place).
    pub fn value(&self, place: f64) -> f64 {
        match self.scale {
            Scale::Linear { .. } => place,
            Scale::Logarithmic => 10_f64.powf(place),
        }
    }

    /// Whether a value can be drawn: it is finite, and on a logarithmic axis greater than 0.
    pub fn takes(&self, value: f64) -> bool {
        value.is_finite() && (value > 0.0 || matches!(self.scale, Scale::Linear { .. }))
    }

    /// Whether a value lies between the ends.
    pub fn holds(&self, value: f64) -> bool {
        value >= self.low && value <= self.high
    }

    /// Places of the lower and the upper end.
    pub fn ends(&self) -> (f64, f64) {
        (self.place(self.low), self.place(self.high))
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper.
    pub fn fraction(&self, value: f64) -> f64 {
        let (low, high) = self.ends();
        ((self.place(value) - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// The unit on the way from `start` at the lower end to `end` at the upper that is nearest to a
    /// value.
    pub fn unit(&self, value: f64, (start, end): (i32, i32)) -> i32 {
        start + (self.fraction(value) * f64::from(end - start)).round() as i32
    }

    /// The text of a tick.
    pub fn label(&self, tick: f64) -> String {
        match self.scale {
            Scale::Linear { decimals } => format!("{tick:.decimals$}").replace('-', "\u{2212}"),
            Scale::Logarithmic => {
                let exponent = tick.log10().round() as i32;
                let factor = tick / 10_f64.powi(exponent);
                if (factor - 1.0).abs() < 1e-6 {
                    power_of_ten(exponent)
                } else if (1e-3..1e5).contains(&tick) {
                    format!("{}", (tick * 1e6).round() / 1e6)
                } else {
                    let below = tick.log10().floor() as i32;
                    let factor = (tick / 10_f64.powi(below)).round();
                    format!("{factor}\u{b7}{}", power_of_ten(below))
                }
            }
        }
    }
}

/// Least and greatest of the finite values.
pub fn bounds(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .into_iter()
        .filter(|value| value.is_finite())
        .fold(None, |bounds, value| {
            let (low, high) = bounds.unwrap_or((value, value));
            Some((value.min(low), value.max(high)))
        })
}

/// The least of 1, 2, 5 times a power of ten that is not less than `least`, and the decimals it
/// needs.
fn round_step(least: f64) -> (f64, usize) {
    let exponent = least.log10().floor() as i32;
    let power = 10_f64.powi(exponent);
    let (factor, carry) = match least / power {
        ratio if ratio <= 1.0 + 1e-9 => (1.0, 0),
        ratio if ratio <= 2.0 + 1e-9 => (2.0, 0),
        ratio if ratio <= 5.0 + 1e-9 => (5.0, 0),
        _ => (10.0, 1),
    };
    (factor * power, (-(exponent + carry)).max(0) as usize)
}

fn power_of_ten(exponent: i32) -> String {
    match exponent {
        0 => "1".into(),
        1 => "10".into(),
        _ => {
            let superscript = |character| match character {
                '-' => '\u{207b}',
                '1' => '\u{b9}',
                '2' => '\u{b2}',
                '3' => '\u{b3}',
                digit => {
                    char::from_u32(0x2070 + (u32::from(digit) - u32::from('0'))).unwrap_or(digit)
                }
            };
            let exponent: String = exponent.to_string().chars().map(superscript).collect();
            format!("10{exponent}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|tick| axis.label(*tick)).collect()
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::linear("", -0.23, 0.31, 6);
        assert_eq!(
            labels(&axis),
            ["\u{2212}0.2", "\u{2212}0.1", "0.0", "0.1", "0.2", "0.3"]
        );
        let axis = Axis::linear("", 0.0, 15.0, 8);
        assert_eq!(labels(&axis), ["0", "2", "4", "6", "8", "10", "12", "14"]);
        assert_eq!(
            labels(&Axis::linear("", 2.9, 3.1, 4)),
            ["2.90", "2.95", "3.00", "3.05", "3.10"]
        );
    }

    #[test]
    fn decades_are_powers_of_ten() {
        let axis = Axis::decades("", [0.0, 3e-4, 20.0, f64::NAN], 10);
        assert_eq!(
            labels(&axis),
            [
                "10\u{207b}\u{2074}",
                "10\u{207b}\u{b3}",
                "10\u{207b}\u{b2}",
                "10\u{207b}\u{b9}",
                "1",
                "10",
                "10\u{b2}"
            ]
        );
        assert_eq!(axis.unit(0.0, (0, 60)), 0);
        assert_eq!(axis.unit(1.0, (0, 60)), 40);
    }

    #[test]
    fn a_short_logarithmic_axis_has_ticks_between_powers_of_ten() {
        let axis = Axis::logarithmic("", 30.0, 800.0, 8);
        assert_eq!(labels(&axis), ["50", "10\u{b2}", "200", "500"]);
        let axis = Axis::logarithmic("", 1.0, 2e4, 8);
        assert_eq!(labels(&axis).len(), 5);
        assert_eq!(axis.unit(2e4, (0, 60)), 60);
        assert_eq!(
            labels(&Axis::logarithmic("", 1e6, 1e7, 8))[1],
            "2\u{b7}10\u{2076}"
        );
    }

    #[test]
    fn values_without_extent_get_an_axis() {
        for axis in [
            Axis::around("", [0.0], 5),
            Axis::around("", [1e30, 1e300], 5),
            Axis::around("", [], 5),
            Axis::linear("", 3.0, 3.0, 5),
            Axis::decades("", [1.0], 5),
            Axis::decades("", [], 5),
        ] {
            assert!(axis.low < axis.high && !axis.ticks.is_empty(), "{axis:?}");
        }
    }
}
