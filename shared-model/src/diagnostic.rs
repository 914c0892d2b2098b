//! The ECU's diagnostic frame: start-up and fault history, in turn on the bus; and the history
//! itself, in RAM that survives a reset.
//!
//! | bytes | status (kind 0) | fault record (kind 1) |
//! |---|---|---|
//! | 0..3 | checksum and counter, see [`e2e`](crate::e2e) | the same |
//! | 3 | kind | kind |
//! | 4 | reset cause | index, 0 is the newest |
//! | 5 | configuration: 0, or the number of its error | program fault |
//! | 6..8 | resets by faults in a row | number of the start in which it happened |
//! | 8..12 | starts since power-on | faults of the gate |
//! | 12..16 | control ticks since the start | control ticks from that start to the fault |
//! | 16..24 | 0 | 0 |

use crate::e2e::Sender;
use crate::exchange::FrameBytes;
use crate::listed;

/// Data ID of diagnostic frames.
pub const DIAGNOSTIC_DATA_ID: u16 = 0x5A03;

listed! {
    /// Cause of a reset, from the chip's registers where it has them.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[repr(u8)]
    pub enum ResetCause {
        /// The chip or the emulator does not report it.
        Unknown = 0 => "unknown",
        /// Supply switched on, or below its threshold (brown-out).
        Power = 1 => "power",
        /// The reset pin.
        Pin = 2 => "pin",
        /// By the program, after a fault.
        Program = 3 => "program",
        /// By the watchdog.
        Watchdog = 4 => "watchdog",
    }
}

/// A fault of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Record {
    /// What ended the program: the number of the firmware's fault; 0 in an empty record.
    pub fault: u8,
    /// Number of the start in which it happened, from 1.
    pub start: u16,
    /// Faults of the gate at that time, one bit each.
    pub gate_faults: u32,
    /// Control ticks from the start to the fault.
    pub ticks: u32,
}

/// Records that are kept.
pub const RECORDS: usize = 4;
/// Words of a history in memory.
pub const HISTORY_WORDS: usize = 3 + 3 * RECORDS + 1;
const MAGIC: u32 = 0x4453_4831;
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Starts and faults since power-on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct History {
    /// Starts since power-on, this one included.
    pub starts: u32,
    /// Resets by faults in a row, without a longer run in between.
    pub faults_in_a_row: u32,
    /// The last faults, the newest first.
    pub records: [Record; RECORDS],
}

impl History {
    /// The history in the words that a reset left; `None` if they are none, as after power-on.
    pub fn from_words(words: &[u32; HISTORY_WORDS]) -> Option<Self> {
        let [magic, starts, faults_in_a_row, rest @ .., checksum] = words;
        if *magic != MAGIC || *checksum != checksum_of(words) {
            return None;
        }
        let (chunks, _) = rest.as_chunks::<3>();
        let mut records = [Record::default(); RECORDS];
        for (record, [head, gate_faults, ticks]) in records.iter_mut().zip(chunks) {
            let [fault, start_low, start_high, _] = head.to_le_bytes();
            *record = Record {
                fault,
                start: u16::from_le_bytes([start_low, start_high]),
                gate_faults: *gate_faults,
                ticks: *ticks,
            };
        }
        Some(Self {
            starts: *starts,
            faults_in_a_row: *faults_in_a_row,
            records,
        })
    }

    /// Its words.
    ///
    /// ```
    /// use shared_model::diagnostic::{History, Record};
    /// let mut history = History::default();
    /// history.add(Record { fault: 2, start: 1, gate_faults: 64, ticks: 1000 });
    /// let mut words = history.to_words();
    /// assert_eq!(History::from_words(&words), Some(history));
    /// words[5] ^= 1;
    /// assert_eq!(History::from_words(&words), None);
    /// ```
    pub fn to_words(&self) -> [u32; HISTORY_WORDS] {
        let mut words = [0; HISTORY_WORDS];
        let [magic, starts, faults_in_a_row, rest @ .., _] = &mut words;
        (*magic, *starts, *faults_in_a_row) = (MAGIC, self.starts, self.faults_in_a_row);
        let (chunks, _) = rest.as_chunks_mut::<3>();
        for (record, chunk) in self.records.iter().zip(chunks) {
            let [start_low, start_high] = record.start.to_le_bytes();
            *chunk = [
                u32::from_le_bytes([record.fault, start_low, start_high, 0]),
                record.gate_faults,
                record.ticks,
            ];
        }
        let sum = checksum_of(&words);
        let [.., checksum] = &mut words;
        *checksum = sum;
        words
    }

    /// Adds a record; the oldest goes.
    pub fn add(&mut self, record: Record) {
        let [a, b, c, _] = self.records;
        self.records = [record, a, b, c];
        self.faults_in_a_row = self.faults_in_a_row.saturating_add(1);
    }
}

/// Of all words but the last.
fn checksum_of(words: &[u32; HISTORY_WORDS]) -> u32 {
    let [covered @ .., _] = words;
    let mut digest = CHECKSUM.digest();
    for word in covered {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

/// Content of a diagnostic frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Diagnostic {
    /// The present start.
    Status {
        /// Cause of the last reset.
        reset_cause: ResetCause,
        /// 0, or [the number of the error](crate::configuration::ConfigurationError::code).
        configuration: u8,
        /// Resets by faults in a row; from [`FAULTS_IN_A_ROW`] on the ECU stays in its safe state.
        faults_in_a_row: u16,
        /// Starts since power-on.
        starts: u32,
        /// Control ticks since the start.
        ticks: u32,
    },
    /// A record of the history.
    Fault {
        /// 0 is the newest.
        index: u8,
        /// The record.
        record: Record,
    },
}

/// Resets by faults in a row after which the ECU stays in its safe state until power-on.
pub const FAULTS_IN_A_ROW: u32 = 3;

/// The frame of a diagnostic.
pub fn encode_diagnostic(diagnostic: &Diagnostic, sender: &mut Sender) -> FrameBytes {
    let (kind, head, a, b) = match *diagnostic {
        Diagnostic::Status {
            reset_cause,
            configuration,
            faults_in_a_row,
            starts,
            ticks,
        } => {
            let [low, high] = faults_in_a_row.to_le_bytes();
            (
                0,
                [reset_cause as u8, configuration, low, high],
                starts,
                ticks,
            )
        }
        Diagnostic::Fault { index, record } => {
            let [low, high] = record.start.to_le_bytes();
            let head = [index, record.fault, low, high];
            (1, head, record.gate_faults, record.ticks)
        }
    };
    let ([h0, h1, h2, h3], [a0, a1, a2, a3], [b0, b1, b2, b3]) =
        (head, a.to_le_bytes(), b.to_le_bytes());
    let mut frame = [
        0, 0, 0, kind, h0, h1, h2, h3, a0, a1, a2, a3, b0, b1, b2, b3, 0, 0, 0, 0, 0, 0, 0, 0,
    ];
    sender.protect(&mut frame);
    frame
}

/// The diagnostic in a frame whose check was [ok](crate::e2e::Status::is_ok); `None` if it is of
/// another version.
///
/// ```
/// use shared_model::diagnostic::{DIAGNOSTIC_DATA_ID, Diagnostic, Record, decode_diagnostic, encode_diagnostic};
/// use shared_model::e2e::Sender;
/// let record = Record { fault: 3, start: 7, gate_faults: 0x40, ticks: 123_456 };
/// let diagnostic = Diagnostic::Fault { index: 1, record };
/// let frame = encode_diagnostic(&diagnostic, &mut Sender::new(DIAGNOSTIC_DATA_ID));
/// assert_eq!(decode_diagnostic(&frame), Some(diagnostic));
/// ```
pub fn decode_diagnostic(frame: &FrameBytes) -> Option<Diagnostic> {
    let [
        _,
        _,
        _,
        kind,
        h0,
        h1,
        h2,
        h3,
        a0,
        a1,
        a2,
        a3,
        b0,
        b1,
        b2,
        b3,
        ..,
    ] = *frame;
    let (a, b) = (
        u32::from_le_bytes([a0, a1, a2, a3]),
        u32::from_le_bytes([b0, b1, b2, b3]),
    );
    let number = u16::from_le_bytes([h2, h3]);
    match kind {
        0 => Some(Diagnostic::Status {
            reset_cause: ResetCause::ALL
                .into_iter()
                .find(|cause| *cause as u8 == h0)?,
            configuration: h1,
            faults_in_a_row: number,
            starts: a,
            ticks: b,
        }),
        1 => Some(Diagnostic::Fault {
            index: h0,
            record: Record {
                fault: h1,
                start: number,
                gate_faults: a,
                ticks: b,
            },
        }),
        _ => None,
    }
}
