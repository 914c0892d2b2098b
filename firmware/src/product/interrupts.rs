//! The two tasks in their interrupts. Nothing here can panic: the binary `panic-free` proves it at
//! link time.

use super::bus::ProductBus;
use super::diagnosis::Diagnosis;
use crate::board::{Board, Current};
use crate::{clock, steering, tasks};
use core::arch::naked_asm;
use core::cell::Cell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use critical_section::Mutex;
use shared_model::bus::{Bus, Message, latest};
use shared_model::ecu::ControlInput;
use shared_model::exchange::FrameBytes;
use shared_model::independent_clock::ClockCheck;
use shared_model::signal::Mode;

/// Time of a tick that is in no window of the gate, counts.
const NOT_IN_TIME: u32 = 0;

static PWM_START: Mutex<Cell<Option<&'static mut PwmInterrupt>>> = Mutex::new(Cell::new(None));
static CONTROL_START: Mutex<Cell<Option<&'static mut ControlInterrupt>>> =
    Mutex::new(Cell::new(None));
static GATE_FAULTS: AtomicU32 = AtomicU32::new(0);
static MODE: AtomicU8 = AtomicU8::new(Mode::Starting as u8);

/// State of the PWM interrupt.
pub struct PwmInterrupt {
    /// The program and the servo's PWM.
    pub steering: steering::Pwm,
    /// The cost counter at the last control tick.
    pub last_tick_counts: u32,
    /// The check by the independent clock.
    pub clock_check: ClockCheck,
}

/// State of the control interrupt, which has the bus to itself.
pub struct ControlInterrupt {
    /// The program.
    pub steering: steering::Control,
    /// The bus.
    pub bus: ProductBus,
    /// Frame of the last control tick: the vehicle gets it when it takes effect.
    pub frame: Option<FrameBytes>,
    /// Diagnostic frames.
    pub diagnosis: Diagnosis,
    /// Control ticks between two diagnostic frames.
    pub diagnosis_ticks: u32,
    /// Control ticks to the next diagnostic frame.
    pub ticks_to_diagnosis: u32,
}

impl PwmInterrupt {
    fn run(&mut self) {
        let begun = self.steering.begin();
        self.steering.task.end(Current::pwm_output().0);
        if begun.control_due {
            let now = Current::cost_counter();
            let elapsed_counts = now.wrapping_sub(self.last_tick_counts);
            self.last_tick_counts = now;
            let in_time = self.clock_check.tick(Current::independent_counter());
            // The gate's own fault for a tick that is not in its window.
            let elapsed_counts = if in_time { elapsed_counts } else { NOT_IN_TIME };
            self.steering.call_control(None, elapsed_counts);
        }
    }
}

impl ControlInterrupt {
    fn run(&mut self) {
        self.send();
        before_sensor_frame(&raw mut MARK);
        let frame = latest(&mut self.bus, Message::Sensor);
        let output = self
            .steering
            .run_with(|input| ControlInput { frame, ..input });
        self.frame = Some(output.frame);
        GATE_FAULTS.store(output.actuation.faults, Ordering::Relaxed);
        MODE.store(output.actuation.mode as u8, Ordering::Relaxed);
    }

    /// A message without room is lost, as on any bus that is too slow.
    fn send(&mut self) {
        if let Some(frame) = self.frame {
            let _ = self.bus.send(Message::Actuator, &frame);
        }
        self.ticks_to_diagnosis = self.ticks_to_diagnosis.saturating_sub(1);
        if self.ticks_to_diagnosis == 0 {
            self.ticks_to_diagnosis = self.diagnosis_ticks;
            let frame = self.diagnosis.frame(steering::control_ticks());
            let _ = self.bus.send(Message::Diagnostic, &frame);
        }
    }
}

/// Written by each control tick after its duties and frames, and before its input is taken: a
/// debugger that plays the vehicle watches it. Not zeroed by the start-up code, which would be a
/// write, too.
// SAFETY: without a start value, and never read; nothing else has this name.
#[unsafe(link_section = ".uninit.mark")]
#[unsafe(export_name = "BEFORE_SENSOR_FRAME")]
static mut MARK: MaybeUninit<u32> = MaybeUninit::uninit();

/// Writes the mark with its first instruction, of two bytes, which the debugger then skips: the
/// emulator would stop at it again.
// SAFETY: nothing else has this name; only the control task writes the mark, and nothing reads it.
#[unsafe(naked)]
#[unsafe(no_mangle)]
extern "C" fn before_sensor_frame(mark: *mut MaybeUninit<u32>) {
    naked_asm!("str r0, [r0]", "bx lr")
}

/// Faults of the gate in the last control tick, one bit each.
pub fn gate_faults() -> u32 {
    GATE_FAULTS.load(Ordering::Relaxed)
}

/// Mode in the last control tick.
pub fn mode() -> Mode {
    Mode::from_code(MODE.load(Ordering::Relaxed)).unwrap_or(Mode::Safe)
}

/// Hands the tasks to their interrupts, which take them at their first call.
pub fn hand_over(
    pwm: &'static mut PwmInterrupt,
    control: &'static mut ControlInterrupt,
    samples_per_ms: u32,
) {
    clock::set_rate(samples_per_ms);
    critical_section::with(|cs| {
        PWM_START.borrow(cs).set(Some(pwm));
        CONTROL_START.borrow(cs).set(Some(control));
    });
}

/// The PWM interrupt; `interrupt` is its own.
#[inline]
pub fn pwm(interrupt: &mut Option<&'static mut PwmInterrupt>) {
    if interrupt.is_none() {
        *interrupt = critical_section::with(|cs| PWM_START.borrow(cs).take());
    }
    clock::count_sample();
    if let Some(interrupt) = interrupt {
        interrupt.run();
    }
}

/// The control interrupt; `interrupt` is its own.
#[inline]
pub fn control(interrupt: &mut Option<&'static mut ControlInterrupt>) {
    if interrupt.is_none() {
        *interrupt = critical_section::with(|cs| CONTROL_START.borrow(cs).take());
    }
    if let Some(interrupt) = interrupt {
        interrupt.run();
    }
    tasks::control_done();
}
