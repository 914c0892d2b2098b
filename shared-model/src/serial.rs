//! Packets on a serial line: COBS with a zero byte at the end, and a CRC-16 inside.
//!
//! A reader that starts in the middle, or loses bytes, is synchronised again at the next zero.

const CHECKSUM: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);
const CHECKSUM_LEN: usize = 2;

/// Longest body of a packet, bytes.
pub const BODY_MAX: usize = 48;
/// Body and checksum, with COBS's one byte more.
const FRAMED_MAX: usize = BODY_MAX + CHECKSUM_LEN + 1;

/// Sends `body` as a packet; a body longer than [`BODY_MAX`] is not sent.
///
/// ```
/// use shared_model::serial::{Deframer, Received, frame};
/// let mut line = Vec::new();
/// frame(&[1, 0, 2], |byte| line.push(byte));
/// let (last, first) = line.split_last().unwrap();
/// let mut deframer = Deframer::new();
/// assert!(first.iter().all(|&byte| deframer.push(byte) == Received::Nothing));
/// assert_eq!(deframer.push(*last), Received::Body(&[1, 0, 2]));
/// ```
pub fn frame(body: &[u8], mut send: impl FnMut(u8)) {
    let mut plain = [0; BODY_MAX + CHECKSUM_LEN];
    let mut framed = [0; FRAMED_MAX];
    let Some((place, rest)) = plain.split_at_mut_checked(body.len()) else {
        return;
    };
    let Some(checksum) = rest.first_chunk_mut() else {
        return;
    };
    place.copy_from_slice(body);
    *checksum = CHECKSUM.checksum(body).to_le_bytes();
    let whole = plain.get(..body.len() + CHECKSUM_LEN).unwrap_or(&[]);
    let length = cobs::try_encode(whole, &mut framed).unwrap_or(0);
    framed.iter().take(length).for_each(|&byte| send(byte));
    send(0);
}

/// Result of a byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received<'a> {
    /// No packet yet.
    Nothing,
    /// Something that is no packet, or a damaged one.
    Damaged,
    /// The body of a packet.
    Body(&'a [u8]),
}

/// Finds packets in a stream of bytes.
#[derive(Debug, Clone)]
pub struct Deframer {
    framed: [u8; FRAMED_MAX],
    plain: [u8; FRAMED_MAX],
    length: usize,
}

impl Deframer {
    /// At the start of a packet.
    pub fn new() -> Self {
        Self {
            framed: [0; FRAMED_MAX],
            plain: [0; FRAMED_MAX],
            length: 0,
        }
    }

    /// Takes a byte of the stream.
    pub fn push(&mut self, byte: u8) -> Received<'_> {
        if byte != 0 {
            if let Some(place) = self.framed.get_mut(self.length) {
                *place = byte;
            }
            self.length = self.length.saturating_add(1);
            return Received::Nothing;
        }
        let length = core::mem::take(&mut self.length);
        let framed = self.framed.get(..length).unwrap_or(&[]);
        unpack(framed, &mut self.plain).map_or(Received::Damaged, Received::Body)
    }
}

fn unpack<'a>(framed: &[u8], plain: &'a mut [u8; FRAMED_MAX]) -> Option<&'a [u8]> {
    // The compiler cannot exclude a panic of the crate's decoder of slices; it can for the decoder
    // of single bytes.
    let mut decoder = cobs::CobsDecoder::new(plain);
    let mut length = None;
    for &byte in framed.iter().chain(&[0]) {
        length = decoder.feed(byte).ok()?;
    }
    let (body, checksum) = plain.get(..length?)?.split_last_chunk()?;
    (CHECKSUM.checksum(body) == u16::from_le_bytes(*checksum)).then_some(body)
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}
