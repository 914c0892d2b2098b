//! The bus on CAN: one frame per message on CAN FD, three frames on classic CAN. A board's driver
//! moves frames and nothing else.

use crate::bus::{Bus, Busy, Message};
use crate::exchange::FrameBytes;
use crate::segments::{Assembler, SEGMENTS, Segment, split};

/// Frames that one call of `receive` takes at most, so that a babbling bus cannot occupy it: more
/// than come in 2 ms at 1 Mbit/s.
const FRAMES_PER_CALL: usize = 32;

/// A controller of CAN FD. Its functions never wait.
pub trait FdController {
    /// The next received frame of 24 bytes with its identifier of 11 bits, if there is one.
    fn receive(&mut self) -> Option<(u16, FrameBytes)>;

    /// Sends a frame, after those that wait already.
    ///
    /// # Errors
    /// If there is no room.
    fn send(&mut self, identifier: u16, frame: &FrameBytes) -> Result<(), Busy>;
}

/// Messages as frames of CAN FD.
#[derive(Debug, Clone)]
pub struct FdBus<C> {
    controller: C,
}

impl<C: FdController> FdBus<C> {
    /// Messages through that controller.
    pub fn new(controller: C) -> Self {
        Self { controller }
    }
}

impl<C: FdController> Bus for FdBus<C> {
    fn receive(&mut self) -> Option<(Message, FrameBytes)> {
        for _ in 0..FRAMES_PER_CALL {
            let (identifier, frame) = self.controller.receive()?;
            if let Some(message) = Message::from_can_identifier(identifier) {
                return Some((message, frame));
            }
        }
        None
    }

    fn send(&mut self, message: Message, frame: &FrameBytes) -> Result<(), Busy> {
        self.controller.send(message.can_identifier(), frame)
    }
}

/// A controller of classic CAN with rings around it. Its functions never wait.
pub trait ClassicController {
    /// The next received frame of eight bytes, if there is one.
    fn receive(&mut self) -> Option<Segment>;

    /// Sends all segments in order, after those that wait already, or none.
    ///
    /// # Errors
    /// If there is no room for all of them.
    fn send(&mut self, segments: &[Segment; SEGMENTS]) -> Result<(), Busy>;
}

/// Messages as three frames of classic CAN each.
#[derive(Debug, Clone)]
pub struct ClassicBus<C> {
    controller: C,
    assembler: Assembler,
}

impl<C: ClassicController> ClassicBus<C> {
    /// Messages through that controller.
    pub fn new(controller: C) -> Self {
        Self {
            controller,
            assembler: Assembler::new(),
        }
    }
}

impl<C: ClassicController> Bus for ClassicBus<C> {
    fn receive(&mut self) -> Option<(Message, FrameBytes)> {
        for _ in 0..FRAMES_PER_CALL {
            let segment = self.controller.receive()?;
            if let Some(received) = self.assembler.push(&segment) {
                return Some(received);
            }
        }
        None
    }

    fn send(&mut self, message: Message, frame: &FrameBytes) -> Result<(), Busy> {
        self.controller.send(&split(message, frame))
    }
}

/// Bit timing: time quanta of a bit, of which the first is for synchronisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BitTiming {
    /// Clocks of the controller per time quantum.
    pub prescaler: u32,
    /// Time quanta before the sample point, without the first.
    pub segment_1: u32,
    /// Time quanta after the sample point.
    pub segment_2: u32,
}

impl BitTiming {
    /// The timing without prescaler for a bit rate, with the sample point as near as possible
    /// before `sample_percent` of the bit.
    ///
    /// # Panics
    /// If the clock is no multiple of the bit rate or is too slow for it: for constants, so at
    /// compile time.
    ///
    /// ```
    /// use shared_model::can::BitTiming;
    /// let timing = BitTiming::of(16_000_000, 500_000, 82);
    /// assert_eq!((timing.segment_1, timing.segment_2), (25, 6));
    /// assert_eq!(timing.bit_rate_hz(16_000_000), 500_000);
    /// ```
    pub const fn of(clock_hz: u32, bit_rate_hz: u32, sample_percent: u32) -> Self {
        assert!(
            clock_hz.is_multiple_of(bit_rate_hz),
            "no multiple of the bit rate"
        );
        let quanta = clock_hz / bit_rate_hz;
        assert!(quanta >= 8, "the clock is too slow for the bit rate");
        let before = quanta * sample_percent / 100;
        assert!(before >= 2 && before < quanta, "no such sample point");
        Self {
            prescaler: 1,
            segment_1: before - 1,
            segment_2: quanta - before,
        }
    }

    /// Bit rate at a clock, Hz.
    pub const fn bit_rate_hz(self, clock_hz: u32) -> u32 {
        clock_hz / (self.prescaler * (1 + self.segment_1 + self.segment_2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::latest;
    use std::collections::VecDeque;
    use std::vec::Vec;

    #[derive(Default)]
    struct Fd {
        incoming: VecDeque<(u16, FrameBytes)>,
        sent: Vec<(u16, FrameBytes)>,
        room: usize,
    }

    impl FdController for Fd {
        fn receive(&mut self) -> Option<(u16, FrameBytes)> {
            self.incoming.pop_front()
        }

        fn send(&mut self, identifier: u16, frame: &FrameBytes) -> Result<(), Busy> {
            self.room = self.room.checked_sub(1).ok_or(Busy)?;
            self.sent.push((identifier, *frame));
            Ok(())
        }
    }

    #[derive(Default)]
    struct Classic {
        incoming: VecDeque<Segment>,
        sent: Vec<Segment>,
        room: usize,
    }

    impl ClassicController for Classic {
        fn receive(&mut self) -> Option<Segment> {
            self.incoming.pop_front()
        }

        fn send(&mut self, segments: &[Segment; SEGMENTS]) -> Result<(), Busy> {
            self.room = self.room.checked_sub(SEGMENTS).ok_or(Busy)?;
            self.sent.extend(segments);
            Ok(())
        }
    }

    #[test]
    fn every_message_comes_through_and_none_waits_for_room() {
        for message in Message::ALL {
            let frame = core::array::from_fn(|index| index as u8 ^ 0x5A);
            let mut fd = FdBus::new(Fd::default());
            assert_eq!(fd.send(message, &frame), Err(Busy));
            fd.controller.room = 1;
            assert_eq!(fd.send(message, &frame), Ok(()));
            fd.controller.incoming = fd.controller.sent.drain(..).collect();
            assert_eq!(fd.receive(), Some((message, frame)));
            assert_eq!(fd.receive(), None);

            let mut classic = ClassicBus::new(Classic::default());
            classic.controller.room = SEGMENTS - 1;
            assert_eq!(classic.send(message, &frame), Err(Busy));
            assert_eq!(classic.controller.sent, [], "nothing of it is sent");
            classic.controller.room = SEGMENTS;
            assert_eq!(classic.send(message, &frame), Ok(()));
            classic.controller.incoming = classic.controller.sent.drain(..).collect();
            assert_eq!(classic.receive(), Some((message, frame)));
            assert_eq!(classic.receive(), None);
        }
    }

    #[test]
    fn foreign_frames_are_skipped_and_the_latest_message_counts() {
        let sensor = Message::Sensor.can_identifier();
        let mut fd = FdBus::new(Fd {
            incoming: [(0x7FF, [1; 24]), (sensor, [2; 24]), (sensor, [3; 24])].into(),
            ..Fd::default()
        });
        assert_eq!(latest(&mut fd, Message::Sensor), Some([3; 24]));

        // The end of a message whose start was lost, a whole one, the start of the next.
        let [_, b, c] = split(Message::Sensor, &[1; 24]);
        let whole = split(Message::Sensor, &[2; 24]);
        let [next, ..] = split(Message::Sensor, &[3; 24]);
        let mut incoming: VecDeque<Segment> = [b, c].into();
        incoming.extend(whole);
        incoming.push_back(next);
        let mut classic = ClassicBus::new(Classic {
            incoming,
            ..Classic::default()
        });
        assert_eq!(latest(&mut classic, Message::Sensor), Some([2; 24]));
        let [_, b, c] = split(Message::Sensor, &[3; 24]);
        classic.controller.incoming = [b, c].into();
        assert_eq!(latest(&mut classic, Message::Sensor), Some([3; 24]));
    }

    #[test]
    fn a_babbling_bus_takes_a_bounded_time() {
        let mut fd = FdBus::new(Fd {
            incoming: core::iter::repeat_n((0x7FF, [0; 24]), 1000).collect(),
            ..Fd::default()
        });
        assert_eq!(fd.receive(), None);
        assert_eq!(fd.controller.incoming.len(), 1000 - FRAMES_PER_CALL);
        let [first, ..] = split(Message::Sensor, &[0; 24]);
        let mut classic = ClassicBus::new(Classic {
            incoming: core::iter::repeat_n(first, 1000).collect(),
            ..Classic::default()
        });
        assert_eq!(classic.receive(), None);
        assert_eq!(classic.controller.incoming.len(), 1000 - FRAMES_PER_CALL);
    }

    #[test]
    fn the_bit_rates_are_exact_and_the_sample_point_is_where_it_should_be() {
        for (bit_rate_hz, percent, expected) in [
            (500_000, 82, (25, 6)),
            (2_000_000, 75, (5, 2)),
            (1_000_000, 82, (12, 3)),
        ] {
            let timing = BitTiming::of(16_000_000, bit_rate_hz, percent);
            assert_eq!((timing.segment_1, timing.segment_2), expected);
            assert_eq!(timing.bit_rate_hz(16_000_000), bit_rate_hz);
        }
    }
}
