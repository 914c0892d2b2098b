//! The vehicle as a unit: duty of the servo and driver in, the sensors' signals out.

use crate::ecu::{SIGNALS, values};
use crate::variable::{Causality, Value, Variable};
use pil::manoeuvre::{CURRENT_RANGE_A, Manoeuvre, SPEED_RANGE_RPM};
use pil::plant::InvalidPlant;
use pil::sensed_plant::SensedPlant;
use shared_model::Scenario;
use shared_model::friction::FrictionMode;
use shared_model::servo::Pwm;
use shared_model::signal::Measurement;

/// The inputs; they start with the driver of the run.
pub(crate) fn inputs(scenario: &Scenario<f64>) -> Vec<Variable> {
    let new = |name, start, text| Variable::new(Causality::Input, name, start, text);
    let run = &scenario.run;
    let pwm = Pwm::new(&scenario.servo, run.pwm_rate_hz);
    let duty = pwm.duty(scenario.motor_voltage_v());
    vec![
        new(
            "duty_code",
            Value::Integer(duty.code().into()),
            "Duty of the servo, counts of the PWM timer.",
        )
        .within((0.0, f64::from(duty.period()))),
        new(
            "bridge_on",
            Value::Boolean(true),
            "The servo's bridge is on.",
        ),
        new(
            "wheel_speed_limit_rpm",
            Value::Real(SPEED_RANGE_RPM.1),
            "The ECU's wheel speed limit; see manoeuvre.obey_speed_limit_rpm_per_s.",
        )
        .within((0.0, SPEED_RANGE_RPM.1)),
        new(
            "driver_wheel_speed_rpm",
            Value::Real(run.wheel_speed_rpm),
            "Wheel speed of the manoeuvre, reached at the end of the PWM period.",
        )
        .within(SPEED_RANGE_RPM),
        new(
            "driver_current_request_a",
            Value::Real(scenario.steering.motor_current_a),
            "Motor current that the driver requests, measured at the end of the PWM period.",
        )
        .within(CURRENT_RANGE_A),
    ]
}

/// The outputs, in the order of [`VehicleProgram::outputs`].
pub(crate) fn outputs() -> Vec<Variable> {
    let new = |name: &str, start, text: &str| Variable::new(Causality::Output, name, start, text);
    let real = Value::Real(0.0);
    let measured = SIGNALS.iter().map(|(name, text)| {
        new(
            name,
            real,
            &format!("{text}, measured at the last control tick."),
        )
    });
    let mut outputs: Vec<Variable> = measured.collect();
    let modes = FrictionMode::ALL.map(|mode| (mode as i32, format!("{mode:?}").to_lowercase()));
    outputs.extend([
        new("state.wheel_speed_rpm", real, "True wheel speed N."),
        new("state.sideslip_rad", real, "True sideslip angle beta."),
        new("state.yaw_rate_rad_per_s", real, "True yaw rate gamma."),
        new(
            "state.steering_angle_rad",
            real,
            "True front steering angle delta_f.",
        ),
        new("state.steering_rate_rad_per_s", real, "True steering rate."),
        new(
            "state.friction_mode",
            Value::Integer(0),
            "Mode of the dry friction.",
        )
        .one_of(modes.to_vec()),
        new(
            "motor_current_a",
            real,
            "Motor current of the last PWM period.",
        ),
        new(
            "dither_rad",
            real,
            "Dither ahead of the nonlinearities in that period.",
        ),
        new(
            "has_begun",
            Value::Boolean(false),
            "The lead-in is over; the vehicle moves.",
        ),
    ]);
    outputs
}

/// Inputs that hold over a PWM period.
#[derive(Debug, Clone, Copy, Default)]
struct Inputs {
    duty_code: u16,
    bridge_on: bool,
    wheel_speed_limit_rpm: f64,
    wheel_speed_rpm: f64,
    current_request_a: f64,
}

/// The vehicle in an instance.
#[derive(Debug, Clone)]
pub(crate) struct VehicleProgram {
    vehicle: SensedPlant,
    measured: Measurement<f64>,
    /// Of the period that has begun.
    begun: Option<Inputs>,
}

impl VehicleProgram {
    pub fn new(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Result<Self, InvalidPlant> {
        let vehicle = SensedPlant::new(scenario, manoeuvre)?;
        Ok(Self {
            measured: vehicle.plant().truth(),
            vehicle,
            begun: None,
        })
    }

    /// Begins a PWM period under these inputs; ends the one before.
    pub fn begin(&mut self, inputs: &[Value]) {
        self.end();
        self.begun = Some(of(inputs));
    }

    /// Ends the period that has begun.
    pub fn end(&mut self) {
        let Some(inputs) = self.begun.take() else {
            return;
        };
        let vehicle = &mut self.vehicle;
        vehicle.set_driver(inputs.wheel_speed_rpm, inputs.current_request_a);
        vehicle.set_wheel_speed_limit_rpm(inputs.wheel_speed_limit_rpm);
        if let Some(measured) = vehicle.period(inputs.duty_code, inputs.bridge_on) {
            self.measured = measured.map(&f64::from);
        }
    }

    pub fn outputs(&self) -> Vec<Value> {
        let mut outputs = values(&self.measured).map(Value::Real).to_vec();
        let now = self.vehicle.plant().record();
        outputs.extend([
            Value::Real(now.wheel_speed_rpm),
            Value::Real(now.sideslip_rad),
            Value::Real(now.yaw_rate_rad_per_s),
            Value::Real(now.steering_angle_rad),
            Value::Real(now.steering_rate_rad_per_s),
            Value::Integer(now.friction_mode as i32),
            Value::Real(now.motor_current_a),
            Value::Real(now.dither_rad),
            Value::Boolean(self.vehicle.has_begun()),
        ]);
        outputs
    }
}

/// The inputs, which an instance holds in this order and has checked.
fn of(inputs: &[Value]) -> Inputs {
    match *inputs {
        [
            Value::Integer(duty_code),
            Value::Boolean(bridge_on),
            Value::Real(wheel_speed_limit_rpm),
            Value::Real(wheel_speed_rpm),
            Value::Real(current_request_a),
        ] => Inputs {
            duty_code: duty_code as u16,
            bridge_on,
            wheel_speed_limit_rpm,
            wheel_speed_rpm,
            current_request_a,
        },
        _ => Inputs::default(),
    }
}
