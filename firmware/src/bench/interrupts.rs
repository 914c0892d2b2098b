//! The two tasks as interrupts, whichever program runs in them. Nothing here can panic: the binary
//! `panic-free` proves it at link time.

use super::pace::Pace;
use super::{counters, in_loop, jitter, open_loop};
use crate::board::{Board, Current};
use crate::{clock, tasks};
use core::cell::Cell;
use critical_section::Mutex;
use shared_model::Scenario;

/// The watchdog bites when no model step arrives for this many of its periods, or for this long,
/// ms, if that is longer.
const WATCHDOG_PERIODS: f32 = 4.0;
const WATCHDOG_LEAST_MS: u32 = 20;

static PWM_START: Mutex<Cell<Option<PwmInterrupt>>> = Mutex::new(Cell::new(None));
static CONTROL_START: Mutex<Cell<Option<ControlInterrupt>>> = Mutex::new(Cell::new(None));

/// The task of the PWM interrupt. By reference: an interrupt that moves a whole task needs the
/// stack for it, and delays the other for most of a fast PWM's period.
pub enum PwmInterrupt {
    /// The vehicle model runs on the ECU.
    OpenLoop(&'static mut open_loop::PwmInterrupt),
    /// The ECU steers a vehicle.
    InLoop(&'static mut in_loop::PwmInterrupt),
}

/// The task of the control interrupt.
pub enum ControlInterrupt {
    /// The vehicle model runs on the ECU.
    OpenLoop(&'static mut open_loop::ControlInterrupt),
    /// The ECU steers a vehicle.
    InLoop(&'static mut in_loop::ControlInterrupt),
}

/// PWM and enable pin of the servo's bridge.
type Servo = (<Current as Board>::Pwm, <Current as Board>::Bridge);

/// Starts PWM, interrupts and watchdog; `tasks` makes the tasks of the two interrupts. The control
/// task runs every `tick_s`. At the host's pace the timer never calls the PWM interrupt.
pub fn start(
    period: u16,
    scenario: &Scenario<f32>,
    tick_s: f32,
    pace: Pace,
    tasks: impl FnOnce(Servo) -> Option<(PwmInterrupt, ControlInterrupt)>,
) {
    let timeout_ms = (WATCHDOG_PERIODS * 1000.0 * tick_s) as u32;
    let samples_per_ms = (scenario.run.pwm_rate_hz / 1000.0) as u32;
    critical_section::with(|_| {
        // Started once, with a period that the scenario's check allows.
        let pwm = Current::start_pwm(period).ok();
        if let Some((pwm, control)) = pwm.and_then(tasks) {
            hand_over(pwm, control, samples_per_ms);
        }
        pace.set();
        tasks::set_priorities();
        Current::start_watchdog(timeout_ms.max(WATCHDOG_LEAST_MS));
    });
}

/// Hands the tasks to their interrupts, which take them at their first call.
pub fn hand_over(pwm: PwmInterrupt, control: ControlInterrupt, samples_per_ms: u32) {
    clock::set_rate(samples_per_ms);
    critical_section::with(|cs| {
        PWM_START.borrow(cs).set(Some(pwm));
        CONTROL_START.borrow(cs).set(Some(control));
    });
}

/// The PWM interrupt; `interrupt` is its own.
#[inline]
pub fn pwm(interrupt: &mut Option<PwmInterrupt>) {
    let start = counters::pwm_start();
    if interrupt.is_none() {
        *interrupt = critical_section::with(|cs| PWM_START.borrow(cs).take());
    }
    let index = clock::count_sample();
    if let Some(start) = start {
        jitter::record(index, start);
    }
    match interrupt {
        Some(PwmInterrupt::OpenLoop(interrupt)) => interrupt.run(),
        Some(PwmInterrupt::InLoop(interrupt)) => interrupt.run(),
        None => {}
    }
    if let Some(start) = start {
        counters::record_pwm_cost(start);
    }
}

/// The control interrupt; `interrupt` is its own.
#[inline]
pub fn control(interrupt: &mut Option<ControlInterrupt>) {
    if interrupt.is_none() {
        *interrupt = critical_section::with(|cs| CONTROL_START.borrow(cs).take());
    }
    match interrupt {
        Some(ControlInterrupt::OpenLoop(interrupt)) => interrupt.run(),
        Some(ControlInterrupt::InLoop(interrupt)) => interrupt.run(),
        None => {}
    }
    tasks::control_done();
}
