//! The firmware's telemetry.

use files::input;
use shared_model::telemetry::{
    FrameError, HEADER_LEN, Header, Record, TRAILER_LEN, Trailer, is_trailer, record_len,
};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A complete run, recorded by the firmware.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Rates and units of the records.
    pub header: Header,
    /// One record per model step.
    pub records: Vec<Record>,
    /// All duty codes in order.
    pub duties: Vec<u16>,
    /// How the run ended.
    pub trailer: Trailer,
}

/// An error of reading telemetry.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The file cannot be read.
    #[error("cannot read the telemetry {path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A frame is damaged.
    #[error("telemetry is damaged at byte {offset} ({frame}): {error}")]
    Damaged {
        /// First byte of the frame.
        offset: usize,
        /// The frame.
        frame: String,
        /// The error.
        error: FrameError,
    },
    /// A duty code that exceeds the period of its timer.
    #[error(
        "telemetry is wrong at record {record}: duty code {code} of a PWM period of {period} counts"
    )]
    Duty {
        /// The record.
        record: u32,
        /// The code.
        code: u16,
        /// The period, counts.
        period: u16,
    },
    /// A record is missing.
    #[error("telemetry is incomplete: record {found} follows record {last}")]
    Gap {
        /// The preceding record.
        last: u32,
        /// The record found.
        found: u32,
    },
    /// The trailer's count is not that of the records.
    #[error("telemetry is incomplete: {found} records, but the firmware wrote {written}")]
    Count {
        /// Records in the stream.
        found: usize,
        /// Records that the firmware counted.
        written: u32,
    },
    /// There are bytes after the trailer.
    #[error("telemetry continues after its trailer: bytes {bytes}")]
    Excess {
        /// Number of bytes.
        bytes: usize,
    },
}

impl Recording {
    /// Reads a telemetry file.
    ///
    /// # Errors
    /// If it cannot be read, is truncated, or is damaged.
    pub fn open(path: &Path) -> Result<Self, TelemetryError> {
        let is_header = |start: &[u8]| Header::decode(start).is_ok();
        let bytes = input::read(path, input::RECORDING_BYTES, is_header).map_err(|source| {
            TelemetryError::Unreadable {
                path: path.to_path_buf(),
                source,
            }
        })?;
        Self::decode(&bytes)
    }

    /// Reads only the trailer at the end of a telemetry file.
    ///
    /// # Errors
    /// If the file cannot be read, or does not end with a trailer.
    pub fn last_trailer(path: &Path) -> Result<Trailer, TelemetryError> {
        let read = || {
            let mut file = File::open(path)?;
            let length = file.metadata()?.len();
            let mut bytes = Vec::with_capacity(TRAILER_LEN);
            file.seek(SeekFrom::Start(length.saturating_sub(TRAILER_LEN as u64)))?;
            file.take(TRAILER_LEN as u64).read_to_end(&mut bytes)?;
            Ok((length as usize, bytes))
        };
        let (length, bytes) = read().map_err(|source| TelemetryError::Unreadable {
            path: path.to_path_buf(),
            source,
        })?;
        let offset = length.saturating_sub(TRAILER_LEN);
        Trailer::decode(&bytes).map_err(|error| damaged(offset, "trailer", error))
    }

    /// Reads a telemetry stream.
    ///
    /// # Errors
    /// If it is truncated or damaged.
    pub fn decode(bytes: &[u8]) -> Result<Self, TelemetryError> {
        let header = Header::decode(bytes).map_err(|error| damaged(0, "header", error))?;
        let length = record_len(header.samples_per_step);
        let mut records = Vec::with_capacity(bytes.len() / length);
        let mut duties =
            Vec::with_capacity(records.capacity() * usize::from(header.samples_per_step));
        let mut offset = HEADER_LEN;
        let mut gap = None;
        while !is_trailer(&bytes[offset..]) {
            let last = records.last().map_or(0, |record: &Record| record.index);
            let duty = |code| duties.push(code);
            let record = Record::decode(&bytes[offset..], header.samples_per_step, duty)
                .map_err(|error| damaged(offset, &format!("after record {last}"), error))?;
            let found = record.index;
            if last.checked_add(1) != Some(found) {
                gap.get_or_insert(TelemetryError::Gap { last, found });
            }
            let of_record = &duties[duties.len() - usize::from(header.samples_per_step)..];
            if let Some(&code) = of_record.iter().find(|&&code| code > header.pwm_period) {
                return Err(TelemetryError::Duty {
                    record: found,
                    code,
                    period: header.pwm_period,
                });
            }
            records.push(record);
            offset += length;
        }
        let trailer =
            Trailer::decode(&bytes[offset..]).map_err(|error| damaged(offset, "trailer", error))?;
        let excess = bytes.len() - offset - TRAILER_LEN;
        if excess > 0 {
            return Err(TelemetryError::Excess { bytes: excess });
        }
        // Records that the firmware itself counted as lost are missing in an intact stream.
        if let (Some(gap), 0) = (gap, trailer.overruns) {
            return Err(gap);
        }
        // After a fault, the firmware could not write its last records.
        if trailer.exit_code == 0 && trailer.records as usize != records.len() {
            return Err(TelemetryError::Count {
                found: records.len(),
                written: trailer.records,
            });
        }
        Ok(Self {
            header,
            records,
            duties,
            trailer,
        })
    }

    /// Instructions in `counts` of the cost clock; counts themselves where the core is not
    /// simulated.
    pub fn instructions(&self, counts: u16) -> u32 {
        let clock = f64::from(self.header.cost_clock_hz);
        match self.header.instruction_rate_hz {
            0 => counts.into(),
            rate => (f64::from(counts) * f64::from(rate) / clock).round() as u32,
        }
    }
}

fn damaged(offset: usize, frame: &str, error: FrameError) -> TelemetryError {
    TelemetryError::Damaged {
        offset,
        frame: frame.into(),
        error,
    }
}
