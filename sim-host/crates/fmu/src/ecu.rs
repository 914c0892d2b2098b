//! The ECU as a unit: the sensors' signals in, duty and actuation out.

use crate::variable::{Causality, Value, Variable};
use pil::ecu_node::{EcuNode, EcuOutput};
use pil::manoeuvre::Manoeuvre;
use pil::vehicle_node::ecu_scenario;
use shared_model::ecu::Warning;
use shared_model::gate::Fault;
use shared_model::servo::{Duty, Pwm};
use shared_model::signal::{Actuation, Measurement, Mode};
use shared_model::{InvalidScenario, Scenario};

/// The signals of a sensor frame, in the order of the inputs.
pub(crate) const SIGNALS: [(&str, &str); 5] = [
    ("wheel_speed_rpm", "Wheel speed N"),
    ("yaw_rate_rad_per_s", "Yaw rate gamma"),
    ("steering_angle_rad", "Front steering angle delta_f"),
    ("steering_rate_rad_per_s", "Steering rate"),
    (
        "current_request_a",
        "Motor current that the driver requests",
    ),
];

/// The signals of a measurement in that order.
pub(crate) fn values(measurement: &Measurement<f64>) -> [f64; 5] {
    [
        measurement.wheel_speed_rpm,
        measurement.yaw_rate_rad_per_s,
        measurement.steering_angle_rad,
        measurement.steering_rate_rad_per_s,
        measurement.current_request_a,
    ]
}

/// The inputs; they start with the initial state of the run.
pub(crate) fn inputs(scenario: &Scenario<f64>) -> Vec<Variable> {
    let run = &scenario.run;
    let starts = values(&Measurement {
        wheel_speed_rpm: run.wheel_speed_rpm,
        yaw_rate_rad_per_s: run.yaw_rate_rad_per_s,
        steering_angle_rad: run.steering_angle_rad,
        steering_rate_rad_per_s: run.steering_rate_rad_per_s,
        current_request_a: scenario.steering.motor_current_a,
    });
    let signals = SIGNALS.iter().zip(starts);
    let inputs = signals.map(|((name, text), start)| {
        let text = format!("{text}, read at each control tick, as f32.");
        Variable::new(Causality::Input, name, Value::Real(start), &text)
    });
    inputs.collect()
}

/// The outputs, in the order of [`EcuProgram::outputs`].
pub(crate) fn outputs() -> Vec<Variable> {
    let new = |name, start, text: &str| Variable::new(Causality::Output, name, start, text);
    let (real, integer) = (Value::Real(0.0), Value::Integer(0));
    let modes = Mode::ALL.map(|mode| (mode as i32, format!("{mode:?}").to_lowercase()));
    let bits = |names: Vec<String>| format!("one bit each, from bit 0 on: {}", names.join(", "));
    let faults = bits(Fault::ALL.map(|fault| fault.name().into()).to_vec());
    let warnings = bits(Warning::ALL.map(|warning| warning.name().into()).to_vec());
    vec![
        new(
            "duty_code",
            integer,
            "Duty of the PWM period that begins, counts of the PWM timer.",
        ),
        new(
            "duty",
            real,
            "The same as a share of the period; a half is neutral.",
        ),
        new(
            "bridge_on",
            Value::Boolean(false),
            "The servo's bridge is on.",
        ),
        new(
            "servo_v",
            real,
            "Mean voltage on the servo in that period; 0 while the bridge is off.",
        ),
        new(
            "mode",
            integer,
            "Operating mode, of the last actuator frame, as all below.",
        )
        .one_of(modes.to_vec()),
        new(
            "faults",
            integer,
            &format!("Faults that put the ECU into its safe state, {faults}."),
        ),
        new(
            "motor_voltage_v",
            real,
            "Motor's share of the servo voltage.",
        ),
        new(
            "dither_amplitude_v",
            real,
            "Amplitude of the dither on the servo voltage.",
        ),
        new(
            "wheel_speed_limit_rpm",
            real,
            "Wheel speed that the vehicle must not exceed.",
        ),
        new(
            "warnings",
            integer,
            &format!("Events since the last frame that are tolerated, {warnings}."),
        ),
        new(
            "sensor_counter",
            integer,
            "Counter of the last sensor frame that was used; 255 before the first.",
        ),
        new(
            "challenge",
            integer,
            "Challenge; the unit answers it in its own sensor frames.",
        ),
    ]
}

/// The ECU's program in an instance.
#[derive(Debug, Clone)]
pub(crate) struct EcuProgram {
    node: EcuNode,
    /// In the arithmetic of the vehicle.
    pwm: Pwm<f64>,
    /// Reported before the first actuator frame.
    initial: Actuation<f32>,
    has_started: bool,
    /// The present period has ended, and the next one not begun.
    has_ended: bool,
}

impl EcuProgram {
    pub fn new(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let own = ecu_scenario(scenario, manoeuvre);
        Ok(Self {
            node: EcuNode::new(&own)?,
            pwm: Pwm::new(&scenario.servo, scenario.run.pwm_rate_hz),
            initial: Actuation {
                mode: Mode::Starting,
                faults: 0,
                motor_voltage_v: 0.0,
                dither_amplitude_v: 0.0,
                wheel_speed_limit_rpm: own.gate.safe_wheel_speed_rpm,
                warnings: 0,
                sensor_counter: u8::MAX,
                bridge_on: true,
                challenge: 0,
            },
            has_started: false,
            has_ended: false,
        })
    }

    /// Begins a PWM period; the first has begun.
    pub fn begin(&mut self, inputs: &[Value]) {
        if self.has_started {
            self.node.period(&measurement(inputs));
        }
        (self.has_started, self.has_ended) = (true, false);
    }

    /// Ends it.
    pub fn end(&mut self) {
        self.has_ended = true;
    }

    pub fn outputs(&self) -> Vec<Value> {
        let output = if self.has_ended {
            self.node.next_output()
        } else {
            self.node.output()
        };
        let EcuOutput {
            duty_code,
            bridge_on,
            actuation,
        } = output;
        let period = self.pwm.neutral().period();
        let servo_v = match Duty::new(duty_code, period) {
            Ok(duty) if bridge_on => self.pwm.volts(duty),
            _ => 0.0,
        };
        let now = actuation.unwrap_or(self.initial);
        let real = |number: f32| Value::Real(number.into());
        vec![
            Value::Integer(duty_code.into()),
            Value::Real(f64::from(duty_code) / f64::from(period)),
            Value::Boolean(bridge_on),
            Value::Real(servo_v),
            Value::Integer(now.mode as i32),
            Value::Integer(now.faults as i32),
            real(now.motor_voltage_v),
            real(now.dither_amplitude_v),
            real(now.wheel_speed_limit_rpm),
            Value::Integer(now.warnings.into()),
            Value::Integer(now.sensor_counter.into()),
            Value::Integer(now.challenge.into()),
        ]
    }
}

/// The measurement in the inputs.
fn measurement(inputs: &[Value]) -> Measurement<f32> {
    // An instance holds a real number for each of them.
    let signal = |index: usize| match inputs.get(index) {
        Some(Value::Real(number)) => *number as f32,
        _ => f32::NAN,
    };
    Measurement {
        wheel_speed_rpm: signal(0),
        yaw_rate_rad_per_s: signal(1),
        steering_angle_rad: signal(2),
        steering_rate_rad_per_s: signal(3),
        current_request_a: signal(4),
    }
}
