//! Faults of the program itself. The image decides how it reaches its safe state.

use core::arch::naked_asm;
use cortex_m_rt::exception;

/// Reason why the program cannot continue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// The program panicked.
    Panic = 1,
    /// A hard fault.
    HardFault = 2,
    /// The watchdog was not fed.
    Watchdog = 3,
    /// An interrupt without a handler.
    UnexpectedInterrupt = 4,
    /// The PWM or a task could not be started.
    NotStarted = 5,
}

// SAFETY: each image defines the function, with this signature and without requirements.
unsafe extern "Rust" {
    /// The image's safe state. May be called from any handler, and with most of the stack used.
    pub safe fn enter_safe_state(fault: Fault) -> !;
}

/// Uses the whole stack from its top: after an overflow there is none left.
// SAFETY: sets the stack pointer to the top of the stack and continues; the former stack is not
// needed any more, as nothing returns from here.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
#[unsafe(link_section = ".HardFault.ecu")]
unsafe extern "C" fn hard_fault() -> ! {
    naked_asm!(
        "ldr r0, =_stack_start",
        "msr msp, r0",
        "b {}",
        sym end_hard_fault,
    )
}

// SAFETY: the one function of that name. It has one for the sake of the stack's bound, which begins
// here, after the assembly.
#[unsafe(no_mangle)]
extern "C" fn end_hard_fault() -> ! {
    enter_safe_state(Fault::HardFault)
}

/// The watchdog's interrupt.
// SAFETY: an image's safe state touches only atomics, device registers and the host, so it may
// interrupt anything; and it does not return.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    enter_safe_state(Fault::Watchdog)
}
