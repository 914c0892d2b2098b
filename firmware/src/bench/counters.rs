//! Counters of a run: overruns, and the cost of the PWM interrupt.

use crate::board::{Board, Current};
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Whether the PWM interrupt is measured.
static MEASURES_PWM: AtomicBool = AtomicBool::new(true);
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
/// Most counts that the PWM interrupt took since the last control task.
static PWM_COST: AtomicU32 = AtomicU32::new(0);
/// Counts that the PWM interrupt spent outside its task.
static FOREIGN_COST: AtomicU32 = AtomicU32::new(0);

/// Leaves the PWM interrupt unmeasured: its cost is then 0. A read of the emulator's timer takes about as
/// long as the interrupt's task. For use before the interrupt is enabled.
pub fn leave_pwm_unmeasured() {
    MEASURES_PWM.store(false, Ordering::Relaxed);
}

/// The counter's value at the start of a PWM interrupt; `None` if it is unmeasured.
pub fn pwm_start() -> Option<u32> {
    let measures = MEASURES_PWM.load(Ordering::Relaxed);
    measures.then(Current::cost_counter)
}

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
    let Some(start) = pwm_start() else {
        return f();
    };
    let output = f();
    let cost = Current::cost_counter().wrapping_sub(start);
    FOREIGN_COST.fetch_add(cost, Ordering::Relaxed);
    output
}

/// Counts as a record holds them.
pub fn saturate(counts: u32) -> u16 {
    counts.min(u16::MAX.into()) as u16
}
