//! A fault of either catalogue: of the loop or of the processor.

use super::catalogue::{Class, Fault};
use super::processor_fault::ProcessorFault;
use std::fmt;

/// A fault that is injected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Injection {
    /// Between vehicle and ECU, or in the ECU's timing.
    Loop(Fault),
    /// In the ECU's processor.
    Processor(ProcessorFault),
}

impl Injection {
    /// Its class.
    pub fn class(&self) -> Class {
        match self {
            Self::Loop(fault) => fault.class(),
            Self::Processor(fault) => fault.action.class(),
        }
    }

    /// The kind of fault, under which reports group it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Loop(fault) => fault.kind.name(),
            Self::Processor(fault) => fault.kind(),
        }
    }
}

impl fmt::Display for Injection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Loop(fault) => write!(f, "{fault}"),
            Self::Processor(fault) => write!(f, "{fault}"),
        }
    }
}
