//! The bus between vehicle and ECU: which messages there are, and what a driver does.
//!
//! A driver is thin. What is above it is here and is tested on the host: packets on a serial line
//! ([`SerialBus`]) and segments on classic CAN ([`crate::segments`]). On CAN FD a message is one
//! frame.

use crate::exchange::FrameBytes;
use crate::listed;
use crate::serial::{self, Deframer, Received};

listed! {
    /// A message. The number is its code in a serial packet.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Message {
        /// From the vehicle: measurements.
        Sensor = 1 => "sensor frame",
        /// From the ECU: commands and state.
        Actuator = 2 => "actuator frame",
        /// From the ECU: start-up and fault history.
        Diagnostic = 3 => "diagnostic frame",
    }
}

impl Message {
    /// Identifier on CAN FD, 11 bits, as in the DBC.
    pub fn can_identifier(self) -> u16 {
        match self {
            Self::Sensor => 0x100,
            Self::Actuator => 0x101,
            Self::Diagnostic => 0x102,
        }
    }

    /// The message with that identifier on CAN FD.
    pub(crate) fn from_can_identifier(identifier: u16) -> Option<Self> {
        let named = |message: &Self| message.can_identifier() == identifier;
        Self::ALL.into_iter().find(named)
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|message| *message as u8 == code)
    }
}

/// There is no room for the message now. It is not sent, also not later.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Busy;

/// A bus. Its functions never wait.
pub trait Bus {
    /// The next received message, if there is one. Damaged and foreign messages are skipped.
    fn receive(&mut self) -> Option<(Message, FrameBytes)>;

    /// Sends a message, or nothing of it.
    ///
    /// # Errors
    /// If there is no room.
    fn send(&mut self, message: Message, frame: &FrameBytes) -> Result<(), Busy>;
}

/// A serial line, byte by byte. Its functions never wait.
pub trait SerialLine {
    /// The next received byte, if there is one.
    fn receive(&mut self) -> Option<u8>;

    /// Sends all bytes, or none.
    ///
    /// # Errors
    /// If there is no room for all of them.
    fn send(&mut self, bytes: &[u8]) -> Result<(), Busy>;
}

/// Longest packet on the line: code, frame, checksum, and the two bytes of the framing.
const PACKET_MAX: usize = 1 + 24 + 2 + 2;
/// Bytes that one call of [`SerialBus::receive`] takes at most, so that a babbling line cannot
/// occupy it: more than a line of 1 Mbit/s brings in 2 ms.
const BYTES_PER_CALL: usize = 256;

/// Messages as packets of [`serial`]: the body is the message's code, then the frame.
#[derive(Debug, Clone)]
pub struct SerialBus<L> {
    line: L,
    deframer: Deframer,
}

impl<L: SerialLine> SerialBus<L> {
    /// Messages on that line.
    pub fn new(line: L) -> Self {
        Self {
            line,
            deframer: Deframer::new(),
        }
    }
}

impl<L: SerialLine> Bus for SerialBus<L> {
    fn receive(&mut self) -> Option<(Message, FrameBytes)> {
        for _ in 0..BYTES_PER_CALL {
            let Received::Body(body) = self.deframer.push(self.line.receive()?) else {
                continue;
            };
            if let Some(received) = unpack(body) {
                return Some(received);
            }
        }
        None
    }

    fn send(&mut self, message: Message, frame: &FrameBytes) -> Result<(), Busy> {
        let mut packet = [0; PACKET_MAX];
        let mut length = 0;
        let mut places = packet.iter_mut();
        pack(message, frame, |byte| {
            if let Some(place) = places.next() {
                *place = byte;
                length += 1;
            }
        });
        self.line.send(packet.get(..length).unwrap_or(&[]))
    }
}

/// Sends a message as a packet, byte by byte.
///
/// ```
/// use shared_model::bus::{Message, pack, unpack};
/// use shared_model::serial::{Deframer, Received};
/// let mut packet = Vec::new();
/// pack(Message::Sensor, &[7; 24], |byte| packet.push(byte));
/// assert_eq!(packet.len(), 29);
/// let (end, start) = packet.split_last().unwrap();
/// let mut deframer = Deframer::new();
/// assert!(start.iter().all(|&byte| deframer.push(byte) == Received::Nothing));
/// let Received::Body(body) = deframer.push(*end) else { panic!("it is whole") };
/// assert_eq!(unpack(body), Some((Message::Sensor, [7; 24])));
/// ```
pub fn pack(message: Message, frame: &FrameBytes, send: impl FnMut(u8)) {
    let mut body = [0; 25];
    let [code, content @ ..] = &mut body;
    *code = message as u8;
    *content = *frame;
    serial::frame(&body, send);
}

/// The message in a packet's body; `None` for a foreign one.
pub fn unpack(body: &[u8]) -> Option<(Message, FrameBytes)> {
    let (&code, content) = body.split_first()?;
    Some((Message::from_code(code)?, content.try_into().ok()?))
}

/// The latest frame of `message` among all that came, within the bounds of the bus's own calls.
pub fn latest(bus: &mut impl Bus, message: Message) -> Option<FrameBytes> {
    /// Messages looked at in a call: more than come in a control period of 1 ms at 1 Mbit/s.
    const MESSAGES: usize = 16;
    let mut latest = None;
    for _ in 0..MESSAGES {
        match bus.receive() {
            Some((kind, frame)) if kind == message => latest = Some(frame),
            Some(_) => {}
            None => break,
        }
    }
    latest
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;
    use std::vec::Vec;

    #[derive(Default)]
    struct Wire {
        incoming: VecDeque<u8>,
        sent: Vec<u8>,
        room: usize,
    }

    impl SerialLine for Wire {
        fn receive(&mut self) -> Option<u8> {
            self.incoming.pop_front()
        }

        fn send(&mut self, bytes: &[u8]) -> Result<(), Busy> {
            if bytes.len() > self.room {
                return Err(Busy);
            }
            self.room -= bytes.len();
            self.sent.extend(bytes);
            Ok(())
        }
    }

    fn packet(message: Message, frame: &FrameBytes) -> Vec<u8> {
        let mut packet = Vec::new();
        pack(message, frame, |byte| packet.push(byte));
        packet
    }

    fn bus(incoming: impl IntoIterator<Item = u8>) -> SerialBus<Wire> {
        SerialBus::new(Wire {
            incoming: incoming.into_iter().collect(),
            ..Wire::default()
        })
    }

    #[test]
    fn every_message_comes_through_and_none_waits_for_room() {
        for message in Message::ALL {
            for byte in 0..=255 {
                let frame = [byte; 24];
                let mut sender = bus([]);
                assert_eq!(sender.send(message, &frame), Err(Busy));
                assert!(sender.line.sent.is_empty(), "nothing of it is sent");
                sender.line.room = PACKET_MAX;
                assert_eq!(sender.send(message, &frame), Ok(()));
                let mut receiver = bus(sender.line.sent);
                assert_eq!(receiver.receive(), Some((message, frame)));
                assert_eq!(receiver.receive(), None);
            }
            let identifier = message.can_identifier();
            assert_eq!(Message::from_can_identifier(identifier), Some(message));
        }
    }

    /// A damaged packet is a lost one: the next comes through.
    #[test]
    fn whatever_precedes_a_packet_the_packet_after_it_comes_through() {
        let whole = packet(Message::Sensor, &[3; 24]);
        let foreign = {
            let mut bytes = Vec::new();
            serial::frame(&[99; 25], |byte| bytes.push(byte));
            bytes
        };
        let short = {
            let mut bytes = Vec::new();
            serial::frame(&[1; 24], |byte| bytes.push(byte));
            bytes
        };
        for garbage in [
            foreign,
            short,
            std::vec![0; 40],
            std::vec![0xFF; 200],
            whole[..10].to_vec(),
            packet(Message::Actuator, &[0; 24]),
        ] {
            let mut line = garbage;
            // The framing finds the next packet after a zero.
            line.push(0);
            line.extend(&whole);
            let mut bus = bus(line);
            assert_eq!(latest(&mut bus, Message::Sensor), Some([3; 24]));
            assert_eq!(latest(&mut bus, Message::Sensor), None);
        }
    }

    #[test]
    fn every_flipped_bit_of_a_packet_loses_it_and_no_other() {
        let (first, second) = (
            packet(Message::Sensor, &[0x5A; 24]),
            packet(Message::Sensor, &[2; 24]),
        );
        for bit in 0..8 * first.len() {
            let mut line = first.clone();
            line[bit / 8] ^= 1 << (bit % 8);
            line.push(0);
            line.extend(&second);
            let mut bus = bus(line);
            assert_eq!(bus.receive(), Some((Message::Sensor, [2; 24])), "bit {bit}");
        }
    }

    #[test]
    fn a_babbling_line_takes_a_bounded_time() {
        let foreign = packet(Message::Actuator, &[0; 24]);
        let mut bus = bus(foreign.iter().copied().cycle().take(100_000));
        let before = bus.line.incoming.len();
        assert_eq!(latest(&mut bus, Message::Sensor), None);
        assert!(before - bus.line.incoming.len() <= 16 * foreign.len());
        bus.line.incoming = core::iter::repeat_n(1, 100_000).collect();
        assert_eq!(bus.receive(), None);
        assert_eq!(bus.line.incoming.len(), 100_000 - BYTES_PER_CALL);
    }
}
