//! The manoeuvres on which faults are injected.

use crate::manoeuvre::{self, Manoeuvre, ManoeuvreError};
use shared_model::Scenario;

macro_rules! example {
    ($name:literal) => {
        include_str!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/examples/manoeuvres/",
            $name,
            ".toml"
        ))
    };
}

/// Files of the manoeuvres.
const FILES: [&str; 8] = [
    example!("constant-speed"),
    example!("constant-speed-sine"),
    example!("speed-ramp"),
    example!("step-steer"),
    example!("sine-steer"),
    example!("low-resolution-noise"),
    example!("obeyed-speed-limit"),
    example!("delayed-feedback"),
];

/// All manoeuvres, each with its scenario.
///
/// # Errors
/// If one of the files is invalid.
pub fn all() -> Result<Vec<(Scenario<f64>, Manoeuvre)>, ManoeuvreError> {
    FILES.into_iter().map(manoeuvre::from_text).collect()
}
