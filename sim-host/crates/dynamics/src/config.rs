//! Configurations: a preset, a TOML file over it, and command-line options over both.

use files::input;
use shared_model::settings::Choice;
use shared_model::short::Short;
use shared_model::{InvalidScenario, Preset, Scenario};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no TOML.
    #[error("{path} is not TOML: {source}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: toml::de::Error,
    },
    /// A key that no parameter has.
    #[error("unknown key {key}{}; `sim-host config` prints all keys", suggest(.near))]
    UnknownKey {
        /// The key.
        key: String,
        /// The known key most like it.
        near: Option<String>,
    },
    /// A parameter that must be there is not.
    #[error("the key {key} is missing")]
    MissingKey {
        /// The key.
        key: String,
    },
    /// A value of the wrong kind.
    #[error("{key} = {found}: must be {expected}")]
    WrongKind {
        /// The key.
        key: String,
        /// The value.
        found: String,
        /// What it must be.
        expected: String,
    },
    /// No such preset.
    #[error("unknown preset {name:?}: must be one of {}", names::<Preset>().join(", "))]
    UnknownPreset {
        /// The name.
        name: String,
    },
    /// The parameters cannot be run.
    #[error(transparent)]
    Invalid(#[from] InvalidScenario),
}

fn suggest(near: &Option<String>) -> String {
    near.as_ref()
        .map_or_else(String::new, |near| format!("; did you mean {near}?"))
}

fn names<C: Choice>() -> Vec<&'static str> {
    C::ALL.iter().map(|choice| choice.name()).collect()
}

/// Key of the preset in a file.
const PRESET: &str = "preset";

/// The preset of that name.
///
/// # Errors
/// If there is none.
pub fn preset(name: &str) -> Result<Preset, ConfigError> {
    Preset::from_name(name).ok_or_else(|| ConfigError::UnknownPreset { name: name.into() })
}

/// The scenario of a file's table over a preset: the one named, else that named in the file, else
/// `reconstruction`.
///
/// # Errors
/// If it has a key that no parameter has, or a value of the wrong kind.
pub fn over_preset(
    mut over: Table,
    preset_name: Option<&str>,
) -> Result<Scenario<f64>, ConfigError> {
    let in_file = over.remove(PRESET);
    let base = match (preset_name, &in_file) {
        (Some(name), _) => preset(name)?,
        (None, Some(Value::String(name))) => preset(name)?,
        (None, Some(other)) => return Err(wrong_kind(PRESET, other, "a name")),
        (None, None) => Preset::Reconstruction,
    };
    let mut scenario = Scenario::preset(base);
    let complete = table_of(&scenario);
    put(over, &mut scenario, &complete, "")?;
    Ok(scenario)
}

/// The scenario of a complete TOML file.
///
/// # Errors
/// If it is no TOML, lacks a parameter, has a key that no parameter has, or a value of the wrong
/// kind.
pub fn from_toml(text: &str) -> Result<Scenario<f64>, ConfigError> {
    let table: Table = text.parse().map_err(|source| ConfigError::Syntax {
        path: "the configuration".into(),
        source,
    })?;
    let mut scenario = Scenario::reconstruction();
    let complete = table_of(&scenario);
    if let Some(key) = first_missing(&complete, &table, "") {
        return Err(ConfigError::MissingKey { key });
    }
    put(table, &mut scenario, &complete, "")?;
    Ok(scenario)
}

/// The first key of a complete scenario that another table lacks.
fn first_missing(complete: &Table, table: &Table, prefix: &str) -> Option<String> {
    complete.iter().find_map(|(name, value)| {
        let key = format!("{prefix}{name}");
        match (value, table.get(name)) {
            (_, None) => Some(key),
            (Value::Table(value), Some(Value::Table(inner))) => {
                first_missing(value, inner, &format!("{key}."))
            }
            _ => None,
        }
    })
}

/// Checks a scenario in both arithmetics that it is run in.
///
/// # Errors
/// If it is not valid.
pub fn validate(scenario: &Scenario<f64>) -> Result<(), ConfigError> {
    scenario.validate()?;
    Ok(scenario.map(&|value| value as f32).validate()?)
}

/// A scenario as a complete TOML file.
pub fn to_toml(scenario: &Scenario<f64>) -> String {
    table_of(scenario).to_string()
}

/// As [`to_toml`], with the allowed range or names of each parameter as a comment.
///
/// ```
/// use shared_model::Scenario;
/// let text = dynamics::config::to_commented_toml(&Scenario::reconstruction());
/// assert!(text.contains("mass_kg = 1500.0 # 1 to 100000\n"));
/// ```
pub fn to_commented_toml(scenario: &Scenario<f64>) -> String {
    let mut section = String::new();
    let mut text = String::new();
    for line in to_toml(scenario).lines() {
        text += line;
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').to_owned();
        } else if let Some((name, _)) = line.split_once(" = ")
            && let Some(allowed) = allowed(&format!("{section}.{name}"))
        {
            text += &format!(" # {allowed}");
        }
        text.push('\n');
    }
    text
}

/// A parameter of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Key, as in a file.
    pub key: String,
    /// Description, with the unit.
    pub description: &'static str,
    /// Value, with those that are allowed.
    pub allowed: Allowed,
}

/// The value of a parameter, with those that are allowed.
#[derive(Debug, Clone, PartialEq)]
pub enum Allowed {
    /// A number.
    Range {
        /// The number.
        value: f64,
        /// Least allowed number.
        min: f64,
        /// Greatest allowed number.
        max: f64,
    },
    /// One of a few names.
    Names {
        /// The name.
        value: String,
        /// All names.
        names: Vec<&'static str>,
    },
    /// True or false.
    Flag {
        /// Which.
        value: bool,
    },
}

/// All parameters of a scenario, in the order of its file.
///
/// ```
/// use dynamics::config::{Allowed, parameters};
/// use shared_model::Scenario;
/// let all = parameters(&Scenario::reconstruction());
/// let mass = all.iter().find(|one| one.key == "vehicle.mass_kg").unwrap();
/// assert_eq!(mass.description, "Mass m, kg.");
/// assert_eq!(mass.allowed, Allowed::Range { value: 1500.0, min: 1.0, max: 1e5 });
/// ```
pub fn parameters(scenario: &Scenario<f64>) -> Vec<Parameter> {
    let mut parameters = Vec::new();
    list("", table_of(scenario), &mut parameters);
    parameters
}

fn list(prefix: &str, table: Table, parameters: &mut Vec<Parameter>) {
    for (name, value) in table {
        let key = format!("{prefix}{name}");
        let allowed = match value {
            Value::Table(table) => {
                list(&format!("{key}."), table, parameters);
                continue;
            }
            Value::Boolean(value) => Allowed::Flag { value },
            Value::Float(value) => {
                let (min, max) = Scenario::<f64>::range(&key).expect("every number has a range");
                Allowed::Range { value, min, max }
            }
            other => Allowed::Names {
                value: other.as_str().unwrap_or_default().to_owned(),
                names: choices(&key).expect("all others have names"),
            },
        };
        let description = Scenario::<f64>::description(&key).expect("every parameter has one");
        parameters.push(Parameter {
            key,
            description,
            allowed,
        });
    }
}

/// The allowed values of the parameter of that key, where its value does not show them.
fn allowed(key: &str) -> Option<String> {
    match Scenario::<f64>::range(key) {
        Some((min, max)) => Some(format!("{} to {}", Short(min), Short(max))),
        None => choices(key).map(|names| names.join(", ")),
    }
}

/// The parameters in which a scenario differs from the paper's (the preset `reconstruction`), each
/// as `key = value (paper's value)`.
pub fn differences(scenario: &Scenario<f64>) -> Vec<String> {
    let mut differences = Vec::new();
    let paper = table_of(&Scenario::reconstruction());
    compare("", &table_of(scenario), &paper, &mut differences);
    differences
}

fn compare(prefix: &str, own: &Table, paper: &Table, differences: &mut Vec<String>) {
    for ((name, own), paper) in own.iter().zip(paper.values()) {
        match (own, paper) {
            (Value::Table(own), Value::Table(paper)) => {
                compare(&format!("{prefix}{name}."), own, paper, differences);
            }
            _ if own == paper => {}
            _ => differences.push(format!("{prefix}{name} = {own} ({paper})")),
        }
    }
}

fn table_of(scenario: &Scenario<f64>) -> Table {
    Table::try_from(scenario).expect("a scenario is plain tables and values")
}

/// A TOML file, unchecked.
///
/// # Errors
/// If it cannot be read, or is no TOML.
pub fn read(path: &Path) -> Result<Table, ConfigError> {
    let text =
        input::read_text(path, input::TEXT_BYTES).map_err(|source| ConfigError::Unreadable {
            path: path.to_path_buf(),
            source,
        })?;
    text.parse().map_err(|source| ConfigError::Syntax {
        path: path.to_path_buf(),
        source,
    })
}

/// Puts the values of `over` into the scenario. A key that is not in the `complete` table is
/// unknown, and its values have the kinds that are expected.
fn put(
    over: Table,
    scenario: &mut Scenario<f64>,
    complete: &Table,
    prefix: &str,
) -> Result<(), ConfigError> {
    for (name, value) in over {
        let key = format!("{prefix}{name}");
        let Some(usual) = complete.get(&name) else {
            let near = nearest(&name, complete.keys()).map(|near| format!("{prefix}{near}"));
            return Err(ConfigError::UnknownKey { key, near });
        };
        match (usual, value) {
            (Value::Table(inner), Value::Table(over)) => {
                put(over, scenario, inner, &format!("{key}."))?;
            }
            (Value::Float(_), Value::Float(value)) => set(scenario, &key, value),
            (Value::Float(_), Value::Integer(value)) => set(scenario, &key, value as f64),
            (Value::Boolean(_), value @ Value::Boolean(_))
            | (Value::String(_), value @ Value::String(_)) => choose(scenario, &key, &value)?,
            (usual, value) => return Err(wrong_kind(&key, &value, kind(usual))),
        }
    }
    Ok(())
}

fn set(scenario: &mut Scenario<f64>, key: &str, value: f64) {
    *scenario.number(key).expect("a number of every scenario") = value;
}

/// Sets a parameter that is one of a few names.
fn choose(scenario: &mut Scenario<f64>, key: &str, value: &Value) -> Result<(), ConfigError> {
    let name = value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned);
    scenario.apply(&format!("{key}={name}")).map_err(|_| {
        let names = choices(key).unwrap_or_default();
        wrong_kind(key, value, &format!("one of {}", names.join(", ")))
    })
}

/// The names that the parameter of that key can have; `None` if it is none with names.
fn choices(key: &str) -> Option<Vec<&'static str>> {
    use shared_model::dither::{Application, Waveform};
    use shared_model::policy::Suppression;
    use shared_model::{friction::FrictionLaw, tire::TireModel, vehicle::SlipForm};
    match key {
        "vehicle.slip_form" => Some(names::<SlipForm>()),
        "tires.model" => Some(names::<TireModel>()),
        "friction.law" => Some(names::<FrictionLaw>()),
        "dither.waveform" => Some(names::<Waveform>()),
        "dither.application" => Some(names::<Application>()),
        "controller.suppression" => Some(names::<Suppression>()),
        _ => None,
    }
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Table(_) => "a table",
        Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        _ => "a name in quotes",
    }
}

fn wrong_kind(key: &str, found: &Value, expected: &str) -> ConfigError {
    ConfigError::WrongKind {
        key: key.into(),
        found: found.to_string(),
        expected: expected.into(),
    }
}

fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a String>) -> Option<&'a String> {
    let scored = known.map(|known| (strsim::jaro_winkler(name, known), known));
    let best = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 > 0.7).then_some(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_model::dither::Waveform;

    /// Every number another one, and some of the names.
    fn other() -> Scenario<f64> {
        let mut other = Scenario::<f64>::printed().map(&|value| 1.5 * value + 0.1);
        other.dither.waveform = Waveform::Square;
        other
    }

    #[test]
    fn a_file_is_read_back_to_the_last_bit() {
        assert_eq!(from_toml(&to_toml(&other())).unwrap(), other());
    }

    #[test]
    fn a_complete_file_lacks_nothing_and_has_nothing_else() {
        let text = to_toml(&other());
        for line in text.lines().filter(|line| line.contains(" = ")) {
            let (name, _) = line.split_once(" = ").unwrap();
            let error = from_toml(&text.replacen(&format!("{line}\n"), "", 1)).unwrap_err();
            assert!(
                matches!(&error, ConfigError::MissingKey { key } if key.ends_with(name)),
                "{line}: {error}"
            );
        }
        let unknown = from_toml(&text.replace("[run]\n", "[run]\nspeed = 1.0\n")).unwrap_err();
        assert_eq!(
            unknown.to_string(),
            "unknown key run.speed; `sim-host config` prints all keys"
        );
        let empty = from_toml("").unwrap_err();
        assert_eq!(empty.to_string(), "the key controller is missing");
    }

    #[test]
    fn a_file_over_a_preset_keeps_the_rest() {
        let over = "preset = \"printed\"\nrun.wheel_speed_rpm = 1600\nfriction.dithered = false";
        let mut expected = Scenario::printed();
        expected.run.wheel_speed_rpm = 1600.0;
        expected.friction.dithered = false;
        let read = over_preset(over.parse().unwrap(), None);
        assert_eq!(read.unwrap(), expected);
        let no_name = over_preset("friction.law = \"other\"".parse().unwrap(), None);
        let no_name = no_name.unwrap_err().to_string();
        assert!(
            no_name.starts_with("friction.law = \"other\": must be one of "),
            "{no_name}"
        );
    }
}
