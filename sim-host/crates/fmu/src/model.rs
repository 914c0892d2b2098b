//! The two units: their names, variables and programs.

use crate::ecu::{self, EcuProgram};
use crate::parameters;
use crate::variable::{Causality, Value, Variable};
use crate::vehicle::{self, VehicleProgram};
use pil::plant::InvalidPlant;
use shared_model::{InvalidScenario, Scenario, listed};

listed! {
    /// A unit.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Model {
        /// The ECU's program: control task with gate, and PWM task.
        Ecu => "ecu",
        /// The vehicle with its servo and sensors.
        Vehicle => "vehicle",
    }
}

/// An invalid configuration of a unit.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidModel {
    /// Of the ECU.
    #[error(transparent)]
    Ecu(#[from] InvalidScenario),
    /// Of the vehicle.
    #[error(transparent)]
    Vehicle(#[from] InvalidPlant),
}

impl Model {
    /// The unit of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }

    /// Its identifier: the name of its binary.
    pub fn identifier(self) -> String {
        format!("dithersteer_{}", self.name())
    }

    /// Its variables; the start values are those of the configuration. A variable's place is its
    /// value reference; inputs come first, then outputs, then parameters.
    pub fn variables(self, scenario: &Scenario<f64>) -> Vec<Variable> {
        let (mut variables, outputs) = match self {
            Self::Ecu => (ecu::inputs(scenario), ecu::outputs()),
            Self::Vehicle => (vehicle::inputs(scenario), vehicle::outputs()),
        };
        variables.extend(outputs);
        variables.extend(parameters::of_configuration(scenario));
        if self == Self::Vehicle {
            variables.extend(parameters::of_manoeuvre());
        }
        variables
    }

    /// Checks that the unit runs with the configuration.
    ///
    /// # Errors
    /// If the configuration is invalid.
    pub fn check(self, scenario: &Scenario<f64>) -> Result<(), InvalidModel> {
        let variables = self.variables(scenario);
        let values: Vec<Value> = variables.iter().map(|variable| variable.start).collect();
        Program::new(self, &variables, &values).map(drop)
    }
}

/// The program of a unit, with its state.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    /// Rate of the PWM periods, Hz.
    pub pwm_rate_hz: f64,
    part: Part,
}

#[derive(Debug, Clone)]
enum Part {
    Ecu(Box<EcuProgram>),
    Vehicle(Box<VehicleProgram>),
}

impl Program {
    /// At the start, with these values of the variables.
    pub fn new(
        model: Model,
        variables: &[Variable],
        values: &[Value],
    ) -> Result<Self, InvalidModel> {
        let all = || variables.iter().zip(values.iter().copied());
        let parameters =
            || all().filter(|(variable, _)| variable.causality == Causality::Parameter);
        let scenario = parameters::scenario(parameters());
        let manoeuvre = parameters::manoeuvre(&scenario, parameters());
        let part = match model {
            Model::Ecu => Part::Ecu(Box::new(EcuProgram::new(&scenario, &manoeuvre)?)),
            Model::Vehicle => Part::Vehicle(Box::new(VehicleProgram::new(&scenario, &manoeuvre)?)),
        };
        Ok(Self {
            pwm_rate_hz: scenario.run.pwm_rate_hz,
            part,
        })
    }

    /// Begins a PWM period under these inputs.
    pub fn begin(&mut self, inputs: &[Value]) {
        match &mut self.part {
            Part::Ecu(ecu) => ecu.begin(inputs),
            Part::Vehicle(vehicle) => vehicle.begin(inputs),
        }
    }

    /// Ends the last period that has begun.
    pub fn end(&mut self) {
        match &mut self.part {
            Part::Ecu(ecu) => ecu.end(),
            Part::Vehicle(vehicle) => vehicle.end(),
        }
    }

    /// The outputs, in the order of the variables.
    pub fn outputs(&self) -> Vec<Value> {
        match &self.part {
            Part::Ecu(ecu) => ecu.outputs(),
            Part::Vehicle(vehicle) => vehicle.outputs(),
        }
    }
}
