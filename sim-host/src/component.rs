//! The components of the state by name.

use serde::{Serialize, Serializer};
use shared_model::vehicle::{SIDESLIP, STEERING_ANGLE, STEERING_RATE, YAW_RATE};
use std::fmt;
use std::str::FromStr;

/// One component of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Component {
    /// Index in a state vector.
    pub index: usize,
    /// Name for options.
    pub name: &'static str,
    /// Its letter, spelt out; also taken as a name.
    pub letter: &'static str,
    /// Name with unit, for columns.
    pub column: &'static str,
    /// Name with letter and unit, for axes.
    pub label: &'static str,
    /// Unit.
    pub unit: &'static str,
}

impl Component {
    /// All of them, in the state's order.
    pub const ALL: [Self; 4] = [
        Self {
            index: SIDESLIP,
            name: "sideslip",
            letter: "beta",
            column: "sideslip_rad",
            label: "sideslip angle \u{3b2} (rad)",
            unit: "rad",
        },
        Self {
            index: YAW_RATE,
            name: "yaw_rate",
            letter: "gamma",
            column: "yaw_rate_rad_per_s",
            label: "yaw rate \u{3b3} (rad/s)",
            unit: "rad/s",
        },
        Self {
            index: STEERING_ANGLE,
            name: "steering_angle",
            letter: "delta_f",
            column: "steering_angle_rad",
            label: "steering angle \u{3b4}f (rad)",
            unit: "rad",
        },
        Self {
            index: STEERING_RATE,
            name: "steering_rate",
            letter: "delta_f_dot",
            column: "steering_rate_rad_per_s",
            label: "steering rate d\u{3b4}f/dt (rad/s)",
            unit: "rad/s",
        },
    ];
}

impl fmt::Display for Component {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Serialize for Component {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.column)
    }
}

/// No component has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown component {0:?}: must be one of sideslip (beta), yaw_rate (gamma), steering_angle (delta_f), \
     steering_rate (delta_f_dot)"
)]
pub struct UnknownComponent(String);

impl FromStr for Component {
    type Err = UnknownComponent;

    fn from_str(name: &str) -> Result<Self, UnknownComponent> {
        Self::ALL
            .into_iter()
            .find(|c| [c.name, c.letter, c.column].contains(&name))
            .ok_or_else(|| UnknownComponent(name.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_have_names_letters_and_columns() {
        for (index, component) in Component::ALL.into_iter().enumerate() {
            assert_eq!(component.index, index);
            for name in [component.name, component.letter, component.column] {
                assert_eq!(name.parse(), Ok(component));
            }
        }
        let error = "speed".parse::<Component>().unwrap_err().to_string();
        for component in Component::ALL {
            let both = format!("{} ({})", component.name, component.letter);
            assert!(error.contains(&both), "{error}");
        }
    }
}
