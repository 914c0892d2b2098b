//! The ECU in open loop: a PWM task that dithers the servo's voltage, and a control task that steps
//! the vehicle model on the ECU itself, without sensors. The program that firmware and host are
//! compared on.
//!
//! The PWM task runs at the PWM rate, in an interrupt. It signals when the control task is due,
//! once in a fixed number of samples, so that the two rates are locked to each other. Firmware runs
//! the two at different priorities; [`OpenLoop`] runs them in turn on the host. Both give the same
//! bits.

use crate::dither::{Dither, Injection, Oscillator};
use crate::servo::{Duty, Pwm};
use crate::vehicle::{Model, State};
use crate::{InvalidScenario, Real, Scenario, integrate};

/// Output of the PWM task in a period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PwmSample<T> {
    /// Duty for the period that begins.
    pub duty: Duty,
    /// Dither in units of its amplitude, from -1 to 1.
    pub dither: T,
    /// The control task is due.
    pub control_due: bool,
}

/// The task at the PWM rate: dither and duty.
#[derive(Debug, Clone)]
pub struct PwmTask<T> {
    oscillator: Oscillator,
    pwm: Pwm<T>,
    motor_v: T,
    dither_v: T,
    /// Samples left before the dither starts.
    samples_to_dither: u32,
    samples_per_step: u32,
    samples_to_step: u32,
}

impl<T: Real> PwmTask<T> {
    /// One PWM period.
    pub fn run(&mut self) -> PwmSample<T> {
        let dither = if self.samples_to_dither == 0 {
            self.oscillator.sample()
        } else {
            self.samples_to_dither -= 1;
            T::zero()
        };
        self.samples_to_step -= 1;
        let control_due = self.samples_to_step == 0;
        if control_due {
            self.samples_to_step = self.samples_per_step;
        }
        PwmSample {
            duty: self.pwm.duty(self.motor_v + self.dither_v * dither),
            dither,
            control_due,
        }
    }

    /// The duty of no voltage: the safe state.
    pub fn neutral(&self) -> Duty {
        self.pwm.neutral()
    }
}

/// The task at the model's rate: one integration step.
#[derive(Debug, Clone)]
pub struct ControlTask<T> {
    model: Model<T>,
    dither: Dither<T>,
    state: State<T>,
    step_s: T,
    steps_to_dither: u32,
}

impl<T: Real> ControlTask<T> {
    /// One model step. `dither` is the sample that the PWM holds during the step; the averaged
    /// model does not use it.
    pub fn run(&mut self, dither: T) -> &State<T> {
        let injection = if self.steps_to_dither == 0 {
            self.dither.injection(dither)
        } else {
            self.steps_to_dither -= 1;
            Injection::Off
        };
        integrate::step(&self.model, &mut self.state, self.step_s, injection);
        &self.state
    }

    /// Continues from another state: for comparing single steps, and for carrying tangents along a
    /// recorded trajectory.
    pub fn set_state(&mut self, state: State<T>) {
        self.state = state;
    }

    /// The present state.
    pub fn state(&self) -> &State<T> {
        &self.state
    }
}

/// The whole program, its tasks run in turn.
///
/// ```
/// use shared_model::{Scenario, open_loop::OpenLoop};
/// let mut ecu = OpenLoop::new(&Scenario::<f32>::reconstruction()).unwrap();
/// let mut duties = 0;
/// let state = ecu.step(|_duty| duties += 1);
/// assert_eq!(duties, 10); // 10 kHz PWM, 1 kHz model
/// assert!(state.x[1] != 0.0);
/// ```
#[derive(Debug, Clone)]
pub struct OpenLoop<T> {
    /// The task at the PWM rate.
    pub pwm: PwmTask<T>,
    /// The task at the model's rate.
    pub control: ControlTask<T>,
}

impl<T: Real> OpenLoop<T> {
    /// The program for a scenario.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<T>) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let run = &scenario.run;
        let samples_per_step = scenario.samples_per_step();
        let steps_to_dither = scenario.dither_start_step();
        let pwm = PwmTask {
            oscillator: Oscillator::new(&scenario.dither, run.pwm_rate_hz),
            pwm: Pwm::new(&scenario.servo, run.pwm_rate_hz),
            motor_v: scenario.motor_voltage_v(),
            dither_v: scenario.dither.active_amplitude_v(),
            samples_to_dither: steps_to_dither.saturating_mul(samples_per_step),
            samples_per_step,
            samples_to_step: samples_per_step,
        };
        let model = Model::new(scenario);
        let control = ControlTask {
            model,
            dither: scenario.dither,
            state: model.initial_state(scenario),
            step_s: scenario.step_s(),
            steps_to_dither,
        };
        Ok(Self { pwm, control })
    }

    /// PWM periods up to and including the next model step; `on_duty` receives each duty; returns
    /// the state after the step.
    pub fn step(&mut self, mut on_duty: impl FnMut(Duty)) -> &State<T> {
        loop {
            let sample = self.pwm.run();
            on_duty(sample.duty);
            if sample.control_due {
                return self.control.run(sample.dither);
            }
        }
    }
}
