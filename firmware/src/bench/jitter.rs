//! Jitter of the PWM interrupt: the interval from one to the next, by a counter that is not their
//! clock.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

static LAST: AtomicU32 = AtomicU32::new(0);
static MIN: AtomicU32 = AtomicU32::new(u32::MAX);
static MAX: AtomicU32 = AtomicU32::new(0);

/// Interrupts whose interval does not count: the first has none, and the start of the program
/// delays it, so that the second follows early.
const UNCOUNTED: u32 = 2;

/// Records the interrupt with that `index`, from 0, at the counter's value `now`. Only that
/// interrupt calls this, so reading and writing need not be one operation.
pub fn record(index: u32, now: u32) {
    let interval = now.wrapping_sub(LAST.load(Relaxed));
    LAST.store(now, Relaxed);
    if index < UNCOUNTED {
        return;
    }
    if interval < MIN.load(Relaxed) {
        MIN.store(interval, Relaxed);
    }
    if interval > MAX.load(Relaxed) {
        MAX.store(interval, Relaxed);
    }
}

/// Shortest and longest interval, counts; the first is above the second while there is none.
pub fn interval_range() -> (u32, u32) {
    (MIN.load(Relaxed), MAX.load(Relaxed))
}
