//! The end of a run: the PWM goes neutral first, then the host gets an exit code of its own.

use super::recorder;
use crate::board::{Board, Current};
use crate::fault::Fault;

/// Reason for the end of the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ExitCode {
    /// The run is complete.
    Complete = 0,
    /// The scenario was refused.
    BadScenario = 10,
    /// The telemetry file cannot be written.
    TelemetryFailed = 11,
    /// Records or duty codes were lost, or a control task exceeded its period.
    Overrun = 12,
    /// The program panicked.
    Panic = 13,
    /// A hard fault.
    HardFault = 14,
    /// The watchdog was not fed.
    Watchdog = 15,
    /// An interrupt without a handler.
    UnexpectedInterrupt = 16,
    /// The link to the vehicle cannot be opened, or does not answer.
    LinkLost = 17,
}

impl From<Fault> for ExitCode {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Panic | Fault::NotStarted => Self::Panic,
            Fault::HardFault => Self::HardFault,
            Fault::Watchdog => Self::Watchdog,
            Fault::UnexpectedInterrupt => Self::UnexpectedInterrupt,
        }
    }
}

/// The safe state, and the end of the run: PWM neutral, trailer written, exit code given.
pub fn end_safely(code: ExitCode) -> ! {
    cortex_m::interrupt::disable();
    Current::neutralise_pwm();
    // Nothing more can be done where the host does not take the trailer.
    let _ = recorder::finish(code as u32);
    exit(code)
}

/// SYS_EXIT_EXTENDED, the exit that takes a code along.
const EXIT_EXTENDED: usize = 0x20;
/// Its reason "the application has ended".
const APPLICATION_EXIT: usize = 0x2_0026;

/// Ends the emulation with the given code.
fn exit(code: ExitCode) -> ! {
    let block = [APPLICATION_EXIT, code as usize];
    // SAFETY: the operation reads the two words of the block, which live until it returns.
    unsafe { cortex_m_semihosting::syscall1(EXIT_EXTENDED, block.as_ptr() as usize) };
    // Without a debugger: stay, with the PWM as it is.
    loop {
        cortex_m::asm::wfi();
    }
}
