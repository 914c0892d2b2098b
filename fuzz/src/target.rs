//! A reader under test, and the limits that it is held to.

/// A reader.
pub struct Target {
    /// Its name, and that of its folder in the corpus.
    pub name: &'static str,
    /// Reads the bytes, and processes the result up to where every command does.
    pub read: fn(&[u8]),
    /// Repairs checksums and frames; other damage stays.
    pub repair: fn(&mut Vec<u8>),
    /// Inputs that are right.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Most bytes of memory for a byte of input, beyond [`FLOOR`].
    pub multiple: u64,
    /// Mutations that the short run makes: fewer where one takes long.
    pub mutations: u32,
}

/// Memory that a reader may take however short its input is, bytes: a scenario as text and tables,
/// and buffers.
pub const FLOOR: u64 = 512 * 1024;

/// No repair.
pub(crate) fn as_it_is(_: &mut Vec<u8>) {}

impl Target {
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
