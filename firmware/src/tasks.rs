//! The two tasks as interrupts, whichever program runs in them.
//!
//! SysTick is the PWM interrupt, at high priority. Every so many samples it pends the PendSV exception, at low priority,
//! which runs the control task. So the two rates are locked, and the PWM interrupt preempts a control task that is still
//! at work. Nothing here can panic: the binary `panic-free` proves it at link time.

use crate::board::{Board, Current};
use crate::{in_loop, open_loop, spacing};
use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use critical_section::Mutex;

static CONTROL_DUE: AtomicBool = AtomicBool::new(false);
static FINISHED: AtomicBool = AtomicBool::new(false);
/// Most counts that the PWM interrupt took since the last control task.
static PWM_COST: AtomicU32 = AtomicU32::new(0);
/// Counts that the PWM interrupt spent on what is not its task.
static FOREIGN_COST: AtomicU32 = AtomicU32::new(0);
static SAMPLES: AtomicU32 = AtomicU32::new(0);
static SAMPLES_A_MS: AtomicU32 = AtomicU32::new(1);

static PWM_START: Mutex<Cell<Option<PwmInterrupt>>> = Mutex::new(Cell::new(None));
static CONTROL_START: Mutex<Cell<Option<ControlInterrupt>>> = Mutex::new(Cell::new(None));

/// What the PWM interrupt works on. By reference: an interrupt that moves a whole task needs the stack for it,
/// and holds up the other for most of a fast PWM's period.
pub enum PwmInterrupt {
    /// The vehicle model runs on the ECU.
    OpenLoop(&'static mut open_loop::PwmInterrupt),
    /// The ECU steers a vehicle.
    InLoop(&'static mut in_loop::PwmInterrupt),
}

/// What the control interrupt works on.
pub enum ControlInterrupt {
    /// The vehicle model runs on the ECU.
    OpenLoop(&'static mut open_loop::ControlInterrupt),
    /// The ECU steers a vehicle.
    InLoop(&'static mut in_loop::ControlInterrupt),
}

/// Hands the tasks to their interrupts, which take them at their first call.
pub fn hand_over(pwm: PwmInterrupt, control: ControlInterrupt, samples_a_ms: u32) {
    SAMPLES_A_MS.store(samples_a_ms.max(1), Ordering::Relaxed);
    critical_section::with(|cs| {
        PWM_START.borrow(cs).set(Some(pwm));
        CONTROL_START.borrow(cs).set(Some(control));
    });
}

/// Makes the control task due; false if it has not been done since it was last due.
pub fn call_control() -> bool {
    let was_done = !CONTROL_DUE.swap(true, Ordering::Relaxed);
    SCB::set_pendsv();
    was_done
}

/// The run is over: no PWM interrupt comes any more.
pub fn finish() {
    Current::stop_pwm_interrupt();
    FINISHED.store(true, Ordering::Release);
}

/// The run is over.
pub fn is_finished() -> bool {
    FINISHED.load(Ordering::Acquire)
}

/// Time since the start, ms, by the PWM's samples.
pub fn elapsed_ms() -> u32 {
    SAMPLES.load(Ordering::Relaxed) / SAMPLES_A_MS.load(Ordering::Relaxed).max(1)
}

/// Most counts of the cost clock that the PWM interrupt took since this was last asked.
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

/// Counts as a record has them.
pub fn saturate(counts: u32) -> u16 {
    counts.min(u16::MAX.into()) as u16
}

#[exception]
fn SysTick() {
    static mut INTERRUPT: Option<PwmInterrupt> = None;
    let start = Current::cost_counter();
    if INTERRUPT.is_none() {
        *INTERRUPT = critical_section::with(|cs| PWM_START.borrow(cs).take());
    }
    spacing::note(SAMPLES.fetch_add(1, Ordering::Relaxed), start);
    match INTERRUPT {
        Some(PwmInterrupt::OpenLoop(interrupt)) => interrupt.run(),
        Some(PwmInterrupt::InLoop(interrupt)) => interrupt.run(),
        None => {}
    }
    let cost = Current::cost_counter().wrapping_sub(start);
    let foreign = FOREIGN_COST.swap(0, Ordering::Relaxed);
    PWM_COST.fetch_max(cost.wrapping_sub(foreign), Ordering::Relaxed);
}

#[exception]
fn PendSV() {
    static mut INTERRUPT: Option<ControlInterrupt> = None;
    if INTERRUPT.is_none() {
        *INTERRUPT = critical_section::with(|cs| CONTROL_START.borrow(cs).take());
    }
    match INTERRUPT {
        Some(ControlInterrupt::OpenLoop(interrupt)) => interrupt.run(),
        Some(ControlInterrupt::InLoop(interrupt)) => interrupt.run(),
        None => {}
    }
    CONTROL_DUE.store(false, Ordering::Relaxed);
}
