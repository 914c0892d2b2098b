//! What the gate can find, as bits of a frame.

use core::ops::BitOrAssign;

/// A fault that puts the ECU into its safe state. The number is its bit in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// A measured signal is NaN, infinite or subnormal: no sensor gives such a number.
    SensorNotANumber = 0,
    /// A measured signal is outside its range.
    SensorRange = 1,
    /// A measured signal changes faster than it can.
    SensorRate = 2,
    /// The yaw rate does not move while the steering does.
    SensorStuck = 3,
    /// Steering angle and steering rate contradict each other.
    SteeringInconsistent = 4,
    /// Wheel speed times yaw rate is more lateral acceleration than the road can give.
    LateralAcceleration = 5,
    /// No valid sensor frame for too long.
    FrameAge = 6,
    /// Too little or too much time between two control ticks, by an independent clock.
    TickWindow = 7,
    /// A control tick was not done when the next was due.
    ControlLate = 8,
    /// The controller's command is not a finite number.
    CommandNotANumber = 9,
    /// The motor's share of the voltage is above its limit.
    MotorVoltage = 10,
    /// The motor's share of the voltage changes faster than allowed.
    MotorSlew = 11,
    /// The dither is stronger than its amplitude, or the amplitude is above its limit.
    DitherAmplitude = 12,
    /// The dither is slower or faster than allowed.
    DitherFrequency = 13,
    /// The duty on the servo's pin is not the one that was put out.
    Readback = 14,
    /// The program's two channels differ: memory was changed.
    ChannelsDiffer = 15,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 16] = [
        Self::SensorNotANumber,
        Self::SensorRange,
        Self::SensorRate,
        Self::SensorStuck,
        Self::SteeringInconsistent,
        Self::LateralAcceleration,
        Self::FrameAge,
        Self::TickWindow,
        Self::ControlLate,
        Self::CommandNotANumber,
        Self::MotorVoltage,
        Self::MotorSlew,
        Self::DitherAmplitude,
        Self::DitherFrequency,
        Self::Readback,
        Self::ChannelsDiffer,
    ];

    /// Its name, for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::SensorNotANumber => "sensor not a number",
            Self::SensorRange => "sensor range",
            Self::SensorRate => "sensor rate",
            Self::SensorStuck => "sensor stuck",
            Self::SteeringInconsistent => "steering inconsistent",
            Self::LateralAcceleration => "lateral acceleration",
            Self::FrameAge => "frame age",
            Self::TickWindow => "tick window",
            Self::ControlLate => "control late",
            Self::CommandNotANumber => "command not a number",
            Self::MotorVoltage => "motor voltage",
            Self::MotorSlew => "motor slew",
            Self::DitherAmplitude => "dither amplitude",
            Self::DitherFrequency => "dither frequency",
            Self::Readback => "readback",
            Self::ChannelsDiffer => "channels differ",
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
