//! Numbers in messages.

use core::fmt;

/// A number in few characters: that of 1e300 has no 300 digits.
#[derive(Debug, Clone, Copy)]
pub struct Short(pub f64);

/// Numbers from here to [`LARGE`] are written without an exponent.
const SMALL: f64 = 1e-5;
const LARGE: f64 = 1e15;

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (SMALL..LARGE).contains(&size) || !size.is_finite() {
            self.0.fmt(f)
        } else {
            fmt::LowerExp::fmt(&self.0, f)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn numbers_are_short() {
        for (number, text) in [
            (0.0, "0"),
            (-0.1, "-0.1"),
            (1750.0, "1750"),
            (1e300, "1e300"),
            (-1.5e-300, "-1.5e-300"),
            (f64::MAX, "1.7976931348623157e308"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(Short(number).to_string(), text);
        }
    }
}
