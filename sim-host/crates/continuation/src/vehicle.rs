//! The vehicle under its averaged dither, with any two of its numbers as parameters.

use crate::system::{Equations, Parameters, System};
use engine::events::next_mode;
use nalgebra::{SVector, Vector4};
use shared_model::dither::{Application, Injection};
use shared_model::friction::{FrictionMode, Sign};
use shared_model::vehicle::Model;
use shared_model::{InvalidScenario, Real, Scenario};

/// Longest step where friction has modes, s: short against any motion of the steering.
const LONGEST_STEP_S: f64 = 0.02;

/// Why a number cannot be a parameter.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InvalidParameter {
    /// There is no such number.
    #[error("{key}: no number of that name; `sim-host config` lists all")]
    Unknown {
        /// The name.
        key: String,
    },
    /// The scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
}

/// The vehicle of a scenario, with two of its numbers as parameters.
#[derive(Debug, Clone)]
pub struct Vehicle {
    scenario: Scenario<f64>,
    keys: [String; 2],
}

impl Vehicle {
    /// The vehicle of a scenario; the parameters are named as in a configuration file, for example
    /// `run.wheel_speed_rpm`.
    ///
    /// # Errors
    /// If the scenario is not valid, or has no such number.
    pub fn new(scenario: &Scenario<f64>, keys: [&str; 2]) -> Result<Self, InvalidParameter> {
        let mut scenario = *scenario;
        scenario.dither.application = Application::Averaged;
        scenario.validate()?;
        if let Some(key) = keys.into_iter().find(|key| scenario.number(key).is_none()) {
            return Err(InvalidParameter::Unknown { key: key.into() });
        }
        let keys = keys.map(str::to_owned);
        Ok(Self { scenario, keys })
    }

    /// The parameters' values in the scenario.
    pub fn parameters(&self) -> Parameters<f64> {
        let mut scenario = self.scenario;
        let value = |key: &String| scenario.number(key).map_or(f64::NAN, |number| *number);
        self.keys.each_ref().map(value)
    }

    /// The mode of friction in which an equilibrium at `x` slips: without torque where the steering can
    /// stick, else that of its angle.
    pub fn mode_of_slipping(&self, x: &Vector4<f64>) -> FrictionMode {
        let equations = self.equations(self.parameters());
        match equations.model.can_stick(equations.injection) {
            true => FrictionMode::Neutral,
            false => equations.mode_at(x),
        }
    }

    /// Whether the steering can stick.
    pub fn can_stick(&self) -> bool {
        let equations = self.equations(self.parameters());
        equations.model.can_stick(equations.injection)
    }

    fn scenario_at<T: Real>(&self, parameters: Parameters<T>) -> Scenario<T> {
        let mut scenario = self.scenario.map(&T::from_f64);
        for (key, value) in self.keys.iter().zip(parameters) {
            if let Some(number) = scenario.number(key) {
                *number = value;
            }
        }
        scenario
    }
}

impl System<4> for Vehicle {
    type Mode = FrictionMode;
    type Equations<T: Real> = Averaged<T>;

    fn equations<T: Real>(&self, parameters: Parameters<T>) -> Averaged<T> {
        let scenario = self.scenario_at(parameters);
        let model = Model::new(&scenario);
        let injection = scenario.dither.injection(T::zero());
        Averaged {
            sign: model.friction_sign(injection),
            values: (model.map(&Real::to_f64), injection.map(Real::to_f64)),
            model,
            injection,
        }
    }

    fn longest_step_s(&self) -> f64 {
        match self.equations(self.parameters()).sign {
            Sign::Stepped { .. } => LONGEST_STEP_S,
            Sign::Zero | Sign::Smooth { .. } => f64::INFINITY,
        }
    }
}

/// The vehicle's equations at given parameters.
#[derive(Debug, Clone)]
pub struct Averaged<T> {
    model: Model<T>,
    injection: Injection<T>,
    sign: Sign<T>,
    /// The same in f64, which decide on modes.
    values: (Model<f64>, Injection<f64>),
}

impl<T: Real> Equations<T, 4> for Averaged<T> {
    type Mode = FrictionMode;

    fn mode_at(&self, x: &Vector4<T>) -> FrictionMode {
        self.model.mode_at(x, self.injection)
    }

    fn derivative(&self, x: &Vector4<T>, mode: FrictionMode) -> Vector4<T> {
        self.model.derivative(x, self.injection, mode)
    }

    fn margins(&self, x: &Vector4<T>, mode: FrictionMode) -> [T; 2] {
        let none = T::from_f64(f64::INFINITY);
        let argument = x[self.model.friction_argument()];
        match (mode, self.sign) {
            (FrictionMode::Sticking, _) => {
                let torque_nm = self.model.driving_torque_nm(x, self.injection);
                let limit_nm = self.model.friction_limit_nm();
                [limit_nm - torque_nm, limit_nm + torque_nm]
            }
            (FrictionMode::Positive, Sign::Stepped { upper, .. }) => [argument - upper, none],
            (FrictionMode::Negative, Sign::Stepped { lower, .. }) => [none, lower - argument],
            (FrictionMode::Neutral, Sign::Stepped { lower, upper }) if lower < upper => {
                [upper - argument, argument - lower]
            }
            _ => [none; 2],
        }
    }

    fn next_mode(&self, x: &mut SVector<T, 4>, mode: FrictionMode, passed: usize) -> FrictionMode {
        let argument = self.model.friction_argument();
        let mut values = x.map(Real::to_f64);
        let (model, injection) = &self.values;
        if mode == FrictionMode::Sticking {
            // By the margin that was passed, not by the torque's sign: that is exactly at its limit.
            return if passed == 0 {
                FrictionMode::Positive
            } else {
                FrictionMode::Negative
            };
        }
        if let Sign::Stepped { lower, upper } = self.sign {
            // Onto the step, and just beyond for the decision.
            let is_upper = match mode {
                FrictionMode::Positive => true,
                FrictionMode::Negative => false,
                _ => passed == 0,
            };
            x[argument] = if is_upper { upper } else { lower };
            let rises =
                mode == FrictionMode::Negative || (mode == FrictionMode::Neutral && is_upper);
            let step = x[argument].to_f64();
            values[argument] = if rises {
                step.next_up()
            } else {
                step.next_down()
            };
        }
        next_mode(model, *injection, mode, &mut values)
    }

    fn is_confined(&self, mode: FrictionMode) -> bool {
        mode == FrictionMode::Sticking
    }
}
