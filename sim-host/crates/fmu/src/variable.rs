//! Variables of a unit: what the model description lists and an instance holds.

use dynamics::unit::Unit;
use shared_model::short::Short;

/// A value. Enumerations have the numbers of their alternatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A real number.
    Real(f64),
    /// An integer, or the number of an alternative.
    Integer(i32),
    /// True or false.
    Boolean(bool),
}

impl Value {
    /// Name of its type in the functions of the standard.
    pub(crate) fn type_name(self) -> &'static str {
        match self {
            Self::Real(_) => "Real",
            Self::Integer(_) => "Integer",
            Self::Boolean(_) => "Boolean",
        }
    }
}

/// Role of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Set before each step.
    Input,
    /// Read after each step.
    Output,
    /// Set before the initialisation ends.
    Parameter,
}

/// Least and greatest value of a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// Every value; NaN too.
    Any,
    /// From the first to the second.
    Within(f64, f64),
}

/// A variable. Its value reference is its place in the list of its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name; that of a parameter is its key in the configuration file.
    pub name: String,
    /// Description, for people.
    pub description: String,
    /// Role.
    pub causality: Causality,
    /// The value before it is set; an output has it until it is computed.
    pub start: Value,
    /// Allowed values of a number.
    pub range: Range,
    /// Number and name of each alternative of an enumeration; empty for all others.
    pub alternatives: Vec<(i32, String)>,
}

impl Variable {
    /// A variable without range or alternatives.
    pub(crate) fn new(causality: Causality, name: &str, start: Value, description: &str) -> Self {
        Self {
            name: name.to_owned(),
            description: description.to_owned(),
            causality,
            start,
            range: Range::Any,
            alternatives: Vec::new(),
        }
    }

    /// The same from `min` to `max`.
    pub(crate) fn within(self, (min, max): (f64, f64)) -> Self {
        let range = Range::Within(min, max);
        Self { range, ..self }
    }

    /// The same as an enumeration.
    pub(crate) fn one_of(self, alternatives: Vec<(i32, String)>) -> Self {
        Self {
            alternatives,
            ..self
        }
    }

    /// Its unit; `None` for a number without one, and for all that are no real numbers.
    pub fn unit(&self) -> Option<&'static Unit> {
        match self.start {
            Value::Real(_) => Unit::of(&self.name),
            _ => None,
        }
    }

    /// Checks a value.
    ///
    /// # Errors
    /// If it is of another type, out of range, or no alternative.
    pub(crate) fn check(&self, value: Value) -> Result<(), String> {
        if value.type_name() != self.start.type_name() {
            return Err(format!(
                "{} is of the type {}, not {}",
                self.name,
                self.start.type_name(),
                value.type_name()
            ));
        }
        let number = match value {
            Value::Real(number) => number,
            Value::Integer(number) => f64::from(number),
            Value::Boolean(_) => return Ok(()),
        };
        match self.range {
            // Written so that NaN is refused.
            Range::Within(min, max) if !(number >= min && number <= max) => Err(format!(
                "{} = {}: must be a finite number from {} to {}",
                self.name,
                Short(number),
                Short(min),
                Short(max)
            )),
            _ => self.check_alternative(value),
        }
    }

    fn check_alternative(&self, value: Value) -> Result<(), String> {
        let is_one = |(number, _): &(i32, String)| Value::Integer(*number) == value;
        if self.alternatives.is_empty() || self.alternatives.iter().any(is_one) {
            return Ok(());
        }
        let names = self.alternatives.iter();
        let names: Vec<String> = names
            .map(|(number, name)| format!("{number} ({name})"))
            .collect();
        Err(format!(
            "{} = {value:?}: must be one of {}",
            self.name,
            names.join(", ")
        ))
    }
}
