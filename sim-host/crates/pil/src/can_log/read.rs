//! Reads a log line by line, so that its length takes no memory.

use super::{Format, Frame};
use std::io::BufRead;

/// Longest line, bytes: a frame of 64 bytes takes some 300.
const LONGEST_LINE: u64 = 4096;
/// Payload of a CAN FD frame, bytes.
const LONGEST_DATA: usize = 64;

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("line {line}: {source}")]
    Unreadable {
        /// Its number, from 1 on.
        line: u64,
        /// Why.
        source: std::io::Error,
    },
    /// A line that is none of the format.
    #[error("line {line}: {reason}: {text:?}")]
    Line {
        /// Its number, from 1 on.
        line: u64,
        /// What is wrong.
        reason: &'static str,
        /// Its beginning.
        text: String,
    },
}

/// The data frames of a log. Its format is that of its first line.
pub struct Reader<R> {
    source: R,
    format: Option<Format>,
    hexadecimal: bool,
    line: u64,
}

impl<R: BufRead> Reader<R> {
    /// From the log's beginning.
    pub fn new(source: R) -> Self {
        Self {
            source,
            format: None,
            hexadecimal: true,
            line: 0,
        }
    }

    /// Number of the line that was read last, from 1 on.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// The next data frame; `None` at the end. Remote and error frames are skipped.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is none of the format.
    pub fn next_frame(&mut self) -> Result<Option<Frame>, LogError> {
        let mut bytes = Vec::new();
        loop {
            interrupt::check();
            bytes.clear();
            self.line += 1;
            let mut limited = std::io::Read::take(&mut self.source, LONGEST_LINE);
            let read = limited.read_until(b'\n', &mut bytes);
            let length = read.map_err(|source| LogError::Unreadable {
                line: self.line,
                source,
            })?;
            if length == 0 {
                return Ok(None);
            }
            let text = String::from_utf8_lossy(&bytes);
            let text = text.trim();
            if length as u64 == LONGEST_LINE {
                return Err(self.refuse("it is longer than 4096 bytes", text));
            }
            if text.is_empty() {
                continue;
            }
            let found = match self.format_of(text) {
                Format::Candump => candump(text),
                Format::Asc => self.asc(text),
            };
            match found {
                Ok(Some(frame)) => return Ok(Some(frame)),
                Ok(None) => {}
                Err(reason) => return Err(self.refuse(reason, text)),
            }
        }
    }

    fn format_of(&mut self, text: &str) -> Format {
        *self.format.get_or_insert(match text.starts_with('(') {
            true => Format::Candump,
            false => Format::Asc,
        })
    }

    fn refuse(&self, reason: &'static str, text: &str) -> LogError {
        LogError::Line {
            line: self.line,
            reason,
            text: text.chars().take(60).collect(),
        }
    }

    fn asc(&mut self, text: &str) -> Result<Option<Frame>, &'static str> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let is_header = |name: &str| words[0].eq_ignore_ascii_case(name);
        if is_header("base") {
            self.hexadecimal = words.get(1) != Some(&"dec");
            if words.get(3).is_some_and(|kind| *kind != "absolute") {
                return Err("only absolute times can be read");
            }
            return Ok(None);
        }
        let headers = ["date", "internal", "no", "begin", "end"];
        if headers.into_iter().any(is_header) || words[0].starts_with("//") {
            return Ok(None);
        }
        let time_s = time(words[0])?;
        match words.get(1) {
            Some(&"CANFD") => self.asc_fd(time_s, &words),
            // `1 100 Rx d 8 ..`: a classic frame, which has 8 bytes at most.
            Some(_) if words.get(4) == Some(&"d") => {
                let length = words.get(5).and_then(|length| length.parse().ok());
                let length: usize = length.ok_or("the length is not a number")?;
                let data = self.bytes(words.get(6..).unwrap_or_default(), length)?;
                let identifier = self.identifier(words[2])?;
                Ok(Some(Frame {
                    time_s,
                    identifier,
                    data,
                }))
            }
            // Start of measurement, remote and error frames, statistics.
            _ => Ok(None),
        }
    }

    /// `time CANFD channel direction identifier [name] brs esi dlc length data ..`.
    fn asc_fd(&self, time_s: f64, words: &[&str]) -> Result<Option<Frame>, &'static str> {
        let identifier = self.identifier(words.get(4).ok_or("the frame has no identifier")?)?;
        let is_flag = |at: usize| matches!(words.get(at), Some(&"0" | &"1"));
        // The name may be missing; it is then the first flag that stands here.
        let flags = if is_flag(5) && is_flag(6) { 5 } else { 6 };
        if !is_flag(flags) || !is_flag(flags + 1) {
            return Err("the frame has no flags of bit rate and error state");
        }
        let length = words.get(flags + 3).and_then(|length| length.parse().ok());
        let length: usize = length.ok_or("the length is not a number")?;
        let data = self.bytes(words.get(flags + 4..).unwrap_or_default(), length)?;
        Ok(Some(Frame {
            time_s,
            identifier,
            data,
        }))
    }

    fn identifier(&self, word: &str) -> Result<u32, &'static str> {
        let digits = word.trim_end_matches(['x', 'X']);
        let radix = if self.hexadecimal { 16 } else { 10 };
        u32::from_str_radix(digits, radix).map_err(|_| "the identifier is not a number")
    }

    fn bytes(&self, words: &[&str], length: usize) -> Result<Vec<u8>, &'static str> {
        if length > LONGEST_DATA || words.len() < length {
            return Err("the frame has not as many bytes as it says");
        }
        let radix = if self.hexadecimal { 16 } else { 10 };
        let bytes = words[..length]
            .iter()
            .map(|word| u8::from_str_radix(word, radix));
        bytes
            .collect::<Result<_, _>>()
            .map_err(|_| "a byte is not a number from 0 to 255")
    }
}

/// `(time) interface identifier##flags data`, on CAN FD, or `identifier#data`.
fn candump(text: &str) -> Result<Option<Frame>, &'static str> {
    let mut words = text.split_whitespace();
    let bracketed = words.next().unwrap_or_default();
    let inner = bracketed
        .strip_prefix('(')
        .and_then(|rest| rest.strip_suffix(')'));
    let time_s = time(inner.ok_or("the time is not in brackets")?)?;
    let frame = words.nth(1).ok_or("the line has no frame")?;
    let (identifier, data) = frame.split_once('#').ok_or("the frame has no #")?;
    let identifier =
        u32::from_str_radix(identifier, 16).map_err(|_| "the identifier is not a number")?;
    let data = match data.strip_prefix('#') {
        Some(fd) => fd.get(1..).ok_or("the frame has no flags")?,
        None => data,
    };
    if data.starts_with('R') {
        return Ok(None);
    }
    let digits = data.as_bytes();
    if !digits.len().is_multiple_of(2) || digits.len() > 2 * LONGEST_DATA {
        return Err("the data are not 0 to 64 bytes of two digits each");
    }
    let digit = |digit: &u8| char::from(*digit).to_digit(16).map(|digit| digit as u8);
    let digits = digits.iter().map(digit).collect::<Option<Vec<u8>>>();
    let digits = digits.ok_or("the data are not hexadecimal")?;
    Ok(Some(Frame {
        time_s,
        identifier,
        data: digits
            .chunks(2)
            .map(|pair| pair[0] << 4 | pair[1])
            .collect(),
    }))
}

fn time(word: &str) -> Result<f64, &'static str> {
    let time_s = word.parse().ok().filter(|time_s: &f64| time_s.is_finite());
    time_s.ok_or("the time is not a number")
}
