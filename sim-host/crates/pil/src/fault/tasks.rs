//! The ECU's program on the host. Its two tasks are scheduled as by the firmware's interrupts,
//! which can fail, as can its controller.

use super::catalogue::{ControllerFailure, TimingFailure};
use super::failed_controller::FailedController;
use shared_model::ecu::{ControlInput, ControlOutput, ControlTask, Ecu, PwmTask};
use shared_model::exchange::{FrameBytes, Packet};
use shared_model::{InvalidScenario, Scenario};

/// Rate of the independent clock, Hz.
const CLOCK_HZ: u32 = 25_000_000;

/// An unfinished control task.
#[derive(Debug, Clone)]
struct Pending {
    input: ControlInput,
    /// PWM periods until it finishes; `None` if it never does.
    periods: Option<u32>,
}

/// The program and its interrupts.
#[derive(Debug, Clone)]
pub struct Tasks {
    scenario: Scenario<f32>,
    pwm: PwmTask<f32>,
    control: ControlTask<f32>,
    output: Option<ControlOutput<f32>>,
    frame: Option<FrameBytes>,
    pending: Option<Pending>,
    counts_per_period: f64,
    clock_ratio: f64,
    counts: f64,
    counts_at_tick: f64,
    duty_code: u16,
    bridge_on: bool,
    failure: Option<TimingFailure>,
    failed_controller: Option<FailedController>,
}

impl Tasks {
    /// The program of a scenario.
    ///
    /// # Errors
    /// If the scenario is invalid.
    pub fn new(scenario: &Scenario<f32>) -> Result<Self, InvalidScenario> {
        let Ecu { pwm, control, .. } = Ecu::new(scenario, CLOCK_HZ)?;
        Ok(Self {
            scenario: *scenario,
            duty_code: pwm.neutral().code(),
            bridge_on: pwm.bridge_on(),
            pwm,
            control,
            output: None,
            frame: None,
            pending: None,
            counts_per_period: f64::from(CLOCK_HZ) / f64::from(scenario.run.pwm_rate_hz),
            clock_ratio: 1.0,
            counts: 0.0,
            counts_at_tick: 0.0,
            failure: None,
            failed_controller: None,
        })
    }

    /// Begins a failure of interrupts or clock. Call directly after a control tick.
    pub fn fail(&mut self, failure: TimingFailure) {
        match failure {
            TimingFailure::Clock(ratio) => self.clock_ratio = ratio,
            TimingFailure::Reset => {
                *self = Self::new(&self.scenario).expect("it was valid before");
            }
            _ => self.failure = Some(failure),
        }
    }

    /// Begins a failure of the controller. Call directly after a control tick.
    pub fn fail_controller(&mut self, failure: ControllerFailure) {
        let control_period_s = 1.0 / self.scenario.run.control_rate_hz;
        self.failed_controller = Some(FailedController::new(failure, control_period_s));
    }

    /// One PWM period; `answer` as for any ECU in the loop.
    pub fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) {
        self.counts += self.counts_per_period * self.clock_ratio;
        match self.failure {
            Some(TimingFailure::MissedPwm(count)) => {
                self.failure = (count > 1).then_some(TimingFailure::MissedPwm(count - 1));
                self.miss(answer);
            }
            Some(TimingFailure::DoublePwm(count)) => {
                self.failure = (count > 1).then_some(TimingFailure::DoublePwm(count - 1));
                let mut first = None;
                self.interrupt(&mut |sent| {
                    first = sent.frame;
                    Packet {
                        frame: None,
                        ..*sent
                    }
                });
                // The second call's duty overwrites the first's before the period is over.
                self.interrupt(&mut |sent| {
                    answer(&Packet {
                        frame: sent.frame.or(first),
                        ..*sent
                    })
                });
            }
            _ => self.interrupt(answer),
        }
    }

    /// A period without a PWM interrupt: the servo keeps its duty, and a sensor frame waits.
    fn miss(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) {
        let reply = answer(&Packet {
            duty_code: self.duty_code,
            bridge_on: self.bridge_on,
            frame: None,
        });
        self.frame = reply.frame.or(self.frame);
    }

    fn interrupt(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) {
        let period = self.pwm.begin();
        let output = self.output.take_if(|_| period.control_due);
        let frame = output.as_ref().map(|output| output.frame);
        if let Some(output) = output {
            self.pwm.accept(&output);
        }
        self.duty_code = period.duty.code();
        self.bridge_on = period.bridge_on;
        let reply = answer(&Packet {
            duty_code: self.duty_code,
            bridge_on: self.bridge_on,
            frame,
        });
        self.pwm.end(reply.duty_code);
        self.frame = reply.frame.or(self.frame);
        if period.control_due {
            self.call_control();
        }
        self.run_pending();
    }

    fn call_control(&mut self) {
        let input = ControlInput {
            frame: self.frame.take(),
            elapsed_counts: (self.counts - self.counts_at_tick) as u32,
            found_by_pwm: self.pwm.faults(),
            bridge_on: self.pwm.bridge_on(),
        };
        self.counts_at_tick = self.counts;
        if let Some(late) = &mut self.pending {
            self.pwm.report_late_control();
            // It is still running or is called now; in both cases it takes the newer input.
            late.input = input;
            late.periods = late.periods.or(Some(0));
            return;
        }
        let periods = match self.failure.take() {
            Some(TimingFailure::MissedControl) => None,
            Some(TimingFailure::Overrun(periods)) => Some(periods),
            Some(TimingFailure::DoubleControl) => {
                self.run_control(&input);
                Some(0)
            }
            other => {
                self.failure = other;
                Some(0)
            }
        };
        self.pending = Some(Pending { input, periods });
    }

    fn run_pending(&mut self) {
        let Some(pending) = &mut self.pending else {
            return;
        };
        match &mut pending.periods {
            Some(0) => {
                let input = pending.input;
                self.pending = None;
                self.output = Some(self.run_control(&input));
            }
            Some(periods) => *periods -= 1,
            None => {}
        }
    }

    fn run_control(&mut self, input: &ControlInput) -> ControlOutput<f32> {
        let Some(failed) = &mut self.failed_controller else {
            return self.control.run(input);
        };
        failed.begin_tick();
        self.control
            .run_with(input, &mut |command| failed.change(command))
    }
}
