//! Proof that the control path cannot panic: this image links only if no panic is reachable from
//! its interrupts.
//!
//! The panic handler calls a function that is not defined. Where the optimiser finds every panic
//! unreachable, the handler and its call vanish; otherwise the linker reports the function, whose
//! name is the reason. The feature `reachable-panic` puts a panic into the path, to see that the
//! proof can fail. The image is never run.

#![no_std]
#![no_main]

use core::panic::PanicInfo;
use core::ptr::read_volatile;
use firmware::interrupts::{self, ControlInterrupt, PwmInterrupt};

// SAFETY: there is no such function; where it is called, the link fails.
unsafe extern "C" {
    fn a_panic_is_reachable_from_the_control_path() -> !;
}

/// An address in RAM, so that the tasks are unknown to the optimiser.
const ANYWHERE: usize = 0x2000_8000;

// SAFETY: the start-up code calls the function of this name, and there is no other.
#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    // SAFETY: none; this image is linked, not run.
    let (pwm, control) = unsafe {
        (
            read_volatile(ANYWHERE as *const PwmInterrupt),
            read_volatile(ANYWHERE as *const ControlInterrupt),
        )
    };
    #[cfg(feature = "reachable-panic")]
    assert!(!matches!(control, ControlInterrupt::InLoop(_)), "provoked");
    interrupts::hand_over(pwm, control, 10);
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    // SAFETY: there is no such function, which is the point.
    unsafe { a_panic_is_reachable_from_the_control_path() }
}
