//! Faults: the PWM goes neutral first, then the run ends with an exit code of its own.

use crate::board::{Board, Current};
use crate::exit::{ExitCode, exit};
use crate::recorder;
use core::arch::naked_asm;
use cortex_m_rt::exception;

/// The safe state, and the end of the run: PWM neutral, trailer written, exit code given.
pub fn end_safely(code: ExitCode) -> ! {
    cortex_m::interrupt::disable();
    Current::neutralise_pwm();
    // Nothing more can be done where the host does not take the trailer.
    let _ = recorder::finish(code);
    exit(code)
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
    end_safely(ExitCode::HardFault)
}

/// The watchdog's interrupt.
// SAFETY: touches only atomics, device registers and the host, so it may interrupt anything; and it
// does not return.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    end_safely(ExitCode::Watchdog)
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(_number: i16) -> ! {
    end_safely(ExitCode::UnexpectedInterrupt)
}
