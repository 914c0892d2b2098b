//! The ECU's program in the loop: sensor frames in, duty codes and actuator frames out.
//!
//! The PWM task runs at the PWM rate, in an interrupt, and signals when a control tick is due. The
//! control task checks the sensor frame, runs the controller, and passes both to the gate. Its
//! result acts from the next control tick on, however long it took, so that the timing of
//! interrupts cannot change a result.
//!
//! Both tasks run twice, on two sets of parameters and state in memory (`dual_channel`). A mismatch
//! indicates memory corruption, latches the safe state and switches the servo's bridge off; until
//! that acts, the duty closer to neutral is put out. The actuator frame is the first channel's, with the lower of both wheel
//! speed limits. [`Ecu`] runs the tasks in turn on the host; firmware runs them at two priorities.
//! Both give the same bits.

mod consistency;
mod control;
mod dual_channel;
mod pwm;
mod reception;
mod warning;

pub use control::{ControlInput, ControlOutput, ControlTask};
pub use pwm::{PwmPeriod, PwmTask};
pub use warning::Warning;

use crate::exchange::{FrameBytes, Packet};
use crate::{InvalidScenario, Real, Scenario};

/// The whole program, its tasks run in turn.
#[derive(Debug, Clone)]
pub struct Ecu<T: Real> {
    /// The task at the PWM rate.
    pub pwm: PwmTask<T>,
    /// The task at the control rate.
    pub control: ControlTask<T>,
    output: Option<ControlOutput<T>>,
    /// The sensor frame that came since the last control tick.
    frame: Option<FrameBytes>,
}

impl<T: Real> Ecu<T> {
    /// The program of a scenario; its independent clock runs at `clock_hz`.
    ///
    /// # Errors
    /// If the scenario is not valid, or the gate would refuse its controller's commands.
    // Out of line: the stack for it is free again when the tasks run.
    #[inline(never)]
    pub fn new(scenario: &Scenario<T>, clock_hz: u32) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        consistency::check(scenario)?;
        Ok(Self {
            pwm: PwmTask::new(scenario),
            control: ControlTask::new(scenario, clock_hz),
            output: None,
            frame: None,
        })
    }

    /// One PWM period: `exchange` takes the ECU's output at its start and returns the input at its
    /// end. `elapsed_counts` is the time since the last control tick by the independent clock,
    /// read where one is due. Returns the result of the control task, if it ran.
    pub fn period(
        &mut self,
        exchange: impl FnOnce(&Packet) -> Packet,
        elapsed_counts: impl FnOnce() -> u32,
    ) -> Option<ControlOutput<T>> {
        let begun = self.begin();
        let reply = exchange(&begun.packet);
        self.end(&begun, &reply, elapsed_counts)
    }

    /// The first half of a [`period`](Self::period): its begin.
    pub fn begin(&mut self) -> Begun {
        let period = self.pwm.begin();
        let output = self.output.take_if(|_| period.control_due);
        if let Some(output) = &output {
            self.pwm.accept(output);
        }
        Begun::of(&period, output.as_ref())
    }

    /// The second half: its end, with the input there.
    pub fn end(
        &mut self,
        begun: &Begun,
        reply: &Packet,
        elapsed_counts: impl FnOnce() -> u32,
    ) -> Option<ControlOutput<T>> {
        self.pwm.end(reply.duty_code);
        self.frame = reply.frame.or(self.frame);
        if !begun.control_due {
            return None;
        }
        let input = ControlInput {
            frame: self.frame.take(),
            elapsed_counts: elapsed_counts(),
            found_by_pwm: self.pwm.faults(),
            bridge_on: self.pwm.bridge_on(),
        };
        let output = self.control.run(&input);
        self.output = Some(output);
        Some(output)
    }

    /// The output at the start of the next period, before the begun one ends. The input at that end
    /// does not change it. (A wrong duty on the pin does: it switches the bridge off. And with a
    /// control tick in every period, the actuator frame depends on it, and is missing here.)
    pub fn ahead(&self) -> Begun {
        let period = self.pwm.clone().begin();
        let output = self.output.as_ref().filter(|_| period.control_due);
        Begun::of(&period, output)
    }
}

/// A PWM period that has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Begun {
    /// The ECU's output at its start.
    pub packet: Packet,
    /// A control tick is due at its end.
    pub control_due: bool,
}

impl Begun {
    fn of<T>(period: &PwmPeriod, output: Option<&ControlOutput<T>>) -> Self {
        Self {
            packet: Packet {
                duty_code: period.duty.code(),
                bridge_on: period.bridge_on,
                frame: output.map(|output| output.frame),
            },
            control_due: period.control_due,
        }
    }
}
