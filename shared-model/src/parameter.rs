//! Parameter sets: each number's documentation, name and range, declared once, and the checks that
//! follow from them.

use crate::Real;
use crate::short::Short;
use core::fmt;

/// One number of a parameter set `P`: its name (which carries the unit), its allowed range, and its
/// accessor.
#[derive(Debug)]
pub struct Field<P, T> {
    /// Name as in the configuration file, with the unit at its end.
    pub name: &'static str,
    /// Least allowed value.
    pub min: f64,
    /// Greatest allowed value.
    pub max: f64,
    /// Access to the number in a set.
    pub accessor: fn(&mut P) -> &mut T,
}

/// A set of numbers that is checked, listed and set by name.
pub trait ParameterSet<T: Real>: Copy + 'static {
    /// Name of the set as in the configuration file.
    const SECTION: &'static str;
    /// All numbers of the set.
    const FIELDS: &'static [Field<Self, T>];
    /// Name and description of every parameter, numbers and others, for people. Apart from
    /// [`FIELDS`](Self::FIELDS), so that the texts are not in the firmware.
    const DESCRIPTIONS: &'static [(&'static str, &'static str)];

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
            check(section, field, *(field.accessor)(&mut copy))?;
        }
        Ok(())
    }

    /// Least and greatest allowed value of the number called `name`; `None` if the set has none of
    /// that name.
    fn range(name: &str) -> Option<(f64, f64)> {
        let field = Self::FIELDS.iter().find(|field| field.name == name)?;
        Some((field.min, field.max))
    }

    /// Description of the parameter called `name`; `None` if the set has none of that name.
    fn description(name: &str) -> Option<&'static str> {
        let (_, text) = Self::DESCRIPTIONS
            .iter()
            .find(|(known, _)| *known == name)?;
        Some(text.trim_start())
    }

    /// The number called `name`; `None` if the set has none of that name.
    fn number(&mut self, name: &str) -> Option<&mut T> {
        let field = Self::FIELDS.iter().find(|field| field.name == name)?;
        Some((field.accessor)(self))
    }
}

fn check<P, T: Real>(
    section: &'static str,
    field: &Field<P, T>,
    value: T,
) -> Result<(), OutOfRange> {
    // Written so that NaN, which compares false with everything, is refused. The bounds are rounded
    // to T as the value was, so that a value at its bound is allowed in every arithmetic.
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

/// Declares a parameter set: the structure, its names in the configuration file, the ranges, and
/// the conversion to another arithmetic. The parameters that are no numbers come first, in a block
/// `choices`.
macro_rules! parameters {
    (
        section $section:literal;
        $(#[$about:meta])*
        pub struct $Set:ident {
            $(choices {
                $($(#[doc = $about_choice:literal])+ $choice:ident: $Kind:ty,)+
            })?
            $($(#[doc = $about_number:literal])+ $number:ident: $min:literal..=$max:literal,)+
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
        pub struct $Set<T> {
            $($($(#[doc = $about_choice])+ pub $choice: $Kind,)+)?
            $(
                $(#[doc = $about_number])+
                #[doc = ""]
                #[doc = concat!("Range: ", stringify!($min), " to ", stringify!($max), ".")]
                pub $number: T,
            )+
        }

        impl<T: $crate::Real> $Set<T> {
            /// The same parameters in another arithmetic.
            pub fn map<U>(&self, f: &impl Fn(T) -> U) -> $Set<U> {
                $Set {
                    $($($choice: self.$choice,)+)?
                    $($number: f(self.$number),)+
                }
            }
        }

        impl<T: $crate::Real> $crate::parameter::ParameterSet<T> for $Set<T> {
            const SECTION: &'static str = $section;
            const FIELDS: &'static [$crate::parameter::Field<Self, T>] = &[
                $($crate::parameter::Field {
                    name: stringify!($number),
                    min: $min,
                    max: $max,
                    accessor: |set| &mut set.$number,
                },)+
            ];
            const DESCRIPTIONS: &'static [(&'static str, &'static str)] = &[
                $($((stringify!($choice), concat!($($about_choice),+)),)+)?
                $((stringify!($number), concat!($($about_number),+)),)+
            ];
        }
    };
}
pub(crate) use parameters;
