//! The firmware's log: defmt frames on its console, decoded with the image's symbols.
//!
//! The image may be any program, so the memory for the console's content is bounded.

use defmt_decoder::{DecodeError, Table};
use image::Image;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Maximum frame length, bytes; the firmware's frames have some hundred.
const FRAME_BYTES: usize = 4096;
/// Maximum length of a line, characters.
const LINE_CHARACTERS: usize = 4096;
/// Number of last lines that are stored.
const LINES: usize = 1000;
const DAMAGED: &str = "(a damaged log line)";

/// The symbols of an image's log cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The symbols are damaged.
    #[error("the image's defmt symbols are damaged{}", .0.as_deref().map_or(String::new(), |reason| format!(": {reason}")))]
    Damaged(Option<String>),
    /// Its frames are not delimited.
    #[error(
        "the frames of the image's log are not delimited; build the image with defmt's encoding rzcobs"
    )]
    Encoding,
}

/// Decodes an image's log.
pub struct LogDecoder {
    table: Option<Table>,
}

impl LogDecoder {
    /// The decoder for an image's log. Without defmt symbols the log is not readable.
    ///
    /// # Errors
    /// If the image's defmt symbols are damaged or of a version or encoding that this program
    /// cannot read.
    pub fn new(image: &Image) -> Result<Self, LogError> {
        // Some damage makes the crate panic.
        let Ok(table) = catch_unwind(|| Table::parse(&image.bytes)) else {
            return Err(LogError::Damaged(None));
        };
        let table = table.map_err(|error| LogError::Damaged(Some(format!("{error:#}"))))?;
        let table = table.filter(|table| !table.is_empty());
        if table
            .as_ref()
            .is_some_and(|table| !table.encoding().can_recover())
        {
            return Err(LogError::Encoding);
        }
        Ok(Self { table })
    }

    /// Whether the log is readable; it is not if the image's symbols were stripped.
    pub fn is_readable(&self) -> bool {
        self.table.is_some()
    }

    /// Reads the console to its end; `on_line` is called with each line of the log, if it is
    /// readable.
    pub fn decode(&self, console: &mut dyn std::io::Read, on_line: &mut dyn FnMut(&str)) {
        let mut buffer = [0; 4096];
        let mut stream = Stream::default();
        while let Ok(length @ 1..) = console.read(&mut buffer) {
            self.decode_some(&mut stream, &buffer[..length], on_line);
        }
    }

    /// Decodes the next bytes of a log.
    pub(crate) fn decode_some(
        &self,
        stream: &mut Stream,
        bytes: &[u8],
        on_line: &mut dyn FnMut(&str),
    ) {
        let Some(table) = &self.table else { return };
        let Stream { frame, is_too_long } = stream;
        for piece in bytes.split_inclusive(|&byte| byte == 0) {
            *is_too_long |= frame.len() + piece.len() > FRAME_BYTES;
            if !*is_too_long {
                frame.extend_from_slice(piece);
            }
            if piece.ends_with(&[0]) {
                match std::mem::take(is_too_long) {
                    true => on_line(DAMAGED),
                    false => decode_frame(table, frame, on_line),
                }
                frame.clear();
            }
        }
    }
}

/// The frame of a log that is not complete yet.
#[derive(Debug, Default)]
pub(crate) struct Stream {
    frame: Vec<u8>,
    is_too_long: bool,
}

/// A frame with its terminating zero; consecutive zeros end one frame.
fn decode_frame(table: &Table, frame: &[u8], on_line: &mut dyn FnMut(&str)) {
    // A frame for other symbols can make the crate panic.
    let line = catch_unwind(AssertUnwindSafe(|| {
        let mut decoder = table.new_stream_decoder();
        decoder.received(frame);
        match decoder.decode() {
            Ok(frame) => Some(frame.display(false).to_string()),
            Err(DecodeError::UnexpectedEof) => None,
            Err(DecodeError::Malformed) => Some(DAMAGED.into()),
        }
    }));
    if let Some(mut line) = line.unwrap_or_else(|_| Some(DAMAGED.into())) {
        if let Some((end, _)) = line.char_indices().nth(LINE_CHARACTERS) {
            line.truncate(end);
        }
        on_line(&line);
    }
}

/// The last lines of a log.
#[derive(Debug, Default)]
pub(crate) struct Lines(VecDeque<String>);

impl Lines {
    pub(crate) fn push(&mut self, line: &str) {
        if self.0.len() == LINES {
            self.0.pop_front();
        }
        self.0.push_back(line.into());
    }

    /// The last line.
    pub(crate) fn last(&self) -> String {
        self.0.back().cloned().unwrap_or_else(|| "(none)".into())
    }

    pub(crate) fn into_vec(self) -> Vec<String> {
        self.0.into()
    }
}
