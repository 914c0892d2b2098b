//! The control task is due: signalled by the PWM interrupt, at high priority, to the control
//! interrupt, at low priority.
//!
//! SysTick is the PWM interrupt. Once per control period it pends the PendSV exception, which runs
//! the control task. So the two rates are locked, and the PWM interrupt preempts a control task
//! that is still at work.

use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::SystemHandler;

/// Priorities as the registers have them; a lower number preempts a higher one.
const PWM_PRIORITY: u8 = 0x20;
const CONTROL_PRIORITY: u8 = 0xE0;

static CONTROL_DUE: AtomicBool = AtomicBool::new(false);

/// Gives the two interrupts their priorities. For use after the board has taken its peripherals, and
/// inside a critical section.
pub fn set_priorities() {
    // SAFETY: called once, inside a critical section, so nothing runs at the old priorities
    // meanwhile.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        SCB::set_priority(&mut core.SCB, SystemHandler::SysTick, PWM_PRIORITY);
        SCB::set_priority(&mut core.SCB, SystemHandler::PendSV, CONTROL_PRIORITY);
    }
}

/// Makes the control task due; false if it has not been done since it was last due.
pub fn call_control() -> bool {
    let was_done = !CONTROL_DUE.swap(true, Ordering::Relaxed);
    SCB::set_pendsv();
    was_done
}

/// The control task that was due is done.
pub fn control_done() {
    CONTROL_DUE.store(false, Ordering::Relaxed);
}
