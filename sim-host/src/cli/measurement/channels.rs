//! Channels by their names, which carry the unit.

use dynamics::unit::Unit;
use mdf4::{Channel, Samples};
use shared_model::friction::FrictionMode;
use std::fmt::Debug;

/// A channel; the end of its name determines the unit.
pub fn channel<'a>(name: &str, comment: &str, samples: Samples<'a>) -> Channel<'a> {
    Channel {
        name: name.into(),
        unit: Unit::of(name).map_or("", |unit| unit.symbol),
        comment: comment.into(),
        samples,
    }
}

/// The channel of the friction's mode.
pub fn friction_mode<'a>(of: impl Fn(usize) -> FrictionMode + 'a) -> Channel<'a> {
    let names = FrictionMode::ALL.map(|mode| (mode as u8, name(&mode)));
    let samples = Samples::Name(Box::new(move |k| of(k) as u8), names.to_vec());
    channel("friction_mode", "Mode of the dry friction.", samples)
}

/// The name of a value as the CSV has it.
pub fn name(value: &impl Debug) -> String {
    format!("{value:?}").to_lowercase()
}
