//! The control path: the PWM interrupt, and the control task that it makes due.
//!
//! SysTick is the PWM interrupt, at high priority. Every so many samples it pends the PendSV exception, at low priority,
//! which runs the control task. So the two rates are locked, and the PWM interrupt preempts a control task that is still
//! at work. Nothing here can panic: the binary `panic-free` proves it at link time.

use crate::board::{Board, Current};
use crate::recorder::{DutyRecording, RecordProducer, count_overrun};
use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use critical_section::Mutex;
use embedded_hal::pwm::SetDutyCycle;
use shared_model::open_loop::{ControlTask, PwmTask};
use shared_model::telemetry::Record;

/// The dither sample that the PWM holds, as bits.
static DITHER_BITS: AtomicU32 = AtomicU32::new(0);
static CONTROL_DUE: AtomicBool = AtomicBool::new(false);
static FINISHED: AtomicBool = AtomicBool::new(false);
/// Most counts that the PWM interrupt took since the last control task.
static PWM_COST: AtomicU32 = AtomicU32::new(0);
static SAMPLES: AtomicU32 = AtomicU32::new(0);
static SAMPLES_A_MS: AtomicU32 = AtomicU32::new(1);

static PWM_START: Mutex<Cell<Option<PwmInterrupt>>> = Mutex::new(Cell::new(None));
static CONTROL_START: Mutex<Cell<Option<ControlInterrupt>>> = Mutex::new(Cell::new(None));

/// What the PWM interrupt works on.
pub struct PwmInterrupt {
    /// The program.
    pub task: PwmTask<f32>,
    /// The servo's PWM.
    pub pwm: <Current as Board>::Pwm,
    /// Where its duty codes go.
    pub recording: DutyRecording,
}

/// What the control interrupt works on.
pub struct ControlInterrupt {
    /// The program.
    pub task: ControlTask<f32>,
    /// Where its records go.
    pub records: RecordProducer,
    /// Model steps of the run.
    pub steps: u32,
    /// Model steps done.
    pub index: u32,
}

/// Hands the tasks to their interrupts, which take them at their first call.
pub fn hand_over(pwm: PwmInterrupt, control: ControlInterrupt, samples_a_ms: u32) {
    SAMPLES_A_MS.store(samples_a_ms.max(1), Ordering::Relaxed);
    critical_section::with(|cs| {
        PWM_START.borrow(cs).set(Some(pwm));
        CONTROL_START.borrow(cs).set(Some(control));
    });
}

/// The run's last step is done.
pub fn is_finished() -> bool {
    FINISHED.load(Ordering::Acquire)
}

/// Time since the start, ms, by the PWM's samples.
pub fn elapsed_ms() -> u32 {
    SAMPLES.load(Ordering::Relaxed) / SAMPLES_A_MS.load(Ordering::Relaxed).max(1)
}

impl PwmInterrupt {
    fn run(&mut self) {
        let sample = self.task.run();
        // The PWM's period is the duty's, so the code fits; a PWM that refuses it keeps the last one.
        if self.pwm.set_duty_cycle(sample.duty.code()).is_err() {
            count_overrun();
        }
        self.recording.push(Current::pwm_output().0);
        SAMPLES.fetch_add(1, Ordering::Relaxed);
        DITHER_BITS.store(sample.dither.to_bits(), Ordering::Relaxed);
        if sample.control_due {
            if CONTROL_DUE.swap(true, Ordering::Relaxed) {
                count_overrun();
            }
            SCB::set_pendsv();
        }
    }
}

impl ControlInterrupt {
    fn run(&mut self) {
        if self.index == self.steps {
            return;
        }
        let start = Current::cost_counter();
        let dither = f32::from_bits(DITHER_BITS.load(Ordering::Relaxed));
        let state = *self.task.run(dither);
        let cost = Current::cost_counter().wrapping_sub(start);
        self.index += 1;
        self.records.push(Record {
            index: self.index,
            state,
            control_cost: saturate(cost),
            pwm_cost: saturate(PWM_COST.swap(0, Ordering::Relaxed)),
        });
        if self.index == self.steps {
            Current::stop_pwm_interrupt();
            FINISHED.store(true, Ordering::Release);
        }
    }
}

fn saturate(counts: u32) -> u16 {
    counts.min(u16::MAX.into()) as u16
}

#[exception]
fn SysTick() {
    static mut INTERRUPT: Option<PwmInterrupt> = None;
    let start = Current::cost_counter();
    if INTERRUPT.is_none() {
        *INTERRUPT = critical_section::with(|cs| PWM_START.borrow(cs).take());
    }
    if let Some(interrupt) = INTERRUPT {
        interrupt.run();
    }
    let cost = Current::cost_counter().wrapping_sub(start);
    PWM_COST.fetch_max(cost, Ordering::Relaxed);
}

#[exception]
fn PendSV() {
    static mut INTERRUPT: Option<ControlInterrupt> = None;
    if INTERRUPT.is_none() {
        *INTERRUPT = critical_section::with(|cs| CONTROL_START.borrow(cs).take());
    }
    if let Some(interrupt) = INTERRUPT {
        interrupt.run();
    }
    CONTROL_DUE.store(false, Ordering::Relaxed);
}
