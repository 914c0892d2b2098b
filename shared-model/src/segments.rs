//! Messages on classic CAN, whose frames have eight bytes: a message is three frames.
//!
//! The segments' identifiers follow each other, so that the arbitration keeps their order, and no
//! number of a message lies across two of them. A message whose segments are not all there, or not
//! in order, is lost. That three segments are of one message is protected by the message's own
//! checksum, see [`e2e`](crate::e2e).

use crate::bus::Message;
use crate::exchange::FrameBytes;

/// Bytes of a segment.
pub const SEGMENT_LEN: usize = 8;
/// Segments of a message.
pub const SEGMENTS: usize = 3;

/// A frame on classic CAN.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Identifier, 11 bits.
    pub identifier: u16,
    /// Content.
    pub bytes: [u8; SEGMENT_LEN],
}

/// Identifier of a message's first segment, as in the DBC.
pub fn first_identifier(message: Message) -> u16 {
    match message {
        Message::Sensor => 0x110,
        Message::Actuator => 0x114,
        Message::Diagnostic => 0x118,
    }
}

/// The segments of a message, in the order in which they are sent.
///
/// ```
/// use shared_model::bus::Message;
/// use shared_model::segments::{Assembler, split};
/// let frame = core::array::from_fn(|index| index as u8);
/// let mut assembler = Assembler::new();
/// let received = split(Message::Sensor, &frame).map(|segment| assembler.push(&segment));
/// assert_eq!(received, [None, None, Some((Message::Sensor, frame))]);
/// ```
pub fn split(message: Message, frame: &FrameBytes) -> [Segment; SEGMENTS] {
    let first = first_identifier(message);
    let (chunks, _) = frame.as_chunks::<SEGMENT_LEN>();
    let mut segments = [Segment {
        identifier: first,
        bytes: [0; SEGMENT_LEN],
    }; SEGMENTS];
    for ((index, segment), chunk) in (0..).zip(&mut segments).zip(chunks) {
        *segment = Segment {
            identifier: first + index,
            bytes: *chunk,
        };
    }
    segments
}

/// Puts messages together from their segments.
#[derive(Debug, Clone)]
pub struct Assembler {
    frame: FrameBytes,
    /// The message and the index of the segment that is due.
    due: Option<(Message, u16)>,
}

impl Assembler {
    /// No segment yet.
    pub fn new() -> Self {
        Self {
            frame: [0; 24],
            due: None,
        }
    }

    /// Takes a segment; returns the message that it completes. Foreign frames are ignored.
    pub fn push(&mut self, segment: &Segment) -> Option<(Message, FrameBytes)> {
        let (message, index) = place(segment.identifier)?;
        let due = self.due.take();
        if index != 0 && due != Some((message, index)) {
            return None;
        }
        let (chunks, _) = self.frame.as_chunks_mut::<SEGMENT_LEN>();
        *chunks.get_mut(usize::from(index))? = segment.bytes;
        let next = index + 1;
        if usize::from(next) == SEGMENTS {
            return Some((message, self.frame));
        }
        self.due = Some((message, next));
        None
    }
}

impl Default for Assembler {
    fn default() -> Self {
        Self::new()
    }
}

/// The message and the index of the segment with that identifier.
fn place(identifier: u16) -> Option<(Message, u16)> {
    Message::ALL.into_iter().find_map(|message| {
        let index = identifier.checked_sub(first_identifier(message))?;
        (usize::from(index) < SEGMENTS).then_some((message, index))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const FRAME: FrameBytes = [9; 24];

    fn received(segments: &[Segment]) -> Vec<(Message, FrameBytes)> {
        let mut assembler = Assembler::new();
        let received = segments.iter().filter_map(|one| assembler.push(one));
        received.collect()
    }

    #[test]
    fn a_lost_repeated_or_swapped_segment_loses_its_message_and_no_other() {
        let [a, b, c] = split(Message::Sensor, &FRAME);
        let whole = [(Message::Sensor, FRAME)];
        for broken in [
            [a, b].as_slice(),
            &[a, c],
            &[b, c],
            &[c, b, a],
            &[a, a, c],
            &[a, b, b],
        ] {
            assert_eq!(received(broken), [], "{broken:?}");
            assert_eq!(received(&[broken, &[a, b, c]].concat()), whole);
        }
        assert_eq!(received(&[a, a, b, c]), whole, "the last start counts");
    }

    #[test]
    fn foreign_frames_in_between_are_ignored_and_mixed_messages_are_lost() {
        let [a, b, c] = split(Message::Sensor, &FRAME);
        let foreign = Segment {
            identifier: 0x7FF,
            ..b
        };
        let whole = [(Message::Sensor, FRAME)];
        assert_eq!(received(&[a, foreign, b, foreign, c]), whole);
        let [x, y, z] = split(Message::Diagnostic, &FRAME);
        assert_eq!(received(&[a, b, z]), []);
        assert_eq!(received(&[x, b, z]), []);
        assert_eq!(received(&[a, x, y, z]), [(Message::Diagnostic, FRAME)]);
    }

    #[test]
    fn no_two_segments_have_the_same_identifier() {
        let segments = Message::ALL.map(|message| split(message, &FRAME));
        let mut all: Vec<u16> = segments
            .as_flattened()
            .iter()
            .map(|segment| segment.identifier)
            .collect();
        all.sort_unstable();
        let count = all.len();
        all.dedup();
        assert_eq!((all.len(), count), (count, 9));
    }
}
