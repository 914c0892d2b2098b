//! A scenario: every parameter of one run, and the presets.

use crate::Real;
use crate::dither::{Application, Dither, Waveform};
use crate::friction::{Friction, FrictionLaw};
use crate::gate::Limits;
use crate::listed;
use crate::parameter::parameters;
use crate::policy::Policy;
use crate::servo::Servo;
use crate::steering::Steering;
use crate::tire::{LOW_FRICTION_ROAD, MagicFormula, TireModel};
use crate::vehicle::{SlipForm, Vehicle};

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
    /// The controller's policy, for an ECU in the loop.
    pub controller: Policy<T>,
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

    /// The reading of the paper that reproduces its claims, at 1750 rpm without dither: set A of
    /// Table 1 with the cubic tyre and the printed sign, small slip angles, Coulomb friction on
    /// the steering rate with true stick, mu = 0.28.
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
            controller: Policy::reconstruction(),
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

    /// The paper's equations as printed: as [`reconstruction`](Self::reconstruction), but with
    /// friction by the sign of the steering angle, dithered with it, equations (13) and (27).
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
            controller: self.controller.map(f),
            gate: self.gate.map(f),
            run: self.run.map(f),
        }
    }

    /// Voltage that drives the motor current through the winding, V.
    pub fn motor_voltage_v(&self) -> T {
        self.steering.motor_current_a * self.servo.winding_resistance_ohm
    }

    /// Voltage that drives a torque of the motor about the steering axis, V/(N m).
    ///
    /// ```
    /// let scenario = shared_model::Scenario::<f64>::reconstruction();
    /// assert!((16.38 * scenario.motor_v_per_nm() - scenario.motor_voltage_v()).abs() < 1e-12);
    /// ```
    pub fn motor_v_per_nm(&self) -> T {
        let steering = &self.steering;
        let nm_per_a = steering.ratio * steering.motor_constant_nm_per_a * steering.efficiency;
        self.servo.winding_resistance_ohm / nm_per_a
    }

    /// Waveform of the ECU's dither: none where something else suppresses the chaos.
    pub fn suppressing_waveform(&self) -> Waveform {
        if self.controller.suppression.has_dither() {
            self.dither.waveform
        } else {
            Waveform::None
        }
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
