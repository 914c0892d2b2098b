//! A scenario as the firmware's command line.

use shared_model::Scenario;
use toml::{Table, Value};

/// One `section.name=value` per parameter, complete, so that the firmware's presets have no effect.
/// The numbers are f32 values in the shortest decimal form that reads back to the same bits.
///
/// ```
/// let settings = qemu::settings::of(&shared_model::Scenario::<f32>::reconstruction());
/// assert!(settings.contains(&"vehicle.wheel_radius_m=0.3".into()));
/// assert!(settings.contains(&"friction.law=coulomb_rate".into()));
/// ```
pub fn of(scenario: &Scenario<f32>) -> Vec<String> {
    let table = Table::try_from(scenario).expect("a scenario is plain tables and values");
    let mut settings = Vec::new();
    flatten("", &table, &mut settings);
    settings
}

fn flatten(prefix: &str, table: &Table, settings: &mut Vec<String>) {
    for (name, value) in table {
        let key = format!("{prefix}{name}");
        match value {
            Value::Table(inner) => flatten(&format!("{key}."), inner, settings),
            Value::Float(number) => settings.push(format!("{key}={}", *number as f32)),
            Value::String(choice) => settings.push(format!("{key}={choice}")),
            other => settings.push(format!("{key}={other}")),
        }
    }
}
