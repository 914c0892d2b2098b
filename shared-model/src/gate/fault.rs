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
        /// A sample of the dither is greater than its amplitude.
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
        /// The commanded amplitude of the dither is negative or above its limit.
        DitherCommand = 20 => "dither command",
    }
}

listed! {
    /// The part that a fault is in. It determines which commands can still be trusted.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum FaultClass {
        /// A sensor.
        Sensor => "sensor",
        /// The frames from the vehicle.
        Link => "link",
        /// The controller.
        Command => "command",
        /// The generation of the dither.
        DitherPath => "dither path",
        /// The servo's pin and bridge.
        MotorPath => "motor path",
        /// The processor: time and memory.
        Processor => "processor",
    }
}

impl FaultClass {
    /// Whether the dither is kept up in the safe state: its generation is not affected.
    pub const fn keeps_dither(self) -> bool {
        matches!(self, Self::Sensor | Self::Link | Self::Command)
    }
}

impl Fault {
    /// The part that the fault is in.
    pub const fn class(self) -> FaultClass {
        match self {
            Self::SensorNotANumber
            | Self::SensorRange
            | Self::SensorRate
            | Self::SensorStuck
            | Self::SteeringInconsistent
            | Self::LateralAcceleration => FaultClass::Sensor,
            Self::FrameAge | Self::FramesInvalid => FaultClass::Link,
            Self::CommandNotANumber
            | Self::MotorVoltage
            | Self::MotorSlew
            | Self::FeedbackVoltage
            | Self::FeedbackSlew
            | Self::DitherWeak
            | Self::DitherCommand => FaultClass::Command,
            Self::DitherAmplitude | Self::DitherFrequency => FaultClass::DitherPath,
            Self::Readback => FaultClass::MotorPath,
            Self::TickWindow | Self::ControlLate | Self::ChannelsDiffer => FaultClass::Processor,
        }
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

    /// All faults that leave the generation of the dither unaffected.
    pub const fn that_keep_dither() -> Self {
        let mut bits = 0;
        let mut rest: &[Fault] = &Fault::ALL;
        while let [first, others @ ..] = rest {
            if first.class().keeps_dither() {
                bits |= 1 << *first as u32;
            }
            rest = others;
        }
        Self(bits)
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
