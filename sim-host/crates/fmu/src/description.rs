//! The model description: `modelDescription.xml` of a unit.

use crate::model::Model;
use crate::variable::{Causality, Range, Value, Variable};
use dynamics::unit;
use quick_xml::Writer;
use quick_xml::writer::ElementWriter;
use shared_model::Scenario;
use std::io;

/// The generator, and the tool that a master names.
pub(crate) const TOOL: &str = concat!("Dithersteer ", env!("CARGO_PKG_VERSION"));
const FINGERPRINTS: [crc::Crc<u64>; 2] = [
    crc::Crc::<u64>::new(&crc::CRC_64_XZ),
    crc::Crc::<u64>::new(&crc::CRC_64_ECMA_182),
];

type Xml = Writer<Vec<u8>>;

/// The model description of a unit with the start values of a configuration.
pub fn text(model: Model, scenario: &Scenario<f64>) -> String {
    let variables = model.variables(scenario);
    written(model, scenario, &variables, &guid(model, scenario))
}

/// The fingerprint of the description: that of its text without a fingerprint.
pub fn guid(model: Model, scenario: &Scenario<f64>) -> String {
    let variables = model.variables(scenario);
    let text = written(model, scenario, &variables, "");
    let [a, b] = FINGERPRINTS.map(|fingerprint| fingerprint.checksum(text.as_bytes()));
    let digits = format!("{a:016x}{b:016x}");
    let groups = [0..8, 8..12, 12..16, 16..20, 20..32].map(|group| &digits[group]);
    format!("{{{}}}", groups.join("-"))
}

fn written(model: Model, scenario: &Scenario<f64>, variables: &[Variable], guid: &str) -> String {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    let done = document(&mut xml, model, scenario, variables, guid);
    done.expect("memory takes every byte");
    let text = String::from_utf8(xml.into_inner()).expect("the texts are UTF-8");
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{text}\n")
}

fn document(
    xml: &mut Xml,
    model: Model,
    scenario: &Scenario<f64>,
    variables: &[Variable],
    guid: &str,
) -> io::Result<()> {
    let about = match model {
        Model::Ecu => {
            "Steering ECU: control task with gate, and PWM task, in the arithmetic of the target"
        }
        Model::Vehicle => "Vehicle on a low-friction road, with steering servo and sensors",
    };
    xml.create_element("fmiModelDescription")
        .with_attribute(("fmiVersion", "2.0"))
        .with_attribute(("modelName", model.identifier().as_str()))
        .with_attribute(("guid", guid))
        .with_attribute(("description", about))
        .with_attribute(("author", env!("CARGO_PKG_AUTHORS")))
        .with_attribute(("version", env!("CARGO_PKG_VERSION")))
        .with_attribute(("license", env!("CARGO_PKG_LICENSE")))
        .with_attribute(("generationTool", TOOL))
        .with_attribute(("variableNamingConvention", "structured"))
        .with_attribute(("numberOfEventIndicators", "0"))
        .write_inner_content(|xml| {
            co_simulation(xml, model)?;
            units(xml, variables)?;
            types(xml, variables)?;
            log_categories(xml)?;
            experiment(xml, scenario)?;
            model_variables(xml, variables)?;
            structure(xml, variables)
        })?;
    Ok(())
}

fn co_simulation(xml: &mut Xml, model: Model) -> io::Result<()> {
    xml.create_element("CoSimulation")
        .with_attribute(("modelIdentifier", model.identifier().as_str()))
        .with_attribute(("canHandleVariableCommunicationStepSize", "true"))
        .with_attribute(("canNotUseMemoryManagementFunctions", "true"))
        .with_attribute(("canGetAndSetFMUstate", "true"))
        .with_attribute(("canSerializeFMUstate", "false"))
        .write_empty()?;
    Ok(())
}

fn units(xml: &mut Xml, variables: &[Variable]) -> io::Result<()> {
    let is_used = |unit: &&unit::Unit| variables.iter().any(|one| one.unit() == Some(*unit));
    let used: Vec<&unit::Unit> = unit::ALL.iter().filter(is_used).collect();
    xml.create_element("UnitDefinitions")
        .write_inner_content(|xml| {
            for unit in used {
                let element = xml.create_element("Unit");
                element
                    .with_attribute(("name", unit.symbol))
                    .write_inner_content(|xml| {
                        let mut base = xml.create_element("BaseUnit");
                        for (name, exponent) in unit.base() {
                            base = base.with_attribute((name, exponent.to_string().as_str()));
                        }
                        if unit.factor != 1.0 {
                            base = base.with_attribute(("factor", number(unit.factor).as_str()));
                        }
                        base.write_empty().map(drop)
                    })?;
            }
            Ok(())
        })?;
    Ok(())
}

/// The enumerations, each with the name of its variable.
fn types(xml: &mut Xml, variables: &[Variable]) -> io::Result<()> {
    let is_enumeration = |variable: &&Variable| !variable.alternatives.is_empty();
    xml.create_element("TypeDefinitions")
        .write_inner_content(|xml| {
            for variable in variables.iter().filter(is_enumeration) {
                xml.create_element("SimpleType")
                    .with_attribute(("name", type_name(variable).as_str()))
                    .write_inner_content(|xml| {
                        xml.create_element("Enumeration")
                            .write_inner_content(|xml| items(xml, variable))
                            .map(drop)
                    })?;
            }
            Ok(())
        })?;
    Ok(())
}

/// The name of a type must not be that of a variable.
fn type_name(variable: &Variable) -> String {
    format!("type.{}", variable.name)
}

fn items(xml: &mut Xml, variable: &Variable) -> io::Result<()> {
    for (value, name) in &variable.alternatives {
        xml.create_element("Item")
            .with_attribute(("name", name.as_str()))
            .with_attribute(("value", value.to_string().as_str()))
            .write_empty()?;
    }
    Ok(())
}

fn log_categories(xml: &mut Xml) -> io::Result<()> {
    xml.create_element("LogCategories")
        .write_inner_content(|xml| {
            xml.create_element("Category")
                .with_attribute(("name", LOG_CATEGORY))
                .with_attribute(("description", "Why a call was refused"))
                .write_empty()
                .map(drop)
        })?;
    Ok(())
}

/// The one category of messages.
pub(crate) const LOG_CATEGORY: &str = "logStatusError";

fn experiment(xml: &mut Xml, scenario: &Scenario<f64>) -> io::Result<()> {
    let run = &scenario.run;
    xml.create_element("DefaultExperiment")
        .with_attribute(("startTime", "0"))
        .with_attribute(("stopTime", number(run.duration_s).as_str()))
        .with_attribute(("stepSize", number(1.0 / run.pwm_rate_hz).as_str()))
        .write_empty()?;
    Ok(())
}

fn model_variables(xml: &mut Xml, variables: &[Variable]) -> io::Result<()> {
    xml.create_element("ModelVariables")
        .write_inner_content(|xml| {
            for (reference, variable) in variables.iter().enumerate() {
                let (causality, variability) = match (variable.causality, variable.start) {
                    (Causality::Parameter, _) => ("parameter", "fixed"),
                    (Causality::Input, Value::Real(_)) => ("input", "continuous"),
                    (Causality::Input, _) => ("input", "discrete"),
                    (Causality::Output, _) => ("output", "discrete"),
                };
                xml.create_element("ScalarVariable")
                    .with_attribute(("name", variable.name.as_str()))
                    .with_attribute(("valueReference", reference.to_string().as_str()))
                    .with_attribute(("description", variable.description.as_str()))
                    .with_attribute(("causality", causality))
                    .with_attribute(("variability", variability))
                    .write_inner_content(|xml| value_type(xml, variable))?;
            }
            Ok(())
        })?;
    Ok(())
}

fn value_type(xml: &mut Xml, variable: &Variable) -> io::Result<()> {
    let (name, start) = match variable.start {
        Value::Real(start) => ("Real", number(start)),
        Value::Integer(start) if variable.alternatives.is_empty() => ("Integer", start.to_string()),
        Value::Integer(start) => ("Enumeration", start.to_string()),
        Value::Boolean(start) => ("Boolean", start.to_string()),
    };
    let mut element = xml.create_element(name);
    if name == "Enumeration" {
        element = element.with_attribute(("declaredType", type_name(variable).as_str()));
    }
    if let Some(unit) = variable.unit() {
        element = element.with_attribute(("unit", unit.symbol));
    }
    if let Range::Within(min, max) = variable.range {
        element = bounded(element, variable.start, min, max);
    }
    // The start of an output is computed.
    if variable.causality != Causality::Output {
        element = element.with_attribute(("start", start.as_str()));
    }
    element.write_empty().map(drop)
}

fn bounded<'a>(
    element: ElementWriter<'a, Vec<u8>>,
    start: Value,
    min: f64,
    max: f64,
) -> ElementWriter<'a, Vec<u8>> {
    let bound = |bound: f64| match start {
        Value::Integer(_) => format!("{bound:.0}"),
        _ => number(bound),
    };
    element
        .with_attribute(("min", bound(min).as_str()))
        .with_attribute(("max", bound(max).as_str()))
}

/// No output depends on an input at the same time.
fn structure(xml: &mut Xml, variables: &[Variable]) -> io::Result<()> {
    let numbered = (1..).zip(variables);
    let is_output = |(_, variable): &(usize, &Variable)| variable.causality == Causality::Output;
    let outputs: Vec<String> = numbered
        .filter(is_output)
        .map(|(index, _)| index.to_string())
        .collect();
    xml.create_element("ModelStructure")
        .write_inner_content(|xml| {
            xml.create_element("Outputs").write_inner_content(|xml| {
                for index in &outputs {
                    xml.create_element("Unknown")
                        .with_attribute(("index", index.as_str()))
                        .with_attribute(("dependencies", ""))
                        .write_empty()?;
                }
                Ok(())
            })?;
            xml.create_element("InitialUnknowns")
                .write_inner_content(|xml| {
                    for index in &outputs {
                        xml.create_element("Unknown")
                            .with_attribute(("index", index.as_str()))
                            .write_empty()?;
                    }
                    Ok(())
                })?;
            Ok(())
        })?;
    Ok(())
}

/// With all digits that distinguish it.
fn number(value: f64) -> String {
    format!("{value:?}")
}
