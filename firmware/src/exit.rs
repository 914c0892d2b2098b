//! Exit codes of a run, for the host.

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

/// SYS_EXIT_EXTENDED, the exit that takes a code along.
const EXIT_EXTENDED: usize = 0x20;
/// Its reason "the application has ended".
const APPLICATION_EXIT: usize = 0x2_0026;

/// Ends the emulation with the given code.
pub fn exit(code: ExitCode) -> ! {
    let block = [APPLICATION_EXIT, code as usize];
    // SAFETY: the operation reads the two words of the block, which live until it returns.
    unsafe { cortex_m_semihosting::syscall1(EXIT_EXTENDED, block.as_ptr() as usize) };
    // Without a debugger: stay, with the PWM as it is.
    loop {
        cortex_m::asm::wfi();
    }
}
