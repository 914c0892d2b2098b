//! Diagnostic frames in turn: the status, then the records of the fault history.

use shared_model::diagnostic::{
    DIAGNOSTIC_DATA_ID, Diagnostic, History, RECORDS, ResetCause, encode_diagnostic,
};
use shared_model::e2e::Sender;
use shared_model::exchange::FrameBytes;

/// What the ECU knows about its start.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Cause of the reset.
    pub reset_cause: ResetCause,
    /// 0, or the number of the configuration's error.
    pub configuration: u8,
    /// The history, this start included.
    pub history: History,
}

/// The frames of a start.
pub struct Diagnosis {
    start: Start,
    sender: Sender,
    next: usize,
}

impl Diagnosis {
    /// The frames of that start.
    pub fn new(start: Start) -> Self {
        Self {
            start,
            sender: Sender::new(DIAGNOSTIC_DATA_ID),
            next: 0,
        }
    }

    /// The next frame, `ticks` control ticks after the start.
    pub fn frame(&mut self, ticks: u32) -> FrameBytes {
        let index = self.next;
        let records = self.start.history.records;
        let record = index.checked_sub(1).and_then(|index| records.get(index));
        let diagnostic = match record {
            Some(&record) if record.fault != 0 => {
                self.next = if index < RECORDS { index + 1 } else { 0 };
                Diagnostic::Fault {
                    index: (index - 1) as u8,
                    record,
                }
            }
            _ => {
                self.next = 1;
                Diagnostic::Status {
                    reset_cause: self.start.reset_cause,
                    configuration: self.start.configuration,
                    faults_in_a_row: self.start.history.faults_in_a_row as u16,
                    starts: self.start.history.starts,
                    ticks,
                }
            }
        };
        encode_diagnostic(&diagnostic, &mut self.sender)
    }
}
