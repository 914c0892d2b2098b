//! Parameters of a unit: the configuration and, of the vehicle, sensors and servo.

use crate::variable::{Causality, Value, Variable};
use dynamics::config::{self, Allowed};
use pil::manoeuvre::{Manoeuvre, SPEED_RATE_RANGE_RPM_PER_S};
use pil::sensor::MAX_DELAY_TICKS;
use pil::servo_filter::ServoFilter;
use shared_model::Scenario;
use shared_model::parameter::ParameterSet;

const OBEY: &str = "manoeuvre.obey_speed_limit_rpm_per_s";
const RESOLUTION: &str = "manoeuvre.sensors.resolution";
const NOISE: &str = "manoeuvre.sensors.noise";
const DELAY: &str = "manoeuvre.sensors.delay_ticks";
const SEED: &str = "manoeuvre.sensors.seed";

/// The parameters of a configuration, by their keys in its file.
pub(crate) fn of_configuration(scenario: &Scenario<f64>) -> Vec<Variable> {
    let parameters = config::parameters(scenario).into_iter();
    let variables = parameters.map(|parameter| {
        let new = |start| {
            Variable::new(
                Causality::Parameter,
                &parameter.key,
                start,
                parameter.description,
            )
        };
        match &parameter.allowed {
            Allowed::Range { value, min, max } => new(Value::Real(*value)).within((*min, *max)),
            Allowed::Flag { value } => new(Value::Boolean(*value)),
            Allowed::Names { value, names } => {
                let numbered = || (1..).zip(names);
                let own = numbered().find(|(_, name)| *name == value);
                let start = own.map_or(1, |(number, _)| number);
                let alternatives = numbered().map(|(number, name)| (number, name.to_string()));
                new(Value::Integer(start)).one_of(alternatives.collect())
            }
        }
    });
    variables.collect()
}

/// The parameters of sensors and servo, by their keys in a manoeuvre's file.
pub(crate) fn of_manoeuvre() -> Vec<Variable> {
    let manoeuvre = Manoeuvre::constant(1.0, 0.0);
    let new = |name, start, text| Variable::new(Causality::Parameter, name, start, text);
    let mut variables = vec![
        new(
            OBEY,
            Value::Real(manoeuvre.obey_speed_limit_rpm_per_s),
            "Greatest rate of change of the wheel speed of a vehicle that obeys the ECU's limit, rpm/s; 0: the limit is ignored.",
        )
        .within(SPEED_RATE_RANGE_RPM_PER_S),
    ];
    let sensors = &manoeuvre.sensors;
    variables.extend(numbers(
        RESOLUTION,
        "Resolution; 0 is none. ",
        &sensors.resolution,
    ));
    let noise = "Standard deviation of the white Gaussian noise. ";
    variables.extend(numbers(NOISE, noise, &sensors.noise));
    variables.push(
        new(
            DELAY,
            Value::Integer(sensors.delay_ticks as i32),
            "Delay of the whole measurement, control ticks.",
        )
        .within((0.0, MAX_DELAY_TICKS as f64)),
    );
    variables.push(
        new(
            SEED,
            Value::Integer(sensors.seed as i32),
            "Seed of the noise.",
        )
        .within((0.0, f64::from(i32::MAX))),
    );
    variables.extend(numbers(ServoFilter::SECTION, "", &manoeuvre.servo_filter));
    variables
}

/// The numbers of a set.
fn numbers<P: ParameterSet<f64>>(section: &str, about: &str, set: &P) -> Vec<Variable> {
    let mut set = *set;
    let variables = P::FIELDS.iter().map(|field| {
        let name = format!("{section}.{}", field.name);
        let text = P::description(field.name).unwrap_or_default();
        let start = Value::Real(*(field.accessor)(&mut set));
        Variable::new(
            Causality::Parameter,
            &name,
            start,
            &format!("{about}{text}"),
        )
        .within((field.min, field.max))
    });
    variables.collect()
}

/// The configuration with these values of its parameters.
pub(crate) fn scenario<'a>(
    parameters: impl Iterator<Item = (&'a Variable, Value)>,
) -> Scenario<f64> {
    let mut scenario = Scenario::reconstruction();
    for (variable, value) in parameters {
        let key = &variable.name;
        match value {
            Value::Real(value) => {
                if let Some(number) = scenario.number(key) {
                    *number = value;
                }
            }
            Value::Boolean(value) => choose(&mut scenario, key, &value.to_string()),
            Value::Integer(value) => {
                let named = variable.alternatives.iter();
                for (_, name) in named.filter(|(number, _)| *number == value) {
                    choose(&mut scenario, key, name);
                }
            }
        }
    }
    scenario
}

fn choose(scenario: &mut Scenario<f64>, key: &str, name: &str) {
    // Key and name are those of the configuration itself; others are parameters of the manoeuvre.
    let _ = scenario.apply(&format!("{key}={name}"));
}

/// The manoeuvre with these values of its parameters: the driver of the scenario.
pub(crate) fn manoeuvre<'a>(
    scenario: &Scenario<f64>,
    parameters: impl Iterator<Item = (&'a Variable, Value)>,
) -> Manoeuvre {
    let request_a = scenario.steering.motor_current_a;
    let mut manoeuvre = Manoeuvre::constant(scenario.run.wheel_speed_rpm, request_a);
    for (variable, value) in parameters {
        match (variable.name.as_str(), value) {
            (DELAY, Value::Integer(value)) => manoeuvre.sensors.delay_ticks = value as usize,
            (SEED, Value::Integer(value)) => manoeuvre.sensors.seed = value as u64,
            (key, Value::Real(value)) => {
                if let Some(number) = number(&mut manoeuvre, key) {
                    *number = value;
                }
            }
            _ => {}
        }
    }
    manoeuvre
}

fn number<'a>(manoeuvre: &'a mut Manoeuvre, key: &str) -> Option<&'a mut f64> {
    let (section, name) = key.rsplit_once('.')?;
    match section {
        RESOLUTION => manoeuvre.sensors.resolution.number(name),
        NOISE => manoeuvre.sensors.noise.number(name),
        ServoFilter::SECTION => manoeuvre.servo_filter.number(name),
        _ => (key == OBEY).then_some(&mut manoeuvre.obey_speed_limit_rpm_per_s),
    }
}
