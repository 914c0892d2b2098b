//! The firmware's log: defmt frames on its console, decoded with the image's symbols.

use crate::pil::elf::Image;
use defmt_decoder::{DecodeError, Table};

/// Decodes an image's log.
pub struct LogDecoder {
    table: Option<Table>,
}

impl LogDecoder {
    /// The decoder for an image's log. An image without defmt symbols has a log of plain text.
    ///
    /// # Errors
    /// If the image's defmt symbols are of a version that this program cannot read.
    pub fn new(image: &Image) -> anyhow::Result<Self> {
        Ok(Self {
            table: Table::parse(&image.bytes)?,
        })
    }

    /// Reads the console to its end; `on_line` sees each line of the log.
    pub fn decode(&self, mut console: impl std::io::Read, mut on_line: impl FnMut(&str)) {
        let mut buffer = [0; 4096];
        let mut decoder = self.table.as_ref().map(Table::new_stream_decoder);
        while let Ok(length @ 1..) = console.read(&mut buffer) {
            let Some(decoder) = &mut decoder else {
                on_line(String::from_utf8_lossy(&buffer[..length]).trim_end());
                continue;
            };
            decoder.received(&buffer[..length]);
            loop {
                match decoder.decode() {
                    Ok(frame) => on_line(&frame.display(false).to_string()),
                    Err(DecodeError::UnexpectedEof) => break,
                    Err(DecodeError::Malformed) => on_line("(a damaged log line)"),
                }
            }
        }
    }
}
