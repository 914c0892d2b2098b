//! Parameter sets: each number's name, range and place, written once, and the checks that follow from them.

use crate::Real;
use crate::short::Short;
use core::fmt;

/// One number of a parameter set `P`: its name (which carries the unit), its allowed range, and where it is.
#[derive(Debug)]
pub struct Field<P, T> {
    /// Name as in the configuration file, with the unit at its end.
    pub name: &'static str,
    /// Least allowed value.
    pub min: f64,
    /// Greatest allowed value.
    pub max: f64,
    /// The number's place in the set.
    pub place: fn(&mut P) -> &mut T,
}

/// A set of numbers that is checked, listed and set by name.
pub trait ParameterSet<T: Real>: Copy + 'static {
    /// Name of the set as in the configuration file.
    const SECTION: &'static str;
    /// All numbers of the set.
    const FIELDS: &'static [Field<Self, T>];

    /// Checks that every number is finite and in its range.
    ///
    /// # Errors
    /// The first number that is not, with its value and range.
    fn validate(&self) -> Result<(), OutOfRange> {
        self.validate_as(Self::SECTION)
    }

    /// As [`validate`](Self::validate), where the set goes by another name (front and rear tyre).
    ///
    /// # Errors
    /// The first number that is not in its range.
    fn validate_as(&self, section: &'static str) -> Result<(), OutOfRange> {
        let mut copy = *self;
        for field in Self::FIELDS {
            check(section, field, *(field.place)(&mut copy))?;
        }
        Ok(())
    }

    /// Sets the number called `name`; `false` if the set has none of that name. The value is not checked.
    fn set(&mut self, name: &str, value: T) -> bool {
        let field = Self::FIELDS.iter().find(|field| field.name == name);
        if let Some(field) = field {
            *(field.place)(self) = value;
        }
        field.is_some()
    }
}

fn check<P, T: Real>(
    section: &'static str,
    field: &Field<P, T>,
    value: T,
) -> Result<(), OutOfRange> {
    // Written so that NaN, which compares false with everything, is refused. The bounds are rounded to T as the value
    // was, so that a value at its bound is allowed in every arithmetic.
    if value >= T::from_f64(field.min) && value <= T::from_f64(field.max) && value.is_finite() {
        return Ok(());
    }
    Err(OutOfRange {
        section,
        name: field.name,
        value: value.to_f64(),
        min: field.min,
        max: field.max,
    })
}

/// A number that is not finite or not in its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutOfRange {
    /// Section of the configuration file.
    pub section: &'static str,
    /// Name within the section.
    pub name: &'static str,
    /// The value that was refused.
    pub value: f64,
    /// Least allowed value.
    pub min: f64,
    /// Greatest allowed value.
    pub max: f64,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}.{} = {}: must be a finite number from {} to {}",
            self.section,
            self.name,
            Short(self.value),
            Short(self.min),
            Short(self.max)
        )
    }
}

impl core::error::Error for OutOfRange {}
