//! The ECU in the loop: sensor frames come over the link, duty codes and actuator frames go out on
//! it, and the host moves the vehicle in between.

use crate::board::{Board, Current};
use crate::exit::ExitCode;
use crate::link::{Link, Pace};
use crate::{counters, fault, tasks};
use core::cell::Cell;
use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};
use critical_section::Mutex;
use embedded_hal::pwm::SetDutyCycle;
use shared_model::ecu::{ControlInput, ControlOutput, ControlTask, PwmTask};
use shared_model::exchange::{FrameBytes, Packet, ToHost};

/// From the PWM interrupt to the control task.
static INPUT: Mutex<Cell<ControlInput>> = Mutex::new(Cell::new(ControlInput::NOTHING));
/// From the control task to the PWM interrupt.
static OUTPUT: Mutex<Cell<Option<ControlOutput<f32>>>> = Mutex::new(Cell::new(None));
static CONTROL_COST: AtomicU16 = AtomicU16::new(0);
static CONTROL_TICKS: AtomicU32 = AtomicU32::new(0);

/// State of the PWM interrupt.
pub struct PwmInterrupt {
    /// The program.
    pub task: PwmTask<f32>,
    /// The servo's PWM.
    pub pwm: <Current as Board>::Pwm,
    /// Servo and sensors, simulated by the host.
    pub link: Link,
    /// The sensor frame that came since the last control tick.
    pub frame: Option<FrameBytes>,
    /// The independent clock at the last control tick, counts.
    pub last_tick_counts: u32,
    /// Counts of that clock in a control tick at the host's pace.
    pub nominal_counts: u32,
}

/// State of the control interrupt.
pub struct ControlInterrupt {
    /// The program.
    pub task: ControlTask<f32>,
}

impl PwmInterrupt {
    /// One PWM period.
    pub fn run(&mut self) {
        let period = self.task.begin();
        // The PWM's period is the duty's, so the code fits; one that is refused is found on the
        // pin.
        let _ = self.pwm.set_duty_cycle(period.duty.code());
        let output = critical_section::with(|cs| {
            period
                .control_due
                .then(|| OUTPUT.borrow(cs).take())
                .flatten()
        });
        if let Some(output) = &output {
            self.task.accept(output);
        }
        let sent = ToHost {
            packet: Packet {
                // As it is on the pin.
                duty_code: Current::pwm_output().0,
                frame: output.map(|output| output.frame),
            },
            pwm_cost: if period.control_due {
                counters::take_pwm_cost()
            } else {
                0
            },
            control_cost: CONTROL_COST.load(Ordering::Relaxed),
        };
        let Ok(received) = counters::uncounted(|| self.link.exchange(&sent)) else {
            fault::end_safely(ExitCode::LinkLost);
        };
        if received.stop {
            tasks::finish();
            return;
        }
        self.task.end(received.packet.duty_code);
        self.frame = received.packet.frame.or(self.frame);
        if period.control_due {
            self.call_control();
        }
    }

    fn call_control(&mut self) {
        let now = Current::cost_counter();
        let elapsed_counts = match self.link.pace {
            Pace::Host => self.nominal_counts,
            Pace::Timer => now.wrapping_sub(self.last_tick_counts),
        };
        let input = ControlInput {
            frame: self.frame.take(),
            elapsed_counts,
            found_by_pwm: self.task.faults(),
        };
        self.last_tick_counts = now;
        critical_section::with(|cs| INPUT.borrow(cs).set(input));
        if !tasks::call_control() {
            self.task.report_late_control();
        }
    }
}

impl ControlInterrupt {
    /// One control tick.
    pub fn run(&mut self) {
        let start = Current::cost_counter();
        let input = critical_section::with(|cs| INPUT.borrow(cs).get());
        let output = self.task.run(&input);
        critical_section::with(|cs| OUTPUT.borrow(cs).set(Some(output)));
        let cost = Current::cost_counter().wrapping_sub(start);
        CONTROL_COST.store(counters::saturate(cost), Ordering::Relaxed);
        CONTROL_TICKS.fetch_add(1, Ordering::Relaxed);
    }
}

/// Control ticks so far.
pub fn control_ticks() -> u32 {
    CONTROL_TICKS.load(Ordering::Relaxed)
}

// Functions of their own, so that the two have names in the image: faults are injected there.

/// The PWM interrupt's task in its place in memory; `None` at the second call.
pub fn place_pwm(interrupt: PwmInterrupt) -> Option<&'static mut PwmInterrupt> {
    cortex_m::singleton!(: PwmInterrupt = interrupt)
}

/// The control interrupt's task in its place in memory; `None` at the second call.
pub fn place_control(interrupt: ControlInterrupt) -> Option<&'static mut ControlInterrupt> {
    cortex_m::singleton!(: ControlInterrupt = interrupt)
}
