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
mod texts;

/// A reader.
pub struct Target {
    /// Its name, and that of its folder in the corpus.
    pub name: &'static str,
    /// Reads the bytes, and does with what is read what a command does at least.
    pub read: fn(&[u8]),
    /// Makes check sums and frames right again; what is not to be repaired stays.
    pub repair: fn(&mut Vec<u8>),
    /// Inputs that are right.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Most bytes of memory for a byte of input, beyond [`FLOOR`].
    pub multiple: u64,
    /// Mutations that the short run makes: fewer where one takes long.
    pub mutations: u32,
}

/// Memory that a reader may take however short its input is, bytes: a scenario as text and tables, and buffers.
pub const FLOOR: u64 = 512 * 1024;

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

/// No repair.
fn as_it_is(_: &mut Vec<u8>) {}

impl Target {
    /// The target of that name.
    pub fn find(name: &str) -> Option<&'static Self> {
        TARGETS.iter().find(|target| target.name == name)
    }

    /// Reads the bytes.
    ///
    /// # Panics
    /// If the reader does, or takes more memory than it may.
    pub fn check(&self, bytes: &[u8]) {
        let taken = allocation_counter::measure(|| (self.read)(bytes)).bytes_max;
        let most = self.multiple * bytes.len() as u64 + FLOOR;
        assert!(
            taken <= most,
            "{}: {taken} bytes of memory for {} of input; {most} are allowed",
            self.name,
            bytes.len()
        );
    }

    /// Whether the bytes can be read without a panic and in the memory that they may take.
    pub fn passes(&self, bytes: &[u8]) -> bool {
        std::panic::catch_unwind(|| self.check(bytes)).is_ok()
    }
}
