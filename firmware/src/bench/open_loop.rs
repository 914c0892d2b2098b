//! The ECU in open loop: it runs the vehicle model itself, and its telemetry is compared with the
//! host's.

use super::counters::{self, count_overrun};
use super::recorder::{DutyRecording, RecordProducer};
use super::{pace, run_state};
use crate::board::{Board, Current};
use crate::tasks;
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_hal::pwm::SetDutyCycle;
use shared_model::open_loop::{ControlTask, PwmTask};
use shared_model::telemetry::Record;

/// The dither sample that the PWM holds, as bits.
static DITHER_BITS: AtomicU32 = AtomicU32::new(0);

/// State of the PWM interrupt.
pub struct PwmInterrupt {
    /// The program.
    pub task: PwmTask<f32>,
    /// The servo's PWM.
    pub pwm: <Current as Board>::Pwm,
    /// Where its duty codes go.
    pub recording: DutyRecording,
}

/// State of the control interrupt.
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

impl PwmInterrupt {
    /// One PWM period.
    pub fn run(&mut self) {
        let sample = self.task.run();
        // The PWM's period is the duty's, so the code fits; a PWM that refuses it keeps the last
        // one.
        if self.pwm.set_duty_cycle(sample.duty.code()).is_err() {
            count_overrun();
        }
        self.recording.push(Current::pwm_output().0);
        DITHER_BITS.store(sample.dither.to_bits(), Ordering::Relaxed);
        if sample.control_due && !tasks::call_control() {
            count_overrun();
        }
        pace::end_period(sample.control_due);
    }
}

impl ControlInterrupt {
    /// One model step.
    pub fn run(&mut self) {
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
            control_cost: counters::saturate(cost),
            pwm_cost: counters::take_pwm_cost(),
        });
        if self.index == self.steps {
            run_state::finish();
        }
    }
}
