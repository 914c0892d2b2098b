//! Output files: options, and checks before the work begins.

use super::stdout;
use clap::Args;
use files::output::{Outputs, write_json, write_rows, write_text};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A file or folder, and the option that names it.
pub type Named<'a> = (&'static str, &'a Path);

/// The file of an option, if given.
pub fn named<'a>(option: &'static str, file: &'a Option<PathBuf>) -> Option<Named<'a>> {
    file.as_deref().map(|file| (option, file))
}

/// Checks a job's output files before its work begins. An input file must not be among them.
pub fn check<'a>(
    inputs: impl IntoIterator<Item = Named<'a>>,
    files: impl IntoIterator<Item = Option<Named<'a>>>,
    force: bool,
) -> anyhow::Result<Outputs> {
    let mut outputs = Outputs::new(force);
    for (option, path) in inputs {
        outputs.reads(option, path);
    }
    for (option, path) in files.into_iter().flatten() {
        outputs.file(option, path)?;
    }
    if outputs.data_on_stdout() {
        stdout::leave_to_data();
    }
    Ok(outputs)
}

/// Output files of an analysis. Without them, only a summary is printed.
#[derive(Args)]
pub struct Destinations {
    /// Write the results as CSV; `-` is standard output, for this and all other files
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write the results as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw the results as an SVG figure
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// Overwrite existing files
    #[arg(long)]
    pub force: bool,
}

impl Destinations {
    /// The requested files.
    pub fn files(&self) -> [Option<Named<'_>>; 3] {
        [
            named("--out", &self.out),
            named("--json", &self.json),
            named("--figure", &self.figure),
        ]
    }

    /// Checks them before the work begins.
    pub fn check<'a>(&'a self, inputs: impl IntoIterator<Item = Named<'a>>) -> anyhow::Result<()> {
        check(inputs, self.files(), self.force).map(drop)
    }

    /// Writes the rows as CSV, all results as JSON, and the figure: each if requested.
    pub fn write(
        &self,
        rows: impl IntoIterator<Item = impl Serialize>,
        results: &impl Serialize,
        draw: impl FnOnce() -> String,
    ) -> anyhow::Result<()> {
        if let Some(path) = &self.out {
            write_rows(path, rows, self.force)?;
        }
        if let Some(path) = &self.json {
            write_json(path, results, self.force)?;
        }
        if let Some(path) = &self.figure {
            write_text(path, &draw(), self.force)?;
        }
        Ok(())
    }
}
