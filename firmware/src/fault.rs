//! Faults: the PWM goes neutral first, then the run ends with an exit code of its own.

use crate::board::{Board, Current};
use crate::exit::{ExitCode, exit};
use crate::recorder;
use cortex_m_rt::{ExceptionFrame, exception};

/// The safe state, and the end of the run: PWM neutral, trailer written, exit code given.
pub fn end_safely(code: ExitCode) -> ! {
    cortex_m::interrupt::disable();
    Current::neutralise_pwm();
    // Nothing more can be done where the host does not take the trailer.
    let _ = recorder::finish(code);
    exit(code)
}

// SAFETY: touches only atomics, device registers and the host, so it may interrupt anything; and it does not return.
#[exception]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    end_safely(ExitCode::HardFault)
}

/// The watchdog's interrupt.
// SAFETY: as above.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    end_safely(ExitCode::Watchdog)
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(_number: i16) -> ! {
    end_safely(ExitCode::UnexpectedInterrupt)
}
