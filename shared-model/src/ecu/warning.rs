//! Warnings: events that are detected and tolerated, as bits of a frame.

use super::reception::Received;
use crate::e2e::Status;
use crate::listed;

listed! {
    /// An event that is detected and tolerated. The number is its bit in a frame.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Warning {
        /// A sensor frame is missing.
        FrameMissing = 0 => "frame missing",
        /// A sensor frame was damaged, or another frame in its place.
        FrameDamaged = 1 => "frame damaged",
        /// A sensor frame came twice.
        FrameRepeated = 2 => "frame repeated",
        /// A sensor frame came out of sequence.
        FrameSequence = 3 => "frame sequence",
        /// Sensor frames before this one were lost.
        FramesLost = 4 => "frames lost",
        /// A sensor frame is not an answer to one of the last actuator frames: it is too old, or was
        /// recorded before.
        FrameStale = 5 => "frame stale",
        /// The wheel speed is above the vehicle's limit.
        Overspeed = 6 => "overspeed",
    }
}

impl Warning {
    /// The word of a frame with its bit alone.
    pub const fn bit(self) -> u16 {
        1 << self as u16
    }

    fn bit_if(self, is_found: bool) -> u16 {
        if is_found { self.bit() } else { 0 }
    }
}

/// The bits of a control tick.
pub(super) fn bits(received: &Received, is_overspeed: bool) -> u16 {
    let of_status = match received.status {
        Status::Ok => 0,
        Status::OkSomeLost => Warning::FramesLost.bit(),
        Status::NoNewData => Warning::FrameMissing.bit(),
        Status::Error => Warning::FrameDamaged.bit(),
        Status::Repeated => Warning::FrameRepeated.bit(),
        Status::WrongSequence => Warning::FrameSequence.bit(),
    };
    of_status
        | Warning::FrameStale.bit_if(received.is_stale)
        | Warning::Overspeed.bit_if(is_overspeed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_warning_has_a_name_of_its_own() {
        for (k, warning) in Warning::ALL.into_iter().enumerate() {
            assert!(!warning.name().is_empty());
            let before = &Warning::ALL[..k];
            assert!(before.iter().all(|other| other.name() != warning.name()));
        }
    }
}
