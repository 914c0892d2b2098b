//! End-to-end protection of frames: AUTOSAR E2E profile 5, from the sender's memory to the
//! receiver's.
//!
//! A frame begins with a CRC-16 (2 bytes, little-endian) and a counter (1 byte). The checksum also
//! covers a data ID that is not sent, so that a frame taken for another one is detected like a
//! flipped bit; the counter distinguishes loss, repetition and wrong order.
//!
//! Source: AUTOSAR FO, "E2E Protocol Specification" (PRS_E2EProtocol), profile 5, with the header
//! at offset 0.

use crate::exchange::FrameBytes;

const CHECKSUM: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);

/// Checksum of a frame after its checksum field, then of the data ID, low byte first.
fn checksum(frame: &FrameBytes, data_id: u16) -> u16 {
    let [_, _, covered @ ..] = frame;
    let mut digest = CHECKSUM.digest();
    digest.update(covered);
    digest.update(&data_id.to_le_bytes());
    digest.finalize()
}

/// The sending end of one kind of frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sender {
    data_id: u16,
    counter: u8,
}

impl Sender {
    /// A sender of the frames with that data ID, which must be unique among the frames that could
    /// be confused.
    pub const fn new(data_id: u16) -> Self {
        Self::starting_at(data_id, 0)
    }

    /// The same, whose first frame has that counter.
    pub const fn starting_at(data_id: u16, counter: u8) -> Self {
        Self { data_id, counter }
    }

    /// Writes the header: counters from 0 to 255 and again from 0, one more with each frame.
    pub fn protect(&mut self, frame: &mut FrameBytes) {
        let [_, _, counter, ..] = frame;
        *counter = self.counter;
        self.counter = self.counter.wrapping_add(1);
        let checksum = checksum(frame, self.data_id);
        let [low, high, ..] = frame;
        [*low, *high] = checksum.to_le_bytes();
    }
}

/// Result of the check of one reception.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Whole, and the one after the last whole frame.
    Ok,
    /// Whole, and a tolerated number of frames before it are missing.
    OkSomeLost,
    /// Nothing was received.
    NoNewData,
    /// Wrong checksum: damaged, or a frame with another data ID.
    Error,
    /// Whole, with the counter of the last whole frame.
    Repeated,
    /// Whole, with a counter too far ahead or back: too many lost, wrong order, or the sender
    /// started again.
    WrongSequence,
}

impl Status {
    /// Whether the frame's signals may be used.
    pub fn is_ok(self) -> bool {
        matches!(self, Self::Ok | Self::OkSomeLost)
    }
}

/// The receiving end of one kind of frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Receiver {
    data_id: u16,
    max_delta_counter: u8,
    counter: u8,
}

impl Receiver {
    /// A receiver of the frames with that data ID. `max_delta_counter`, from 1 to 254, is the
    /// greatest step of the counter that is tolerated: one frame fewer than that may be
    /// missing.
    pub const fn new(data_id: u16, max_delta_counter: u8) -> Self {
        Self {
            data_id,
            max_delta_counter,
            // As the profile has it: a sender's first frame, with counter 0, comes next.
            counter: u8::MAX,
        }
    }

    /// Counter of the last whole frame, whatever its place in the sequence; 255 before the first.
    pub fn counter(&self) -> u8 {
        self.counter
    }

    /// Checks one reception: a frame, or none.
    ///
    /// Every whole frame sets the counter that the next one is held against, so that after one
    /// [`Status::WrongSequence`] a sender that started again is followed.
    ///
    /// ```
    /// use shared_model::e2e::{Receiver, Sender, Status};
    /// let mut sender = Sender::new(0x5A01);
    /// let mut receiver = Receiver::new(0x5A01, 3);
    /// let mut frame = [0; 24];
    /// sender.protect(&mut frame);
    /// assert_eq!(receiver.check(Some(&frame)), Status::Ok);
    /// assert_eq!(receiver.check(Some(&frame)), Status::Repeated);
    /// assert_eq!(receiver.check(None), Status::NoNewData);
    /// frame[7] ^= 1 << 3;
    /// assert_eq!(receiver.check(Some(&frame)), Status::Error);
    /// ```
    pub fn check(&mut self, frame: Option<&FrameBytes>) -> Status {
        let Some(frame) = frame else {
            return Status::NoNewData;
        };
        let [low, high, counter, ..] = *frame;
        if u16::from_le_bytes([low, high]) != checksum(frame, self.data_id) {
            return Status::Error;
        }
        let delta = counter.wrapping_sub(self.counter);
        self.counter = counter;
        match delta {
            0 => Status::Repeated,
            1 => Status::Ok,
            _ if delta <= self.max_delta_counter => Status::OkSomeLost,
            _ => Status::WrongSequence,
        }
    }
}
