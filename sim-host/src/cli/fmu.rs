//! `sim-host fmu`: ECU or vehicle as a functional mock-up unit.

use super::options::ConfigOptions;
use super::outcome::Outcome;
use super::output::check;
use anyhow::{Context, bail, ensure};
use clap::builder::PossibleValuesParser;
use clap::builder::TypedValueParser;
use dynamics::config::validate;
use files::output;
use fmu::archive::{LIBRARY, is_library, write};
use fmu::model::Model;
use std::env;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Write the ECU or the vehicle as a functional mock-up unit (FMU): FMI 2.0 for co-simulation, Linux
/// on x86-64.
///
/// Coupled at every PWM period, the two give the same bits as `sim-host pil`. The configuration gives
/// the start values of all parameters; the importing tool can change them.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  sim-host fmu ecu --out ecu.fmu            # sensor signals in, duty out
  sim-host fmu vehicle --out vehicle.fmu    # duty in, sensor signals out
  sim-host config > vehicle.toml
  sim-host fmu vehicle --config vehicle.toml --out own.fmu

docs/fmu.md lists the signals and explains how to couple them.")]
pub struct Arguments {
    /// Unit: the ECU's program, or the vehicle with servo and sensors
    #[arg(value_parser = models())]
    unit: Model,
    #[command(flatten)]
    config: ConfigOptions,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Shared library of the units [default: libdithersteer_fmu.so in `deps` beside this program, as
    /// built, or beside it, as installed]
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    /// Overwrite an existing file
    #[arg(long)]
    force: bool,
}

fn models() -> impl TypedValueParser<Value = Model> {
    PossibleValuesParser::new(Model::ALL.map(Model::name))
        .map(|name| Model::from_name(&name).expect("one of the names above"))
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let library = match &arguments.library {
        Some(file) => file.clone(),
        None => library()?,
    };
    let inputs = arguments.config.input().into_iter();
    let inputs = inputs.chain([("--library", library.as_path())]);
    let out = ("--out", arguments.out.as_path());
    check(inputs, [Some(out)], arguments.force)?;
    let scenario = arguments.config.load()?;
    validate(&scenario)?;
    arguments.unit.check(&scenario)?;
    let content =
        fs::read(&library).with_context(|| format!("cannot read {}", library.display()))?;
    ensure!(
        is_library(&content),
        "{} is not {LIBRARY} of this version",
        library.display()
    );
    output::write(&arguments.out, arguments.force, |to| {
        Ok(write(
            arguments.unit,
            &scenario,
            &content,
            to as &mut dyn Write,
        )?)
    })?;
    say!(
        "{}: FMI 2.0 for co-simulation, step size {} s, {} variables",
        arguments.out.display(),
        1.0 / scenario.run.pwm_rate_hz,
        arguments.unit.variables(&scenario).len()
    );
    Ok(Outcome::Success)
}

/// The shared library: where a build leaves it, or beside the installed program.
fn library() -> anyhow::Result<PathBuf> {
    let program = env::current_exe().unwrap_or_default();
    let folder = program.parent().unwrap_or(Path::new(""));
    // First where every build leaves it: a build of the whole workspace also leaves a copy beside the program, which later
    // builds of the program do not renew.
    let places = [folder.join("deps").join(LIBRARY), folder.join(LIBRARY)];
    if let Some(found) = places.iter().find(|place| place.is_file()) {
        return Ok(found.clone());
    }
    let [built, installed] = &places;
    bail!(
        "no shared library of the units: there is no {}, no {}; copy it there from the release, build it with \
         `cargo build --release -p sim-host`, or give its path by --library",
        installed.display(),
        built.display()
    )
}
