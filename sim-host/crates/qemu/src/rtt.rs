//! The log of an image without semihosting: SEGGER's Real-Time Transfer (RTT), a ring in the RAM
//! that a debugger empties.
//!
//! Layout of the control block at `_SEGGER_RTT`: 16 bytes of identification, the number of channels
//! up and down, then for each channel name, buffer, size, write offset, read offset and flags, words
//! of four bytes. The program writes the write offset, the debugger the read offset.

use crate::gdb::Gdb;
use crate::socket::SocketError;
use image::Image;

const IDENTIFICATION: &[u8] = b"SEGGER RTT";
/// Offsets in the control block.
const BUFFER: u32 = 28;
const WRITE: u32 = 36;
const READ: u32 = 40;
/// Largest ring that is believed, bytes.
const LARGEST: u32 = 64 * 1024;

/// The first channel up.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Channel {
    block: u32,
}

impl Channel {
    /// The channel of an image; `None` if it has none.
    pub fn of(image: &Image) -> Option<Self> {
        image.address_of("_SEGGER_RTT").map(|block| Self { block })
    }

    /// Takes the bytes that the program has written; none before it has started.
    ///
    /// # Errors
    /// If the stub does not answer. The core must be stopped.
    pub fn take(self, gdb: &mut Gdb) -> Result<Vec<u8>, SocketError> {
        let block = gdb.read_memory(self.block, READ as usize + 4)?;
        if !block.starts_with(IDENTIFICATION) {
            return Ok(Vec::new());
        }
        let word = |at: u32| {
            let bytes = block.get(at as usize..at as usize + 4);
            let bytes = bytes.and_then(|bytes| bytes.try_into().ok());
            u32::from_le_bytes(bytes.unwrap_or_default())
        };
        let (buffer, size) = (word(BUFFER), word(BUFFER + 4));
        let (write, read) = (word(WRITE), word(READ));
        if write == read || size > LARGEST || write >= size || read >= size {
            return Ok(Vec::new());
        }
        let parts = if write > read {
            [(read, write), (0, 0)]
        } else {
            [(read, size), (0, write)]
        };
        let mut bytes = Vec::new();
        for (start, end) in parts.into_iter().filter(|(start, end)| start < end) {
            bytes.extend(gdb.read_memory(buffer + start, (end - start) as usize)?);
        }
        gdb.write_memory(self.block + READ, &write.to_le_bytes())?;
        Ok(bytes)
    }

    /// Fills the ring for a program that then finds no room.
    ///
    /// # Errors
    /// If the stub does not answer. The core must be stopped.
    pub fn fill(self, gdb: &mut Gdb) -> Result<(), SocketError> {
        let write = gdb.read_memory(self.block + WRITE, 4)?;
        let write = u32::from_le_bytes(write.try_into().unwrap_or_default());
        gdb.write_memory(self.block + READ, &(write + 1).to_le_bytes())
    }
}
