//! Faults of the processor, as data.

use super::catalogue::Class;
use dynamics::words::counted;
use shared_model::listed;
use std::fmt;

/// A manipulation of the processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Only the stops of the debugger, which must have no effect.
    Nothing,
    /// A bit at an address is flipped.
    Flip {
        /// Address of its byte.
        address: u32,
        /// Number of the bit.
        bit: u8,
    },
    /// A bit of the stack is flipped, at an instruction within the control interrupt.
    FlipStack {
        /// Seed of the choice of the instruction.
        seed: u32,
        /// Bytes from the stack pointer.
        offset: u32,
        /// Number of the bit.
        bit: u8,
    },
    /// This number of consecutive PWM interrupts return immediately.
    MissPwm(u32),
    /// The PWM interrupt runs twice.
    DoublePwm,
    /// The control interrupt returns immediately.
    MissControl,
    /// The control interrupt runs twice.
    DoubleControl,
    /// PWM interrupts follow each other so closely that the control task misses its deadline.
    Overrun,
    /// The main loop hangs.
    HangMainLoop,
    /// The PWM interrupt has almost no stack left.
    OverflowStack,
    /// The PWM interrupt jumps to an address without code.
    HardFault,
    /// The machine is reset.
    Reset,
}

impl Action {
    /// All manipulations except bit flips, once each.
    pub(crate) const EVENTS: [Self; 10] = [
        Self::MissPwm(1),
        Self::MissPwm(3),
        Self::DoublePwm,
        Self::MissControl,
        Self::DoubleControl,
        Self::Overrun,
        Self::HangMainLoop,
        Self::OverflowStack,
        Self::HardFault,
        Self::Reset,
    ];

    /// Class of the fault.
    pub fn class(self) -> Class {
        match self {
            Self::Flip { .. } | Self::FlipStack { .. } => Class::Memory,
            Self::MissPwm(_)
            | Self::DoublePwm
            | Self::MissControl
            | Self::DoubleControl
            | Self::Overrun
            | Self::Nothing => Class::Timing,
            Self::HangMainLoop | Self::OverflowStack | Self::HardFault | Self::Reset => {
                Class::Processor
            }
        }
    }

    /// Its name without location and extent.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Flip { .. } | Self::FlipStack { .. } => "bit flipped",
            Self::MissPwm(_) => "PWM interrupt missed",
            Self::DoublePwm => "PWM interrupt doubled",
            Self::MissControl => "control interrupt missed",
            Self::DoubleControl => "control interrupt doubled",
            Self::Overrun => "control task late",
            Self::HangMainLoop => "main loop hangs",
            Self::OverflowStack => "stack overflow",
            Self::HardFault => "jump to invalid address",
            Self::Reset => "reset",
        }
    }
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Flip { address, bit } => write!(f, "bit {bit} at {address:#010x}"),
            Self::FlipStack { offset, bit, .. } => write!(f, "bit {bit} at sp + {offset}"),
            Self::MissPwm(count) => write!(f, "{} {}", self.name(), counted(count, "time")),
            _ => write!(f, "{}", self.name()),
        }
    }
}

listed! {
    /// A part of the memory.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Region {
        /// State, parameters and dither tables of the control task.
        ControlTask => "memory: control task",
        /// State and parameters of the PWM task.
        PwmTask => "memory: PWM task",
        /// Variables that the tasks exchange.
        Mailboxes => "memory: mailboxes",
        /// All other variables.
        OtherVariables => "memory: other variables",
        /// The stack in use.
        Stack => "memory: stack",
        /// Code of the tasks.
        Code => "memory: code",
    }
}

/// A manipulation and its control tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProcessorFault {
    /// The manipulation.
    pub action: Action,
    /// The region of a bit flip.
    pub region: Option<Region>,
    /// The control tick, from 1.
    pub tick: u32,
}

impl ProcessorFault {
    /// `Action::EVENTS`, all at the same control tick.
    pub fn events(tick: u32) -> impl Iterator<Item = Self> {
        Action::EVENTS.into_iter().map(move |action| Self {
            action,
            region: None,
            tick,
        })
    }

    /// The region of a bit flip, or the action's name.
    pub fn kind(&self) -> &'static str {
        self.region.map_or(self.action.name(), Region::name)
    }
}

impl fmt::Display for ProcessorFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.region {
            Some(region) => write!(f, "{}: {}", region.name(), self.action),
            None => write!(f, "{}", self.action),
        }
    }
}
