//! A scenario: every parameter of one run, the presets, and the check that they fit together.

use crate::Real;
use crate::controller::Policy;
use crate::dither::{Application, Dither, Waveform};
use crate::friction::{Friction, FrictionLaw};
use crate::gate::Limits;
use crate::listed;
use crate::parameter::{OutOfRange, ParameterSet, parameters};
use crate::servo::Servo;
use crate::short::Short;
use crate::stability::{MOST_STEP_TIMES_RATE, fastest_rate_per_s, least_rate_hz};
use crate::steering::Steering;
use crate::tire::{LOW_FRICTION_ROAD, MagicFormula, TireModel};
use crate::vehicle::{SlipForm, Vehicle};
use core::fmt;

/// One step, less what rounding to f32 can take from it.
const ALMOST_ONE: f64 = 1.0 - 1e-6;
/// Most PWM samples in a model step; a telemetry record holds them all.
pub const MAX_RATIO: u32 = 1000;
/// Most PWM samples of a run; a counter of 32 bits holds them.
const MAX_SAMPLES: f64 = 4e9;

/// The tyres of both axles.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Tires<T> {
    /// Which tyre the model uses.
    pub model: TireModel,
    /// Coefficients of the front axle, Table 1.
    pub front: MagicFormula<T>,
    /// Coefficients of the rear axle, Table 1.
    pub rear: MagicFormula<T>,
}

parameters! {
    section "run";
    /// Speed, rates, length and start of a run.
    pub struct Run {
        /// Wheel speed N, rpm.
        wheel_speed_rpm: 1.0..=1e5,
        /// Length of the run, s.
        duration_s: 1e-4..=1e6,
        /// Rate of the control task, Hz: the model's step rate under averaged dither.
        control_rate_hz: 10.0..=1e6,
        /// Rate of the PWM task, Hz: carrier, dither samples, and the model's step rate under the dither as a signal.
        pwm_rate_hz: 10.0..=1e6,
        /// Sideslip angle beta at the start, rad.
        sideslip_rad: -10.0..=10.0,
        /// Yaw rate gamma at the start, rad/s.
        yaw_rate_rad_per_s: -100.0..=100.0,
        /// Front steering angle delta_f at the start, rad.
        steering_angle_rad: -10.0..=10.0,
        /// Steering rate at the start, rad/s.
        steering_rate_rad_per_s: -1000.0..=1000.0,
    }
}

/// Every parameter of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Scenario<T> {
    /// Chassis.
    pub vehicle: Vehicle<T>,
    /// Tyres.
    pub tires: Tires<T>,
    /// Steering actuator.
    pub steering: Steering<T>,
    /// Dry friction of the steering.
    pub friction: Friction<T>,
    /// Dither.
    pub dither: Dither<T>,
    /// Servo drive.
    pub servo: Servo<T>,
    /// The controller's dither policy, for an ECU in the loop.
    pub policy: Policy<T>,
    /// The command gate's limits, for an ECU in the loop.
    pub gate: Limits<T>,
    /// Speed, rates, length and start.
    pub run: Run<T>,
}

listed! {
    /// A named scenario.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Preset {
        /// The reading of the paper that reproduces its claims: Coulomb friction on the steering rate with true stick.
        Reconstruction => "reconstruction",
        /// The equations as printed: friction by the sign of the steering angle.
        Printed => "printed",
    }
}

impl<T: Real> Scenario<T> {
    /// The scenario of a preset.
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Reconstruction => Self::reconstruction(),
            Preset::Printed => Self::printed(),
        }
    }

    /// The reading of the paper that reproduces its claims, at 1750 rpm without dither: set A of Table 1 with the cubic
    /// tyre and the printed sign, small slip angles, Coulomb friction on the steering rate with true stick, mu = 0.28.
    pub fn reconstruction() -> Self {
        const PER_TAU: f64 = 1.0 / core::f64::consts::TAU;
        Scenario {
            vehicle: Vehicle {
                slip_form: SlipForm::SmallAngle,
                mass_kg: 1500.0,
                yaw_inertia_kg_m2: 2000.0,
                front_axle_distance_m: 1.2,
                rear_axle_distance_m: 1.3,
                wheel_radius_m: 0.3,
            },
            tires: Tires {
                model: TireModel::Cubic,
                front: LOW_FRICTION_ROAD.0,
                rear: LOW_FRICTION_ROAD.1,
            },
            steering: Steering {
                inertia_kg_m2: 10.0,
                damping_nm_s_per_rad: 200.0,
                ratio: 30.0,
                motor_constant_nm_per_a: 0.078,
                motor_current_a: 10.0,
                efficiency: 0.7,
                pneumatic_trail_m: 0.012,
                mechanical_trail_m: 0.010,
            },
            friction: Friction {
                law: FrictionLaw::CoulombRate,
                dithered: false,
                coefficient: 0.28,
                front_wheel_load_kg: 200.0,
            },
            dither: Dither {
                waveform: Waveform::None,
                application: Application::Averaged,
                amplitude_v: 0.0,
                square_frequency_rad_per_s: 2000.0,
                sine_frequency_rad_per_s: 4000.0,
                start_time_s: 3.0,
                square_rad_per_volt: 1.0,
                // Puts the paper's 0.8 to 1.2 V onto the period-one range of its sine dither.
                sine_rad_per_volt: PER_TAU,
            },
            servo: Servo {
                bus_voltage_v: 12.0,
                winding_resistance_ohm: 0.3,
                timer_clock_hz: 25e6,
            },
            policy: Policy::reconstruction(),
            gate: Limits::reconstruction(),
            run: Run {
                wheel_speed_rpm: 1750.0,
                duration_s: 20.0,
                control_rate_hz: 1000.0,
                pwm_rate_hz: 10_000.0,
                sideslip_rad: 0.15,
                yaw_rate_rad_per_s: 0.0,
                steering_angle_rad: 0.46,
                steering_rate_rad_per_s: 0.0,
            },
        }
        .map(&T::from_f64)
    }

    /// The paper's equations as printed: as [`reconstruction`](Self::reconstruction), but with friction by the sign of the
    /// steering angle, dithered with it, equations (13) and (27).
    pub fn printed() -> Self {
        let mut scenario = Self::reconstruction();
        scenario.friction.law = FrictionLaw::PrintedAngle;
        scenario.friction.dithered = true;
        scenario
    }

    /// The same scenario in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> Scenario<U> {
        Scenario {
            vehicle: self.vehicle.map(f),
            tires: Tires {
                model: self.tires.model,
                front: self.tires.front.map(f),
                rear: self.tires.rear.map(f),
            },
            steering: self.steering.map(f),
            friction: self.friction.map(f),
            dither: self.dither.map(f),
            servo: self.servo.map(f),
            policy: self.policy.map(f),
            gate: self.gate.map(f),
            run: self.run.map(f),
        }
    }

    /// Checks every number, and that the numbers fit together.
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
        self.policy.validate()?;
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
        if fastest_rate_per_s <= MOST_STEP_TIMES_RATE * rate_hz {
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

    /// Voltage that drives the motor current through the winding, V.
    pub fn motor_voltage_v(&self) -> T {
        self.steering.motor_current_a * self.servo.winding_resistance_ohm
    }

    /// Rate at which the model is stepped, Hz.
    pub fn model_rate_hz(&self) -> T {
        match self.dither.application {
            Application::Averaged => self.run.control_rate_hz,
            Application::Signal => self.run.pwm_rate_hz,
        }
    }

    /// Length of a model step, s.
    pub fn step_s(&self) -> T {
        T::one() / self.model_rate_hz()
    }

    /// Model steps of the run.
    pub fn steps(&self) -> u32 {
        self.steps_until(self.run.duration_s)
    }

    /// Model steps before the dither sets in.
    pub fn dither_start_step(&self) -> u32 {
        self.steps_until(self.dither.start_time_s)
    }

    fn steps_until(&self, time_s: T) -> u32 {
        // In f64 whatever T is: f32 has no halves from 2^23 steps on.
        (time_s.to_f64() * self.model_rate_hz().to_f64() + 0.5) as u32
    }

    /// PWM periods in a control tick.
    pub fn periods_per_tick(&self) -> u32 {
        (self.run.pwm_rate_hz / self.run.control_rate_hz + T::from_f64(0.5))
            .to_u32()
            .max(1)
    }

    /// PWM samples in a model step.
    pub fn samples_per_step(&self) -> u32 {
        (self.run.pwm_rate_hz / self.model_rate_hz() + T::from_f64(0.5))
            .to_u32()
            .max(1)
    }
}

/// Why a scenario cannot be run.
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
        /// Period asked for, counts.
        counts: u32,
    },
    /// The run is shorter than one step or longer than the counters.
    Duration {
        /// Length asked for, s.
        duration_s: f64,
        /// Least length, s.
        min_s: f64,
        /// Greatest length, s.
        max_s: f64,
    },
    /// The dither is faster than half the PWM rate, so its samples would show another frequency.
    DitherFrequency {
        /// Frequency asked for, rad/s.
        frequency_rad_per_s: f64,
        /// Greatest frequency at the PWM rate, rad/s.
        max_rad_per_s: f64,
    },
    /// Motor and dither together ask for more than the bus has.
    OverVoltage {
        /// Voltage of the motor current, V.
        motor_v: f64,
        /// Dither amplitude, V.
        dither_v: f64,
        /// Bus voltage, V.
        bus_v: f64,
    },
    /// The fixed step is too long for the model's fastest rate: its solution would grow where the motion decays.
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
    /// Voltage that the motor leaves for the dither, V.
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
                let least_hz = least_rate_hz(fastest_rate_per_s);
                write!(
                    f,
                    "{field} = {rate_hz}: the step is too long; {} s times the model's fastest rate, {fastest_rate_per_s:.0} 1/s, \
                     is {:.2}, and must be at most {MOST_STEP_TIMES_RATE}: at least {least_hz} Hz, a step of {:.2e} s",
                    1.0 / rate_hz,
                    fastest_rate_per_s / rate_hz,
                    1.0 / least_hz
                )
            }
        }
    }
}

impl core::error::Error for InvalidScenario {}
