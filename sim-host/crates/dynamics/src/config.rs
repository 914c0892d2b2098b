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
    let mut table = table_of(&Scenario::preset(base));
    merge(&mut table, over, "")?;
    let scenario: Scenario<f64> = table.try_into().expect("merged over a complete scenario");
    Ok(scenario)
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

/// Replaces values of `base` by those of `over`. The base is complete, so a key that it lacks is
/// unknown.
fn merge(base: &mut Table, over: Table, prefix: &str) -> Result<(), ConfigError> {
    for (name, value) in over {
        let key = format!("{prefix}{name}");
        let Some(place) = base.get_mut(&name) else {
            let near = nearest(&name, base.keys()).map(|near| format!("{prefix}{near}"));
            return Err(ConfigError::UnknownKey { key, near });
        };
        match (place, value) {
            (Value::Table(inner), Value::Table(value)) => {
                merge(inner, value, &format!("{key}."))?;
            }
            (place @ Value::Float(_), Value::Integer(value)) => *place = Value::Float(value as f64),
            (place @ Value::Float(_), value @ Value::Float(_))
            | (place @ Value::Boolean(_), value @ Value::Boolean(_)) => *place = value,
            (place @ Value::String(_), Value::String(value)) => {
                *place = Value::String(choice(&key, value)?);
            }
            (place, value) => return Err(wrong_kind(&key, &value, kind(place))),
        }
    }
    Ok(())
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

/// The value of a parameter that is one of a few names, if it is one of them.
fn choice(key: &str, value: String) -> Result<String, ConfigError> {
    let names = choices(key).unwrap_or_default();
    if names.contains(&value.as_str()) {
        return Ok(value);
    }
    let expected = format!("one of {}", names.join(", "));
    Err(wrong_kind(key, &Value::String(value), &expected))
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
