//! An instance of a unit: the state machine of the standard (FMI 2.0.4, section 4.2.4), without
//! pointers.

use crate::archive::CONFIGURATION;
use crate::clock::Clock;
use crate::description::guid;
use crate::location;
use crate::model::{Model, Program};
use crate::variable::{Causality, Value, Variable};
use dynamics::config;
use files::input;
use std::collections::BTreeMap;

/// Why a call was refused.
pub type Refusal = String;

/// Phase of an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Parameters are set.
    Instantiated,
    /// The last parameters and inputs are set; outputs can be read.
    Initialisation,
    /// Steps are made.
    Running,
    /// The simulation has ended.
    Terminated,
    /// A call was refused.
    Failed,
}

impl Phase {
    fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "before the initialisation",
            Self::Initialisation => "in the initialisation",
            Self::Running => "in the simulation",
            Self::Terminated => "after fmi2Terminate; call fmi2Reset first",
            Self::Failed => {
                "after a call that returned fmi2Error; call fmi2Reset or fmi2SetFMUstate first"
            }
        }
    }
}

/// What a stored state holds.
#[derive(Debug, Clone)]
struct State {
    phase: Phase,
    /// One of each variable.
    values: Vec<Value>,
    clock: Clock,
    /// `None` until it is needed, and after a parameter was set.
    program: Option<Program>,
}

/// An instance of a unit.
#[derive(Debug)]
pub struct Instance {
    model: Model,
    variables: Vec<Variable>,
    now: State,
    /// States that the master has stored, by number.
    stored: BTreeMap<usize, State>,
    next_number: usize,
}

impl Instance {
    /// An instance of the unit whose description has the fingerprint `guid`, with its resources at
    /// a URI.
    ///
    /// # Errors
    /// If the resources cannot be read, or are not those of the description and this version.
    pub fn new(own_guid: &str, resources: &str) -> Result<Self, Refusal> {
        let path = location::path(resources)?.join(CONFIGURATION);
        let text = input::read_text(&path, input::TEXT_BYTES)
            .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let scenario =
            config::from_toml(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        let model = Model::ALL
            .into_iter()
            .find(|model| guid(*model, &scenario) == own_guid)
            .ok_or_else(|| {
                let known = Model::ALL.map(|model| guid(model, &scenario));
                format!(
                    "GUID {own_guid:?}: must be that of this version and configuration, {} or {}; write the FMU again by \
                     `sim-host fmu`",
                    known[0], known[1]
                )
            })?;
        let variables = model.variables(&scenario);
        Ok(Self {
            now: State::initial(&variables)?,
            model,
            variables,
            stored: BTreeMap::new(),
            next_number: 1,
        })
    }

    fn require(&self, allowed: &[Phase]) -> Result<(), Refusal> {
        if allowed.contains(&self.now.phase) {
            return Ok(());
        }
        Err(format!("not allowed {}", self.now.phase.name()))
    }

    /// Start and, if there is one, end of the experiment, s.
    ///
    /// # Errors
    /// If they are no times, or the phase is wrong.
    pub fn set_up_experiment(&mut self, start_s: f64, stop_s: Option<f64>) -> Result<(), Refusal> {
        self.require(&[Phase::Instantiated])?;
        self.now.clock = Clock::new(start_s, stop_s)?;
        Ok(())
    }

    /// Begins the initialisation.
    ///
    /// # Errors
    /// If the phase is wrong.
    pub fn enter_initialisation(&mut self) -> Result<(), Refusal> {
        self.require(&[Phase::Instantiated])?;
        self.now.phase = Phase::Initialisation;
        Ok(())
    }

    /// Ends it.
    ///
    /// # Errors
    /// If the parameters are inconsistent, or the phase is wrong.
    pub fn exit_initialisation(&mut self) -> Result<(), Refusal> {
        self.require(&[Phase::Initialisation])?;
        self.prepare()?;
        self.now.phase = Phase::Running;
        Ok(())
    }

    /// Makes the program from the parameters, unless it is there, and computes its outputs.
    fn prepare(&mut self) -> Result<(), Refusal> {
        if self.now.program.is_none() {
            let program = Program::new(self.model, &self.variables, &self.now.values);
            let program = program.map_err(|error| error.to_string())?;
            self.now.program = Some(program);
            self.read_outputs();
        }
        Ok(())
    }

    fn read_outputs(&mut self) {
        let Some(program) = &self.now.program else {
            return;
        };
        let all = self.variables.iter().zip(&mut self.now.values);
        let places = all.filter(|(variable, _)| variable.causality == Causality::Output);
        for ((_, place), value) in places.zip(program.outputs()) {
            *place = value;
        }
    }

    fn variable(&self, reference: u32) -> Result<(usize, &Variable), Refusal> {
        let index = reference as usize;
        let variable = self.variables.get(index).ok_or_else(|| {
            format!(
                "value reference {reference}: must be from 0 to {}",
                self.variables.len() - 1
            )
        })?;
        Ok((index, variable))
    }

    /// The value of a variable.
    ///
    /// # Errors
    /// If there is no such variable, or its value cannot be computed.
    pub fn get(&mut self, reference: u32) -> Result<Value, Refusal> {
        let (index, variable) = self.variable(reference)?;
        if variable.causality == Causality::Output && self.now.phase == Phase::Initialisation {
            self.prepare()?;
        }
        Ok(self.now.values[index])
    }

    /// The name of a variable, for messages.
    ///
    /// # Errors
    /// If there is no such variable.
    pub fn name(&self, reference: u32) -> Result<&str, Refusal> {
        Ok(&self.variable(reference)?.1.name)
    }

    /// Sets a variable.
    ///
    /// # Errors
    /// If there is no such variable, it cannot be set in this phase, or the value is not allowed.
    pub fn set(&mut self, reference: u32, value: Value) -> Result<(), Refusal> {
        let (index, variable) = self.variable(reference)?;
        let before_the_run = [Phase::Instantiated, Phase::Initialisation];
        match variable.causality {
            Causality::Input => {
                self.require(&[Phase::Instantiated, Phase::Initialisation, Phase::Running])
            }
            Causality::Parameter => self.require(&before_the_run),
            Causality::Output => Err("an output cannot be set".to_owned()),
        }
        .map_err(|refusal| format!("{}: {refusal}", variable.name))?;
        variable.check(value)?;
        if variable.causality == Causality::Parameter {
            self.now.program = None;
        }
        self.now.values[index] = value;
        Ok(())
    }

    /// Steps from `time_s`, which must be the present time, by `step_s`.
    ///
    /// # Errors
    /// If one of them is not allowed, or the phase is wrong.
    pub fn step(&mut self, time_s: f64, step_s: f64) -> Result<(), Refusal> {
        self.require(&[Phase::Running])?;
        let State {
            values,
            clock,
            program: Some(program),
            ..
        } = &mut self.now
        else {
            return Err("not initialised".to_owned());
        };
        let periods = clock.step(time_s, step_s, program.pwm_rate_hz)?;
        let inputs = self.variables.iter();
        let inputs = inputs.take_while(|variable| variable.causality == Causality::Input);
        let inputs = &values[..inputs.count()];
        for _ in 0..periods.begin {
            program.begin(inputs);
        }
        if periods.ends {
            program.end();
        }
        self.read_outputs();
        Ok(())
    }

    /// The present time, s.
    pub fn time_s(&self) -> f64 {
        self.now.clock.time_s()
    }

    /// Ends the simulation.
    ///
    /// # Errors
    /// If the phase is wrong.
    pub fn terminate(&mut self) -> Result<(), Refusal> {
        self.require(&[Phase::Running])?;
        self.now.phase = Phase::Terminated;
        Ok(())
    }

    /// As new. Stored states remain.
    ///
    /// # Errors
    /// None.
    pub fn reset(&mut self) -> Result<(), Refusal> {
        self.now = State::initial(&self.variables)?;
        Ok(())
    }

    /// After a call was refused.
    pub fn fail(&mut self) {
        self.now.phase = Phase::Failed;
    }

    /// Stores the present state, in the place of that number if there is one. Returns its number,
    /// which is not 0.
    pub fn store(&mut self, number: usize) -> usize {
        let number = if self.stored.contains_key(&number) {
            number
        } else {
            self.next_number += 1;
            self.next_number - 1
        };
        self.stored.insert(number, self.now.clone());
        number
    }

    /// Returns to a stored state.
    ///
    /// # Errors
    /// If there is none of that number.
    pub fn restore(&mut self, number: usize) -> Result<(), Refusal> {
        let stored = self.stored.get(&number);
        self.now = stored
            .ok_or("no state of this instance, or one that was freed")?
            .clone();
        Ok(())
    }

    /// Discards a stored state.
    ///
    /// # Errors
    /// If there is none of that number.
    pub fn discard(&mut self, number: usize) -> Result<(), Refusal> {
        let stored = self.stored.remove(&number);
        stored.ok_or("no state of this instance, or one that was freed")?;
        Ok(())
    }
}

impl State {
    fn initial(variables: &[Variable]) -> Result<Self, Refusal> {
        Ok(Self {
            phase: Phase::Instantiated,
            values: variables.iter().map(|variable| variable.start).collect(),
            clock: Clock::new(0.0, None)?,
            program: None,
        })
    }
}
