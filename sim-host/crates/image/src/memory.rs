//! The memory map of a board.

use crate::AnalysisError;
use object::{Object, ObjectSymbol};

/// Address of a linker script's symbol.
pub(crate) fn address_of(
    file: &object::File<'_>,
    name: &'static str,
) -> Result<u64, AnalysisError> {
    let symbol = file.symbol_by_name(name);
    Ok(symbol.ok_or(AnalysisError::NoSymbol(name))?.address())
}

/// An invalid memory map.
#[derive(Debug, thiserror::Error)]
#[error("the memory map has no line `{0} : ORIGIN = ..., LENGTH = ...`")]
pub struct InvalidMap(&'static str);

/// A board's memory map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Map {
    /// Length of the flash, bytes.
    pub flash_bytes: u64,
    /// Length of the RAM, bytes.
    pub ram_bytes: u64,
}

impl Map {
    /// Reads the text of a board's `memory.x`, the linker's own file.
    ///
    /// # Errors
    /// If flash or RAM is missing.
    pub fn parse(text: &str) -> Result<Self, InvalidMap> {
        let length = |name| length(text, name).ok_or(InvalidMap(name));
        Ok(Self {
            flash_bytes: length("FLASH")?,
            ram_bytes: length("RAM")?,
        })
    }
}

fn length(text: &str, region: &str) -> Option<u64> {
    text.lines().find_map(|line| {
        let (name, rest) = line.split_once(':')?;
        let (_, length) = rest.split_once("LENGTH")?;
        let length = length.trim_start().strip_prefix('=')?.trim();
        // Attributes such as `(rx)` may follow the name.
        let is_region = name.split_whitespace().next() == Some(region);
        is_region.then(|| number(length))?
    })
}

/// A number in the syntax of linker scripts: `0x20000`, `131072`, `128K`, `1M`.
fn number(text: &str) -> Option<u64> {
    let (digits, unit) = match text.strip_suffix(['K', 'k']) {
        Some(digits) => (digits, 1 << 10),
        None => match text.strip_suffix(['M', 'm']) {
            Some(digits) => (digits, 1 << 20),
            None => (text, 1),
        },
    };
    let number = match digits.strip_prefix("0x") {
        Some(hexadecimal) => u64::from_str_radix(hexadecimal, 16),
        None => digits.parse(),
    };
    Some(number.ok()? * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_read() {
        let map = Map::parse(
            "/* FLASH : a comment */\nMEMORY\n{\n  FLASH (rx) : ORIGIN = 0x0, LENGTH = 512K\n  RAM : ORIGIN = 0x20000000, LENGTH = 0x20000\n}\n",
        );
        assert_eq!(
            map.unwrap(),
            Map {
                flash_bytes: 524_288,
                ram_bytes: 131_072
            }
        );
        let error = Map::parse("FLASH : ORIGIN = 0, LENGTH = 1M").unwrap_err();
        assert!(error.to_string().contains("RAM"));
    }
}
