//! A trajectory to be integrated.

use super::tires::offsets;
use shared_model::dither::{Application, Injection};
use shared_model::friction::Sign;
use shared_model::vehicle::{Model, SlipForm, State};
use shared_model::{InvalidScenario, Scenario};

/// Why the engine cannot integrate a scenario.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unsupported {
    /// Its scenario is not valid.
    #[error(transparent)]
    Invalid(#[from] InvalidScenario),
    /// Its friction is smooth, but has no series where the sine ends.
    #[error("the engine does not support friction under the mean of a sine")]
    SmoothFriction,
}

/// A trajectory to be integrated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Task {
    pub model: Model<f64>,
    pub injection: Injection<f64>,
    pub start: State<f64>,
}

impl Task {
    /// The motion of a scenario from its start under the mean of its dither, which is on from then.
    pub fn new(scenario: &Scenario<f64>) -> Result<Self, Unsupported> {
        scenario.validate()?;
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
        let model = Model::new(&averaged);
        let injection = averaged.dither.injection(0.0);
        let mut start = model.initial_state(&averaged);
        start.friction = model.mode_at(&start.x, injection);
        if let Sign::Smooth { .. } = model.friction_sign(injection) {
            return Err(Unsupported::SmoothFriction);
        }
        Ok(Self {
            model,
            injection,
            start,
        })
    }

    /// What all motions of a flight have in common: form of the slip angles, slip angles at which
    /// the Magic Formula is worked out (none for cubic tyres), and the friction law's argument.
    pub fn form(&self) -> (SlipForm, usize, Option<usize>) {
        let probes = offsets(self.model.tires().0, self.injection).len();
        (self.model.constants().slip_form, probes, self.argument())
    }

    /// Index in the state of the friction law's argument, if friction has modes.
    pub(super) fn argument(&self) -> Option<usize> {
        let stepped = matches!(
            self.model.friction_sign(self.injection),
            Sign::Stepped { .. }
        );
        stepped.then(|| self.model.friction_argument())
    }
}
