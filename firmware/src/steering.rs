//! The steering program in its two interrupts: the PWM task and the control task, with the
//! mailboxes between them. Which frames go in and out is the image's part.

use crate::board::{Board, Current};
use crate::tasks;
use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};
use critical_section::Mutex;
use embedded_hal::digital::OutputPin;
use embedded_hal::pwm::SetDutyCycle;
use shared_model::ecu::{ControlInput, ControlOutput, ControlTask, PwmTask};
use shared_model::exchange::FrameBytes;

/// From the PWM interrupt to the control task.
static INPUT: Mutex<Cell<ControlInput>> = Mutex::new(Cell::new(ControlInput::NOTHING));
/// From the control task to the PWM interrupt.
static OUTPUT: Mutex<Cell<Option<ControlOutput<f32>>>> = Mutex::new(Cell::new(None));
static CONTROL_TICKS: AtomicU32 = AtomicU32::new(0);

/// The PWM task and its pin.
pub struct Pwm {
    /// The program.
    pub task: PwmTask<f32>,
    /// The servo's PWM.
    pub pin: <Current as Board>::Pwm,
    /// The enable pin of the servo's bridge.
    pub bridge: <Current as Board>::Bridge,
}

/// The start of a PWM period.
pub struct Begun {
    /// A control tick is due at the end of the period.
    pub control_due: bool,
    /// The actuator frame of the last control tick, where a control tick is due.
    pub frame: Option<FrameBytes>,
    /// The servo's bridge is on in the period.
    pub bridge_on: bool,
}

impl Pwm {
    /// Begins a period: puts its duty on the pin and, where a control tick is due, takes over the
    /// result of the last one.
    pub fn begin(&mut self) -> Begun {
        let period = self.task.begin();
        // The second way to switch off: it acts at once, and not with the next period.
        let _ = if period.bridge_on {
            OutputPin::set_high(&mut self.bridge)
        } else {
            OutputPin::set_low(&mut self.bridge)
        };
        // The PWM's period is the duty's, so the code fits; one that is refused is found on the
        // pin.
        let _ = self.pin.set_duty_cycle(period.duty.code());
        let output = critical_section::with(|cs| {
            period
                .control_due
                .then(|| OUTPUT.borrow(cs).take())
                .flatten()
        });
        if let Some(output) = &output {
            self.task.accept(output);
        }
        Begun {
            control_due: period.control_due,
            frame: output.map(|output| output.frame),
            bridge_on: period.bridge_on,
        }
    }

    /// Makes the control task due, with its input.
    pub fn call_control(&mut self, frame: Option<FrameBytes>, elapsed_counts: u32) {
        let input = ControlInput {
            frame,
            elapsed_counts,
            found_by_pwm: self.task.faults(),
            bridge_on: self.task.bridge_on(),
        };
        critical_section::with(|cs| INPUT.borrow(cs).set(input));
        if !tasks::call_control() {
            self.task.report_late_control();
        }
    }
}

/// The control task.
pub struct Control {
    /// The program.
    pub task: ControlTask<f32>,
}

impl Control {
    /// One control tick.
    pub fn run(&mut self) {
        self.run_with(|input| input);
    }

    /// One control tick with an input that is completed here; returns its output.
    pub fn run_with(
        &mut self,
        complete: impl FnOnce(ControlInput) -> ControlInput,
    ) -> ControlOutput<f32> {
        let input = critical_section::with(|cs| INPUT.borrow(cs).get());
        let output = self.task.run(&complete(input));
        critical_section::with(|cs| OUTPUT.borrow(cs).set(Some(output)));
        CONTROL_TICKS.fetch_add(1, Ordering::Relaxed);
        output
    }
}

/// Control ticks so far.
pub fn control_ticks() -> u32 {
    CONTROL_TICKS.load(Ordering::Relaxed)
}
