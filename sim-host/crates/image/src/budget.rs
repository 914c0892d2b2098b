//! Limits on reading an image. A damaged image may claim that all symbols have the same name of a
//! megabyte, or that all functions are the same code. The number of bytes read is bounded by the
//! length of the file.

use crate::AnalysisError;
use object::{Object, ObjectSection, ObjectSymbol};

/// Maximum number of bytes read, as a multiple of the file's length. Images from a linker need less
/// than one.
const TIMES: u64 = 8;

/// Bytes that may still be read.
pub(crate) struct Budget {
    left: u64,
    what: &'static str,
}

impl Budget {
    /// For an image of that length; `what` is read is for the message.
    pub(crate) fn new(length: usize, what: &'static str) -> Self {
        Self {
            left: TIMES * length as u64,
            what,
        }
    }

    /// Takes some of it.
    pub(crate) fn spend(&mut self, bytes: u64) -> Result<(), AnalysisError> {
        let left = self.left.checked_sub(bytes);
        self.left = left.ok_or(AnalysisError::Overlap(self.what))?;
        Ok(())
    }
}

/// An image whose names can all be read.
///
/// # Errors
/// If it is not an ELF file, or its names together are many times as long as the file.
pub(crate) fn parse(bytes: &[u8]) -> Result<object::File<'_>, AnalysisError> {
    let file = object::File::parse(bytes)?;
    let mut names = Budget::new(bytes.len(), "names");
    for symbol in file.symbols() {
        names.spend(symbol.name_bytes().map_or(0, |name| name.len() as u64))?;
    }
    for section in file.sections() {
        names.spend(section.name_bytes().map_or(0, |name| name.len() as u64))?;
    }
    Ok(file)
}
