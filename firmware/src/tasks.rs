//! The state that the interrupts and the main program share: the control task is due, the run is
//! finished.

use crate::board::{Board, Current};
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::SCB;

static CONTROL_DUE: AtomicBool = AtomicBool::new(false);
static FINISHED: AtomicBool = AtomicBool::new(false);

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

/// Ends the run: no further PWM interrupt comes.
pub fn finish() {
    Current::stop_pwm_interrupt();
    FINISHED.store(true, Ordering::Release);
}

/// Whether the run is over.
pub fn is_finished() -> bool {
    FINISHED.load(Ordering::Acquire)
}
