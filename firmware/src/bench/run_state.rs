//! Whether the run is over: set by an interrupt, read by the main program.

use crate::board::{Board, Current};
use core::sync::atomic::{AtomicBool, Ordering};

static FINISHED: AtomicBool = AtomicBool::new(false);

/// Ends the run: no further PWM interrupt comes.
pub fn finish() {
    Current::stop_pwm_interrupt();
    FINISHED.store(true, Ordering::Release);
}

/// Whether the run is over.
pub fn is_finished() -> bool {
    FINISHED.load(Ordering::Acquire)
}
