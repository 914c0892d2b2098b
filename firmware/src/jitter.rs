//! Time between the PWM's interrupts, by a counter that is not their clock.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

static LAST: AtomicU32 = AtomicU32::new(0);
static LEAST: AtomicU32 = AtomicU32::new(u32::MAX);
static MOST: AtomicU32 = AtomicU32::new(0);

/// Interrupts whose distance from the one before is not counted: the first has none, and the start of the program holds it up, so
/// that the second follows early.
const UNCOUNTED: u32 = 2;

/// The interrupt with that `index`, from 0, came at `now`, counts. Only that interrupt calls this, so reading and writing need not
/// be one.
pub fn note(index: u32, now: u32) {
    let spacing = now.wrapping_sub(LAST.load(Relaxed));
    LAST.store(now, Relaxed);
    if index < UNCOUNTED {
        return;
    }
    if spacing < LEAST.load(Relaxed) {
        LEAST.store(spacing, Relaxed);
    }
    if spacing > MOST.load(Relaxed) {
        MOST.store(spacing, Relaxed);
    }
}

/// Least and most counts from one interrupt to the next; the first above the second before there were enough.
pub fn extremes() -> (u32, u32) {
    (LEAST.load(Relaxed), MOST.load(Relaxed))
}
