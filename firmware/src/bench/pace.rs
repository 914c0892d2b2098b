//! The source of the PWM periods' timing.
//!
//! At the host's pace the main loop pends the PWM interrupt of a control tick's first period, and
//! each other period follows the last one without a return to the main loop (tail-chaining), which
//! saves most of what the emulator does for an interrupt.

use super::run_state;
use crate::board::{Board, Current};
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::SCB;

static IS_HOSTS: AtomicBool = AtomicBool::new(false);

/// The source of the PWM periods' timing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// The host of the emulator: a period begins when the work of the last one is done, and each
    /// counts as its nominal time. The emulator then has no time to pass. Nothing is measured whose
    /// clock is the board's timer: the intervals of the PWM interrupts.
    Host,
    /// The board's timer, by whose clock the gate measures the control ticks.
    Timer,
}

impl Pace {
    /// The pace of that name.
    pub fn of(name: &str) -> Option<Self> {
        match name {
            "host" => Some(Self::Host),
            "timer" => Some(Self::Timer),
            _ => None,
        }
    }
}

impl Pace {
    /// Sets the pace of the PWM interrupt. For use after its timer is started, inside the same critical
    /// section: a timer that is faster than the task would leave no time to stop it.
    pub fn set(self) {
        if self == Self::Host {
            Current::stop_pwm_interrupt();
            SCB::clear_pendst();
            IS_HOSTS.store(true, Ordering::Relaxed);
        }
    }
}

/// At the end of a PWM interrupt: at the host's pace, pends the next one, unless the control task
/// is due before it.
pub fn end_period(control_due: bool) {
    if !control_due && IS_HOSTS.load(Ordering::Relaxed) && !run_state::is_finished() {
        SCB::set_pendst();
    }
}

/// Pends the PWM interrupt of the next period, in the main loop at the host's pace.
pub fn begin_period() {
    drop_float_context();
    SCB::set_pendst();
}

/// Marks the floating-point registers of the main loop as not in use: interrupts then do not save
/// them.
fn drop_float_context() {
    // SAFETY: clears CONTROL.FPCA, the flag of a context in use. An interrupt keeps the registers
    // that a function has to keep, and all others are given up here.
    unsafe {
        core::arch::asm!(
            "mrs {control}, control",
            "bic {control}, {control}, #4",
            "msr control, {control}",
            "isb",
            control = out(reg) _,
            out("s0") _, out("s1") _, out("s2") _, out("s3") _,
            out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _,
            out("s12") _, out("s13") _, out("s14") _, out("s15") _,
        );
    }
}
