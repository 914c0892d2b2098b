//! Hostile bytes for every reader of what comes from outside.
//!
//! A [`Target`] is a reader with what has to be known to reach the code behind its check sums. The test `replay` runs the
//! corpus and a fixed number of mutations of each through [`Target::check`], the same ones every time; the driver `guided`
//! leads libFuzzer there, which looks for inputs that reach new code (`cargo xtask fuzz`). Both hold a reader to the same:
//! no panic, and no more memory than a multiple of its input. That it ends is what a run that does not hang shows.

mod images;
mod links;
mod maps;
pub mod mutate;
mod runs;
mod target;
mod texts;

pub use target::{FLOOR, Target};

/// All of them.
pub const TARGETS: &[Target] = &[
    runs::TELEMETRY,
    runs::RECORDING,
    maps::TILE,
    maps::PARQUET,
    texts::CONFIGURATION,
    texts::MANOEUVRE,
    texts::RECORD,
    texts::SETTINGS,
    links::SERIAL,
    links::FRAMES,
    images::ELF,
    images::LOG,
];

impl Target {
    /// The target of that name.
    pub fn find(name: &str) -> Option<&'static Self> {
        TARGETS.iter().find(|target| target.name == name)
    }
}
