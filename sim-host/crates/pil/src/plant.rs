//! The plant: servo, steering and vehicle, driven by the ECU's duty.

use super::manoeuvre::{InvalidManoeuvre, Manoeuvre, SPEED_RANGE_RPM};
use super::record::Record;
use super::servo_filter::{Parts, Separation};
use shared_model::dither::{Dither, Injection};
use shared_model::parameter::OutOfRange;
use shared_model::servo::{Duty, Pwm};
use shared_model::signal::Measurement;
use shared_model::steering::Steering;
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, STEERING_RATE, State, YAW_RATE};
use shared_model::{InvalidScenario, Scenario, integrate};

/// Least resistance of the winding at which the voltage determines the current, ohm.
const MIN_RESISTANCE_OHM: f64 = 1e-3;

/// An invalid plant.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidPlant {
    /// The scenario is invalid.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
    /// The manoeuvre is invalid.
    #[error(transparent)]
    Manoeuvre(#[from] InvalidManoeuvre),
}

/// The vehicle on its manoeuvre, in f64, stepped at the PWM rate.
///
/// The input of the servo is the mean voltage of each period, without the carrier's ripple. Its
/// slow part drives the motor current through the winding's resistance (back-EMF and inductance are
/// neglected, as in the paper's constant current). The remainder is the dither, which is added to
/// the argument of the nonlinearities and held over the period.
#[derive(Debug, Clone)]
pub struct Plant {
    scenario: Scenario<f64>,
    manoeuvre: Manoeuvre,
    model: Model<f64>,
    state: State<f64>,
    pwm: Pwm<f64>,
    separation: Separation,
    rad_per_volt: f64,
    wheel_speed_rpm: f64,
    wheel_speed_limit_rpm: f64,
    /// Number of completed PWM periods.
    periods: u64,
    duty: Duty,
    parts: Parts,
}

impl Plant {
    /// The vehicle at the start of a manoeuvre: in the scenario's initial state, the servo settled
    /// at the voltage of the manoeuvre's initial request.
    ///
    /// # Errors
    /// If the scenario or the manoeuvre is invalid, or the servo's winding has no resistance.
    pub fn new(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Result<Self, InvalidPlant> {
        manoeuvre.validate()?;
        let scenario = manoeuvre.begin(scenario);
        scenario.validate()?;
        validate_resistance(&scenario).map_err(InvalidManoeuvre::from)?;
        let run = &scenario.run;
        let model = Model::new(&scenario);
        let pwm = Pwm::new(&scenario.servo, run.pwm_rate_hz);
        let motor_v = scenario.motor_voltage_v();
        let one_volt = Dither {
            amplitude_v: 1.0,
            ..scenario.dither
        };
        Ok(Self {
            model,
            state: model.initial_state(&scenario),
            pwm,
            separation: Separation::new(&manoeuvre.servo_filter, 1.0 / run.pwm_rate_hz, motor_v),
            rad_per_volt: one_volt.amplitude_rad(),
            wheel_speed_rpm: run.wheel_speed_rpm,
            wheel_speed_limit_rpm: f64::INFINITY,
            periods: 0,
            duty: pwm.duty(motor_v),
            parts: Parts {
                torque_v: motor_v,
                dither_v: 0.0,
            },
            manoeuvre: manoeuvre.clone(),
            scenario,
        })
    }

    /// Integrates over one PWM period under `duty`, which must be of this plant's PWM.
    pub fn step(&mut self, duty: Duty) {
        let period_s = 1.0 / self.scenario.run.pwm_rate_hz;
        self.duty = duty;
        self.parts = self.separation.step(self.pwm.volts(duty));
        let steering = Steering {
            motor_current_a: self.motor_current_a(),
            ..self.scenario.steering
        };
        self.model.set_motor_torque_nm(steering.motor_torque_nm());
        let injection = Injection::Shift {
            offset: self.dither_rad(),
        };
        integrate::step(&self.model, &mut self.state, period_s, injection);
        self.periods += 1;
        self.change_speed(period_s);
    }

    fn change_speed(&mut self, period_s: f64) {
        let profile_rpm = self.manoeuvre.wheel_speed_rpm.at(self.time_s());
        let max_change_rpm = self.manoeuvre.obey_speed_limit_rpm_per_s * period_s;
        self.wheel_speed_rpm = if max_change_rpm > 0.0 {
            let target_rpm = profile_rpm.min(self.wheel_speed_limit_rpm);
            let change_rpm = target_rpm - self.wheel_speed_rpm;
            self.wheel_speed_rpm + change_rpm.clamp(-max_change_rpm, max_change_rpm)
        } else {
            profile_rpm
        };
        let vehicle = &self.scenario.vehicle;
        self.model
            .set_wheel_speed_rpm(vehicle, self.wheel_speed_rpm);
    }

    /// Replaces the manoeuvre's driver: from the next period on the wheel speed (rpm) and the current
    /// request (A) are these, at the end of each period.
    pub fn set_driver(&mut self, wheel_speed_rpm: f64, current_request_a: f64) {
        self.manoeuvre.wheel_speed_rpm.hold(wheel_speed_rpm);
        self.manoeuvre.current_request_a.hold(current_request_a);
        self.manoeuvre.current_request_sine = None;
    }

    /// Sets the ECU's wheel speed limit, rpm; the manoeuvre determines whether the vehicle obeys
    /// it.
    pub fn set_wheel_speed_limit_rpm(&mut self, limit_rpm: f64) {
        self.wheel_speed_limit_rpm = limit_rpm.max(SPEED_RANGE_RPM.0);
    }

    /// PWM periods of the whole manoeuvre.
    pub fn total_periods(&self) -> u32 {
        let run = &self.scenario.run;
        (run.duration_s * run.pwm_rate_hz).round() as u32
    }

    /// Time from the manoeuvre's start, s.
    pub fn time_s(&self) -> f64 {
        self.periods as f64 / self.scenario.run.pwm_rate_hz
    }

    /// The present state.
    pub fn state(&self) -> &State<f64> {
        &self.state
    }

    /// The servo's PWM.
    pub fn pwm(&self) -> &Pwm<f64> {
        &self.pwm
    }

    /// Motor current in the last period, A.
    pub fn motor_current_a(&self) -> f64 {
        self.parts.torque_v / self.scenario.servo.winding_resistance_ohm
    }

    /// Dither ahead of the nonlinearities in the last period, rad.
    pub fn dither_rad(&self) -> f64 {
        let limit_rad = self.manoeuvre.servo_filter.dither_limit_rad;
        (self.rad_per_volt * self.parts.dither_v).clamp(-limit_rad, limit_rad)
    }

    /// Slip angle of the front tyres, rad.
    pub(crate) fn front_slip_angle_rad(&self) -> f64 {
        self.model.slip_angles(&self.state.x).0
    }

    /// The present outputs of ideal sensors, and the driver's request.
    pub fn truth(&self) -> Measurement<f64> {
        let x = &self.state.x;
        Measurement {
            wheel_speed_rpm: self.wheel_speed_rpm,
            yaw_rate_rad_per_s: x[YAW_RATE],
            steering_angle_rad: x[STEERING_ANGLE],
            steering_rate_rad_per_s: x[STEERING_RATE],
            current_request_a: self.manoeuvre.current_request_at(self.time_s()),
        }
    }

    /// The present state, for recording.
    pub fn record(&self) -> Record {
        let truth = self.truth();
        Record {
            time_s: self.time_s(),
            wheel_speed_rpm: truth.wheel_speed_rpm,
            sideslip_rad: self.state.x[SIDESLIP],
            yaw_rate_rad_per_s: truth.yaw_rate_rad_per_s,
            steering_angle_rad: truth.steering_angle_rad,
            steering_rate_rad_per_s: truth.steering_rate_rad_per_s,
            friction_mode: self.state.friction,
            current_request_a: truth.current_request_a,
            motor_current_a: self.motor_current_a(),
            dither_rad: self.dither_rad(),
            duty_code: self.duty.code(),
        }
    }
}

fn validate_resistance(scenario: &Scenario<f64>) -> Result<(), OutOfRange> {
    let value = scenario.servo.winding_resistance_ohm;
    if value >= MIN_RESISTANCE_OHM {
        return Ok(());
    }
    Err(OutOfRange {
        section: "servo",
        name: "winding_resistance_ohm",
        value,
        min: MIN_RESISTANCE_OHM,
        max: 100.0,
    })
}
