//! The ECU in open loop: it runs the vehicle model itself, and its telemetry is compared with the host's.

use crate::board::{Board, Current};
use crate::exit::ExitCode;
use crate::host_file::HostFileError;
use crate::recorder::{self, DutyRecording, RecordProducer, Recorder, count_overrun};
use crate::{app, tasks};
use core::sync::atomic::{AtomicU32, Ordering};
use embedded_hal::pwm::SetDutyCycle;
use shared_model::Scenario;
use shared_model::open_loop::{ControlTask, OpenLoop, PwmTask};
use shared_model::telemetry::{Header, Record};

/// The dither sample that the PWM holds, as bits.
static DITHER_BITS: AtomicU32 = AtomicU32::new(0);

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

impl PwmInterrupt {
    /// One PWM period.
    pub fn run(&mut self) {
        let sample = self.task.run();
        // The PWM's period is the duty's, so the code fits; a PWM that refuses it keeps the last one.
        if self.pwm.set_duty_cycle(sample.duty.code()).is_err() {
            count_overrun();
        }
        self.recording.push(Current::pwm_output().0);
        DITHER_BITS.store(sample.dither.to_bits(), Ordering::Relaxed);
        if sample.control_due && !tasks::call_control() {
            count_overrun();
        }
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
            control_cost: tasks::saturate(cost),
            pwm_cost: tasks::take_pwm_cost(),
        });
        if self.index == self.steps {
            tasks::finish();
        }
    }
}

/// Runs the scenario to its end, with telemetry into the host's file called `telemetry`.
///
/// # Errors
/// If the host cannot write the file.
pub fn run(
    scenario: &Scenario<f32>,
    ecu: OpenLoop<f32>,
    telemetry: Option<&str>,
) -> Result<ExitCode, HostFileError> {
    let neutral = ecu.pwm.neutral();
    let header = Header {
        samples_per_step: scenario.samples_per_step() as u16,
        step_rate_hz: (scenario.model_rate_hz() + 0.5) as u32,
        pwm_period: neutral.period(),
        cost_clock_hz: Current::COST_CLOCK_HZ,
        instruction_rate_hz: Current::INSTRUCTION_RATE_HZ,
        initial: *ecu.control.state(),
    };
    let rings = Recorder::new(telemetry, &header)?;
    let (Some((mut recorder, records)), Some(recording)) = (rings, recorder::take_duty_recording())
    else {
        return Ok(ExitCode::TelemetryFailed);
    };
    let period = neutral.period();
    let (task, control) = (ecu.pwm, ecu.control);
    app::start(period, scenario, scenario.step_s(), |pwm| {
        let pwm = cortex_m::singleton!(: PwmInterrupt = PwmInterrupt {
            task,
            pwm,
            recording,
        })?;
        let control = cortex_m::singleton!(: ControlInterrupt = ControlInterrupt {
            task: control,
            records,
            steps: scenario.steps(),
            index: 0,
        })?;
        Some((
            tasks::PwmInterrupt::OpenLoop(pwm),
            tasks::ControlInterrupt::OpenLoop(control),
        ))
    });

    while !tasks::is_finished() {
        if recorder.take_one()? {
            Current::feed_watchdog();
        } else {
            Current::idle();
        }
    }
    while recorder.take_one()? {}
    recorder.flush()?;
    Current::neutralise_pwm();
    Ok(app::conclude(recorder::overruns()))
}
