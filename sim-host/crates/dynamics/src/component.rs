//! The components of the state by name.

use nalgebra::Vector4;
use plot::chart::{Look, Panel};
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
    /// Name and symbol, for headings.
    pub title: &'static str,
    /// Unit.
    pub unit: &'static str,
}

impl Component {
    /// Sideslip angle beta.
    pub const SIDESLIP: Self = Self {
        index: SIDESLIP,
        name: "sideslip",
        letter: "beta",
        column: "sideslip_rad",
        title: "sideslip angle \u{3b2}",
        unit: "rad",
    };
    /// Yaw rate gamma.
    pub const YAW_RATE: Self = Self {
        index: YAW_RATE,
        name: "yaw_rate",
        letter: "gamma",
        column: "yaw_rate_rad_per_s",
        title: "yaw rate \u{3b3}",
        unit: "rad/s",
    };
    /// Front steering angle delta_f.
    pub const STEERING_ANGLE: Self = Self {
        index: STEERING_ANGLE,
        name: "steering_angle",
        letter: "delta_f",
        column: "steering_angle_rad",
        title: "steering angle \u{3b4}f",
        unit: "rad",
    };
    /// Rate of the front steering angle.
    pub const STEERING_RATE: Self = Self {
        index: STEERING_RATE,
        name: "steering_rate",
        letter: "delta_f_dot",
        column: "steering_rate_rad_per_s",
        title: "steering rate d\u{3b4}f/dt",
        unit: "rad/s",
    };
    /// All of them, in the state's order.
    pub const ALL: [Self; 4] = [
        Self::SIDESLIP,
        Self::YAW_RATE,
        Self::STEERING_ANGLE,
        Self::STEERING_RATE,
    ];

    /// Name, symbol and unit, for axes.
    ///
    /// ```
    /// let component: dynamics::component::Component = "gamma".parse().unwrap();
    /// assert_eq!(component.label(), "yaw rate \u{3b3} (rad/s)");
    /// ```
    pub fn label(&self) -> String {
        format!("{} ({})", self.title, self.unit)
    }
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

/// A panel with one component of states over another, without a caption.
pub fn panel_of_states(
    (x, y): (Component, Component),
    states: impl IntoIterator<Item = Vector4<f64>>,
    look: Look,
) -> Panel {
    let states = states.into_iter();
    let points = states.map(|state| (state[x.index], state[y.index]));
    Panel::of_points((x.label(), y.label()), points.collect(), look)
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
