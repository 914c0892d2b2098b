//! The ECU in the loop: sensor frames come over the link, duty codes and actuator frames go out on
//! it, and the host moves the vehicle in between.

use super::exit::{self, ExitCode};
use super::link::Link;
use super::pace::{self, Pace};
use super::{counters, run_state};
use crate::board::{Board, Current};
use crate::steering;
use core::sync::atomic::{AtomicU16, Ordering};
use shared_model::exchange::{FrameBytes, Packet, ToHost};

static CONTROL_COST: AtomicU16 = AtomicU16::new(0);

/// State of the PWM interrupt.
pub struct PwmInterrupt {
    /// The program and the servo's PWM.
    pub steering: steering::Pwm,
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
    pub steering: steering::Control,
}

impl PwmInterrupt {
    /// One PWM period.
    pub fn run(&mut self) {
        let begun = self.steering.begin();
        let sent = ToHost {
            packet: Packet {
                // As it is on the pin.
                duty_code: Current::pwm_output().0,
                bridge_on: begun.bridge_on,
                frame: begun.frame,
            },
            pwm_cost: if begun.control_due {
                counters::take_pwm_cost()
            } else {
                0
            },
            control_cost: CONTROL_COST.load(Ordering::Relaxed),
        };
        let due = begun.control_due;
        let Ok(received) = counters::uncounted(|| self.link.exchange(&sent, due)) else {
            exit::end_safely(ExitCode::LinkLost);
        };
        if received.stop {
            run_state::finish();
            return;
        }
        self.steering.task.end(received.packet.duty_code);
        self.frame = received.packet.frame.or(self.frame);
        if begun.control_due {
            self.call_control();
        }
        pace::end_period(begun.control_due);
    }

    fn call_control(&mut self) {
        let elapsed_counts = match self.link.pace {
            Pace::Host => self.nominal_counts,
            Pace::Timer => {
                let now = Current::cost_counter();
                now.wrapping_sub(core::mem::replace(&mut self.last_tick_counts, now))
            }
        };
        self.steering
            .call_control(self.frame.take(), elapsed_counts);
    }
}

impl ControlInterrupt {
    /// One control tick.
    pub fn run(&mut self) {
        let start = Current::cost_counter();
        self.steering.run();
        let cost = Current::cost_counter().wrapping_sub(start);
        CONTROL_COST.store(counters::saturate(cost), Ordering::Relaxed);
    }
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
