//! Counters of a run: overruns, and the cost of the PWM interrupt.

use crate::board::{Board, Current};
use core::sync::atomic::{AtomicU32, Ordering};

static OVERRUNS: AtomicU32 = AtomicU32::new(0);
/// Most counts that the PWM interrupt took since the last control task.
static PWM_COST: AtomicU32 = AtomicU32::new(0);
/// Counts that the PWM interrupt spent outside its task.
static FOREIGN_COST: AtomicU32 = AtomicU32::new(0);

/// Counts a record or duty code that was lost, or a task that was late. Any of them fails the run.
pub fn count_overrun() {
    OVERRUNS.fetch_add(1, Ordering::Relaxed);
}

/// Overruns so far.
pub fn overruns() -> u32 {
    OVERRUNS.load(Ordering::Relaxed)
}

/// Records the cost of a PWM interrupt that began at the counter's value `start`.
pub fn record_pwm_cost(start: u32) {
    let cost = Current::cost_counter().wrapping_sub(start);
    let foreign = FOREIGN_COST.swap(0, Ordering::Relaxed);
    PWM_COST.fetch_max(cost.wrapping_sub(foreign), Ordering::Relaxed);
}

/// Most counts of the cost clock that the PWM interrupt took since the last call.
pub fn take_pwm_cost() -> u16 {
    saturate(PWM_COST.swap(0, Ordering::Relaxed))
}

/// Leaves the counts that `f` takes out of the PWM interrupt's cost.
pub fn uncounted<O>(f: impl FnOnce() -> O) -> O {
    let start = Current::cost_counter();
    let output = f();
    let cost = Current::cost_counter().wrapping_sub(start);
    FOREIGN_COST.fetch_add(cost, Ordering::Relaxed);
    output
}

/// Counts as a record holds them.
pub fn saturate(counts: u32) -> u16 {
    counts.min(u16::MAX.into()) as u16
}
