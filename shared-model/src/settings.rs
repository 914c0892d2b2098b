//! Scenarios as text, one setting `section.name=value` per word: they reach the ECU without a
//! rebuild.

use crate::Real;
use crate::dither::{Application, Dither, Waveform};
use crate::friction::{Friction, FrictionLaw};
use crate::gate::Limits;
use crate::parameter::ParameterSet;
use crate::policy::{Policy, Suppression};
use crate::scenario::{Preset, Run, Scenario};
use crate::servo::Servo;
use crate::steering::Steering;
use crate::tire::{MagicFormula, TireModel};
use crate::vehicle::{SlipForm, Vehicle};
use core::fmt;
use core::str::FromStr;

/// A parameter that is one of a few names.
pub trait Choice: Copy + PartialEq + 'static {
    /// All choices.
    const ALL: &'static [Self];

    /// Its name, as in the configuration file.
    fn name(self) -> &'static str;

    /// The choice of that name.
    fn from_name(name: &str) -> Option<Self> {
        let named = Self::ALL.iter().find(|choice| choice.name() == name);
        named.copied()
    }
}

macro_rules! choices {
    ($($Enum:ident),+) => {$(
        impl Choice for $Enum {
            const ALL: &'static [Self] = &$Enum::ALL;

            fn name(self) -> &'static str {
                self.name()
            }
        }
    )+};
}
choices!(
    Preset,
    SlipForm,
    TireModel,
    FrictionLaw,
    Waveform,
    Application,
    Suppression
);

impl Choice for bool {
    const ALL: &'static [Self] = &[true, false];

    fn name(self) -> &'static str {
        if self { "true" } else { "false" }
    }
}

/// Reason why a setting was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingError {
    /// Not of the form `key=value`.
    NoEqualsSign,
    /// No parameter of that name.
    UnknownKey,
    /// The value is not a number.
    NotANumber,
    /// The value is none of the parameter's names.
    UnknownChoice,
}

impl SettingError {
    /// The reason in words.
    pub fn reason(self) -> &'static str {
        match self {
            Self::NoEqualsSign => "must be key=value",
            Self::UnknownKey => "no parameter of that name",
            Self::NotANumber => "the value is not a number",
            Self::UnknownChoice => "the value is none of the parameter's names",
        }
    }
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.reason())
    }
}

impl core::error::Error for SettingError {}

impl<T: Real> Scenario<T> {
    /// Least and greatest allowed value of the number `section.name`; `None` if there is none of
    /// that name.
    ///
    /// ```
    /// use shared_model::Scenario;
    /// assert_eq!(Scenario::<f64>::range("vehicle.mass_kg"), Some((1.0, 1e5)));
    /// assert_eq!(Scenario::<f64>::range("vehicle.slip_form"), None);
    /// ```
    pub fn range(key: &str) -> Option<(f64, f64)> {
        let (section, name) = key.rsplit_once('.')?;
        match section {
            "vehicle" => Vehicle::<T>::range(name),
            "tires.front" | "tires.rear" => MagicFormula::<T>::range(name),
            "steering" => Steering::<T>::range(name),
            "friction" => Friction::<T>::range(name),
            "dither" => Dither::<T>::range(name),
            "servo" => Servo::<T>::range(name),
            "controller" => Policy::<T>::range(name),
            "gate" => Limits::<T>::range(name),
            "run" => Run::<T>::range(name),
            _ => None,
        }
    }
}

impl<T: Real> Scenario<T> {
    /// Description of the parameter `section.name`, with its unit; `None` if there is none of that
    /// name.
    ///
    /// ```
    /// use shared_model::Scenario;
    /// let text = Scenario::<f64>::description("run.wheel_speed_rpm");
    /// assert_eq!(text, Some("Wheel speed N, rpm."));
    /// ```
    pub fn description(key: &str) -> Option<&'static str> {
        let (section, name) = key.rsplit_once('.')?;
        match section {
            "vehicle" => Vehicle::<T>::description(name),
            "tires" => (name == "model").then_some("Which tyre the model uses."),
            "tires.front" | "tires.rear" => MagicFormula::<T>::description(name),
            "steering" => Steering::<T>::description(name),
            "friction" => Friction::<T>::description(name),
            "dither" => Dither::<T>::description(name),
            "servo" => Servo::<T>::description(name),
            "controller" => Policy::<T>::description(name),
            "gate" => Limits::<T>::description(name),
            "run" => Run::<T>::description(name),
            _ => None,
        }
    }
}

impl<T: Real> Scenario<T> {
    /// The number `section.name`; `None` if there is none of that name.
    ///
    /// ```
    /// use shared_model::Scenario;
    /// let mut scenario = Scenario::<f64>::reconstruction();
    /// assert_eq!(scenario.number("run.wheel_speed_rpm"), Some(&mut 1750.0));
    /// assert_eq!(scenario.number("vehicle.slip_form"), None);
    /// ```
    pub fn number(&mut self, key: &str) -> Option<&mut T> {
        let (section, name) = key.rsplit_once('.')?;
        match section {
            "vehicle" => self.vehicle.number(name),
            "tires.front" => self.tires.front.number(name),
            "tires.rear" => self.tires.rear.number(name),
            "steering" => self.steering.number(name),
            "friction" => self.friction.number(name),
            "dither" => self.dither.number(name),
            "servo" => self.servo.number(name),
            "controller" => self.controller.number(name),
            "gate" => self.gate.number(name),
            "run" => self.run.number(name),
            _ => None,
        }
    }
}

impl<T: Real + FromStr> Scenario<T> {
    /// Takes one setting: `preset=NAME`, which replaces everything before it, or
    /// `section.name=value`. The value's range is not checked here but by
    /// [`validate`](Self::validate), once all settings are in.
    ///
    /// # Errors
    /// If there is no such parameter, or the value is not one for it.
    ///
    /// ```
    /// use shared_model::{Scenario, settings::SettingError};
    /// let mut scenario = Scenario::<f32>::reconstruction();
    /// scenario.apply("run.wheel_speed_rpm=1600").unwrap();
    /// assert_eq!(scenario.run.wheel_speed_rpm, 1600.0);
    /// scenario.apply("dither.waveform=square").unwrap();
    /// assert_eq!(scenario.apply("vehicle.mas_kg=1"), Err(SettingError::UnknownKey));
    /// ```
    pub fn apply(&mut self, setting: &str) -> Result<(), SettingError> {
        let (key, value) = setting.split_once('=').ok_or(SettingError::NoEqualsSign)?;
        match key {
            "preset" => choice(value).map(|preset| *self = Self::preset(preset)),
            "vehicle.slip_form" => choose(&mut self.vehicle.slip_form, value),
            "tires.model" => choose(&mut self.tires.model, value),
            "friction.law" => choose(&mut self.friction.law, value),
            "friction.dithered" => choose(&mut self.friction.dithered, value),
            "dither.waveform" => choose(&mut self.dither.waveform, value),
            "dither.application" => choose(&mut self.dither.application, value),
            "controller.suppression" => choose(&mut self.controller.suppression, value),
            _ => self.set_number(key, value),
        }
    }

    fn set_number(&mut self, key: &str, value: &str) -> Result<(), SettingError> {
        // The key is checked first: a misspelt choice, whose value is no number, is reported as an
        // unknown key.
        let number = self.number(key).ok_or(SettingError::UnknownKey)?;
        *number = value.parse().map_err(|_| SettingError::NotANumber)?;
        Ok(())
    }
}

fn choice<C: Choice>(value: &str) -> Result<C, SettingError> {
    C::from_name(value).ok_or(SettingError::UnknownChoice)
}

fn choose<C: Choice>(place: &mut C, value: &str) -> Result<(), SettingError> {
    *place = choice(value)?;
    Ok(())
}
