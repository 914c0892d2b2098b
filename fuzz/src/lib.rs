//! Hostile bytes for every reader of external data.
//!
//! A [`Target`] is a reader with the repair of checksums and frames that lets inputs reach its
//! inner code. The test `replay` runs the corpus and a fixed number of mutations of each through
//! [`Target::check`], the same ones every time; the driver `guided` leads libFuzzer there, which
//! looks for inputs that reach new code (`cargo xtask fuzz`). Both require the same of a reader: no
//! panic, and memory within a multiple of its input. A run that ends shows that every reader does.

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
