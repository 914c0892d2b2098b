//! The check of a scenario: the range of every number, and the consistency of the numbers.

use crate::Real;
use crate::dither::Application;
use crate::parameter::{OutOfRange, ParameterSet};
use crate::scenario::Scenario;
use crate::short::Short;
use crate::stability::{MAX_STEP_TIMES_RATE, fastest_rate_per_s, min_rate_hz};
use core::fmt;

/// One step, less the rounding to f32.
const ALMOST_ONE: f64 = 1.0 - 1e-6;
/// Most PWM samples in a model step; a telemetry record holds them all.
pub const MAX_RATIO: u32 = 1000;
/// Most PWM samples of a run; a counter of 32 bits holds them.
const MAX_SAMPLES: f64 = 4e9;

impl<T: Real> Scenario<T> {
    /// Checks every number, and that the numbers are consistent.
    ///
    /// # Errors
    /// The first fault found.
    ///
    /// ```
    /// let mut scenario = shared_model::Scenario::reconstruction();
    /// scenario.vehicle.mass_kg = -1500.0_f64;
    /// assert_eq!(
    ///     scenario.validate().unwrap_err().to_string(),
    ///     "vehicle.mass_kg = -1500: must be a finite number from 1 to 100000"
    /// );
    /// ```
    pub fn validate(&self) -> Result<(), InvalidScenario> {
        self.vehicle.validate()?;
        self.tires.front.validate_as("tires.front")?;
        self.tires.rear.validate_as("tires.rear")?;
        self.steering.validate()?;
        self.friction.validate()?;
        self.dither.validate()?;
        self.servo.validate()?;
        self.controller.validate()?;
        self.gate.validate()?;
        self.run.validate()?;
        self.validate_rates()?;
        self.validate_frequency()?;
        self.validate_voltage()?;
        self.validate_step()
    }

    /// The fixed step must be stable, or its motion is not the model's.
    fn validate_step(&self) -> Result<(), InvalidScenario> {
        let rate_hz = self.model_rate_hz().to_f64();
        let fastest_rate_per_s = fastest_rate_per_s(self);
        if fastest_rate_per_s <= MAX_STEP_TIMES_RATE * rate_hz {
            return Ok(());
        }
        Err(InvalidScenario::StepTooLong {
            field: match self.dither.application {
                Application::Averaged => "run.control_rate_hz",
                Application::Signal => "run.pwm_rate_hz",
            },
            rate_hz,
            fastest_rate_per_s,
        })
    }

    fn validate_frequency(&self) -> Result<(), InvalidScenario> {
        let frequency_rad_per_s = self.dither.frequency_rad_per_s().to_f64();
        let max_rad_per_s = core::f64::consts::PI * self.run.pwm_rate_hz.to_f64();
        if frequency_rad_per_s <= max_rad_per_s {
            return Ok(());
        }
        Err(InvalidScenario::DitherFrequency {
            frequency_rad_per_s,
            max_rad_per_s,
        })
    }

    fn validate_rates(&self) -> Result<(), InvalidScenario> {
        let run = &self.run;
        let (control_hz, pwm_hz) = (run.control_rate_hz.to_f64(), run.pwm_rate_hz.to_f64());
        let (control, pwm) = (run.control_rate_hz.to_u32(), run.pwm_rate_hz.to_u32());
        let whole = f64::from(control) == control_hz && f64::from(pwm) == pwm_hz;
        if !whole || control == 0 || !pwm.is_multiple_of(control) || pwm / control > MAX_RATIO {
            return Err(InvalidScenario::Rates { control_hz, pwm_hz });
        }
        let counts = self.servo.period_counts(run.pwm_rate_hz);
        if !(2..=u32::from(u16::MAX)).contains(&counts) {
            return Err(InvalidScenario::TimerPeriod { counts });
        }
        let samples = run.duration_s.to_f64() * pwm_hz;
        let steps = run.duration_s.to_f64() * self.model_rate_hz().to_f64();
        if steps < ALMOST_ONE || samples > MAX_SAMPLES {
            return Err(InvalidScenario::Duration {
                duration_s: run.duration_s.to_f64(),
                min_s: 1.0 / self.model_rate_hz().to_f64(),
                max_s: MAX_SAMPLES / pwm_hz,
            });
        }
        Ok(())
    }

    fn validate_voltage(&self) -> Result<(), InvalidScenario> {
        let dither_v = self.dither.active_amplitude_v();
        let motor_v = self.motor_voltage_v();
        if motor_v.abs() + dither_v <= self.servo.bus_voltage_v {
            return Ok(());
        }
        Err(InvalidScenario::OverVoltage {
            motor_v: motor_v.to_f64(),
            dither_v: dither_v.to_f64(),
            bus_v: self.servo.bus_voltage_v.to_f64(),
        })
    }
}

/// Reason why a scenario cannot be run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InvalidScenario {
    /// A number is not finite or not in its range.
    OutOfRange(OutOfRange),
    /// The rates are not whole numbers, or the PWM rate is no multiple of the control rate.
    Rates {
        /// Control rate, Hz.
        control_hz: f64,
        /// PWM rate, Hz.
        pwm_hz: f64,
    },
    /// The carrier period does not fit the timer.
    TimerPeriod {
        /// The requested period, counts.
        counts: u32,
    },
    /// The run is shorter than one step or longer than the counters.
    Duration {
        /// The requested length, s.
        duration_s: f64,
        /// Least length, s.
        min_s: f64,
        /// Greatest length, s.
        max_s: f64,
    },
    /// The dither is faster than half the PWM rate, so its samples would have another frequency
    /// (aliasing).
    DitherFrequency {
        /// The requested frequency, rad/s.
        frequency_rad_per_s: f64,
        /// Greatest frequency at the PWM rate, rad/s.
        max_rad_per_s: f64,
    },
    /// Motor and dither together exceed the bus voltage.
    OverVoltage {
        /// Voltage of the motor current, V.
        motor_v: f64,
        /// Dither amplitude, V.
        dither_v: f64,
        /// Bus voltage, V.
        bus_v: f64,
    },
    /// The fixed step is too long for the model's fastest rate: its solution would grow where the
    /// motion decays.
    StepTooLong {
        /// Name of the rate that the model is stepped at.
        field: &'static str,
        /// That rate, Hz.
        rate_hz: f64,
        /// Fastest rate of the linearised model, 1/s.
        fastest_rate_per_s: f64,
    },
}

impl InvalidScenario {
    /// Voltage available for the dither beside the motor's, V.
    pub fn left_for_dither_v(motor_v: f64, bus_v: f64) -> f64 {
        (bus_v - motor_v.abs()).max(0.0)
    }
}

impl From<OutOfRange> for InvalidScenario {
    fn from(error: OutOfRange) -> Self {
        Self::OutOfRange(error)
    }
}

impl fmt::Display for InvalidScenario {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::OutOfRange(ref error) => error.fmt(f),
            Self::Rates { control_hz, pwm_hz } => write!(
                f,
                "run.pwm_rate_hz = {} and run.control_rate_hz = {}: both must be whole numbers, the first a multiple of the \
                 second, at most {MAX_RATIO} times it",
                Short(pwm_hz),
                Short(control_hz)
            ),
            Self::TimerPeriod { counts } => write!(
                f,
                "servo.timer_clock_hz over run.pwm_rate_hz is {counts} counts: must be from 2 to {}",
                u16::MAX
            ),
            Self::Duration {
                duration_s,
                min_s,
                max_s,
            } => write!(
                f,
                "run.duration_s = {}: must be from {} (one step) to {}",
                Short(duration_s),
                Short(min_s),
                Short(max_s)
            ),
            Self::DitherFrequency {
                frequency_rad_per_s,
                max_rad_per_s,
            } => write!(
                f,
                "dither frequency {} rad/s: must be at most {} rad/s, half of run.pwm_rate_hz",
                Short(frequency_rad_per_s),
                Short(max_rad_per_s)
            ),
            Self::OverVoltage {
                motor_v,
                dither_v,
                bus_v,
            } => write!(
                f,
                "dither.amplitude_v = {}: with {} V for the motor current it exceeds servo.bus_voltage_v = {}; at most {} V \
                 are left for the dither",
                Short(dither_v),
                Short(motor_v),
                Short(bus_v),
                Short(Self::left_for_dither_v(motor_v, bus_v))
            ),
            Self::StepTooLong {
                field,
                rate_hz,
                fastest_rate_per_s,
            } => {
                let min_hz = min_rate_hz(fastest_rate_per_s);
                write!(
                    f,
                    "{field} = {rate_hz}: the step is too long; {} s times the model's fastest rate, {fastest_rate_per_s:.0} 1/s, \
                     is {:.2}, and must be at most {MAX_STEP_TIMES_RATE}: at least {min_hz} Hz, a step of {:.2e} s",
                    1.0 / rate_hz,
                    fastest_rate_per_s / rate_hz,
                    1.0 / min_hz
                )
            }
        }
    }
}

impl core::error::Error for InvalidScenario {}
