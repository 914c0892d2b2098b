//! Faults that the gate detects, as bits of a frame.

use crate::listed;
use core::ops::BitOrAssign;

listed! {
    /// A fault that puts the ECU into its safe state. The number is its bit in a frame.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Fault {
        /// A measured signal is NaN, infinite or subnormal: no sensor gives such a number.
        SensorNotANumber = 0 => "sensor not a number",
        /// A measured signal is outside its range.
        SensorRange = 1 => "sensor range",
        /// A measured signal changes faster than it can.
        SensorRate = 2 => "sensor rate",
        /// The yaw rate does not move while the steering does.
        SensorStuck = 3 => "sensor stuck",
        /// Steering angle and steering rate contradict each other.
        SteeringInconsistent = 4 => "steering inconsistent",
        /// Wheel speed times yaw rate is more lateral acceleration than the road can give.
        LateralAcceleration = 5 => "lateral acceleration",
        /// The last valid sensor frame is too old.
        FrameAge = 6 => "frame age",
        /// The time between two control ticks, by an independent clock, is outside its window.
        TickWindow = 7 => "tick window",
        /// A control tick was not finished when the next was due.
        ControlLate = 8 => "control late",
        /// The controller's command is not a finite number.
        CommandNotANumber = 9 => "command not a number",
        /// The motor's share of the voltage, or both shares together, are above its limit.
        MotorVoltage = 10 => "motor voltage",
        /// The motor's share of the voltage changes faster than allowed.
        MotorSlew = 11 => "motor slew",
        /// The dither is stronger than its amplitude, or the amplitude is above its limit.
        DitherAmplitude = 12 => "dither amplitude",
        /// The dither is slower or faster than allowed.
        DitherFrequency = 13 => "dither frequency",
        /// The duty on the servo's pin differs from the commanded one.
        Readback = 14 => "readback",
        /// The program's two channels differ, which indicates memory corruption.
        ChannelsDiffer = 15 => "channels differ",
        /// Too many of the last sensor frames are missing, damaged or stale.
        FramesInvalid = 16 => "frames invalid",
        /// The dither is absent or too weak at a speed that needs it.
        DitherWeak = 17 => "dither weak",
        /// The delayed feedback's share of the voltage is above its limit.
        FeedbackVoltage = 18 => "feedback voltage",
        /// The delayed feedback's share of the voltage changes faster than allowed.
        FeedbackSlew = 19 => "feedback slew",
    }
}

/// A set of faults.
///
/// ```
/// use shared_model::gate::{Fault, Faults};
/// let mut faults = Faults::NONE;
/// faults |= Fault::FrameAge;
/// assert!(faults.contains(Fault::FrameAge) && !faults.contains(Fault::Readback));
/// assert_eq!(faults.bits(), 1 << 6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults(u32);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// The set of these faults.
    pub const fn of<const COUNT: usize>(faults: [Fault; COUNT]) -> Self {
        let mut bits = 0;
        let mut rest: &[Fault] = &faults;
        while let [first, others @ ..] = rest {
            bits |= 1 << *first as u32;
            rest = others;
        }
        Self(bits)
    }

    /// The set with these bits.
    pub fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// One bit a fault, at its number.
    pub fn bits(self) -> u32 {
        self.0
    }

    /// No fault is in the set.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The fault is in the set.
    pub fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u32) != 0
    }

    /// The faults of the set.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL
            .into_iter()
            .filter(move |&fault| self.contains(fault))
    }

    /// A fault of the other set is in this set.
    pub fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// The faults of this set that are not in the other.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Puts the fault into the set if it was found.
    pub fn add_if(&mut self, found: bool, fault: Fault) {
        if found {
            *self |= fault;
        }
    }
}

impl From<Fault> for Faults {
    fn from(fault: Fault) -> Self {
        Self(1 << fault as u32)
    }
}

impl BitOrAssign<Fault> for Faults {
    fn bitor_assign(&mut self, fault: Fault) {
        *self |= Self::from(fault);
    }
}

impl BitOrAssign for Faults {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}
