//! Output files: never overwritten unasked, never left half written.

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Refuses an output that is there already, before any work is done for it.
pub fn check_free(path: &Path, force: bool) -> anyhow::Result<()> {
    if path.exists() && !force {
        bail!("{} exists; give --force to overwrite it", path.display());
    }
    Ok(())
}

/// The same of all outputs that were asked for.
pub fn check_all_free<'a>(
    files: impl IntoIterator<Item = &'a Option<PathBuf>>,
    force: bool,
) -> anyhow::Result<()> {
    let mut paths = files.into_iter().flatten();
    paths.try_for_each(|path| check_free(path, force))
}

/// A file that takes its name only when it is complete.
pub struct Output<'a> {
    path: &'a Path,
    writer: BufWriter<NamedTempFile<File>>,
}

impl<'a> Output<'a> {
    /// Begins a file at `path`.
    pub fn create(path: &'a Path, force: bool) -> anyhow::Result<Self> {
        check_free(path, force)?;
        let folder = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let file =
            temporary(folder).with_context(|| format!("cannot write into {}", folder.display()))?;
        let writer = BufWriter::new(file);
        Ok(Self { path, writer })
    }

    /// Where its bytes go.
    pub fn writer(&mut self) -> &mut impl Write {
        &mut self.writer
    }

    /// Completes the file.
    pub fn finish(self) -> anyhow::Result<()> {
        let failed = || format!("cannot write {}", self.path.display());
        let file = self.writer.into_inner().with_context(failed)?;
        file.persist(self.path).with_context(failed)?;
        Ok(())
    }
}

/// A temporary file beside the output, with the permissions that any new file has.
fn temporary(folder: &Path) -> std::io::Result<NamedTempFile<File>> {
    use std::os::unix::fs::PermissionsExt;
    let any = std::fs::Permissions::from_mode(0o666);
    tempfile::Builder::new()
        .permissions(any)
        .tempfile_in(folder)
}

/// Writes a text.
pub fn write_text(path: &Path, text: &str, force: bool) -> anyhow::Result<()> {
    let mut output = Output::create(path, force)?;
    output.writer().write_all(text.as_bytes())?;
    output.finish()
}

/// Writes results as JSON.
pub fn write_json(path: &Path, results: &impl Serialize, force: bool) -> anyhow::Result<()> {
    write_text(
        path,
        &(serde_json::to_string_pretty(results)? + "\n"),
        force,
    )
}

/// Writes rows as CSV, the columns named as their fields are.
pub fn write_rows(
    path: &Path,
    rows: impl IntoIterator<Item = impl Serialize>,
    force: bool,
) -> anyhow::Result<()> {
    let mut output = Output::create(path, force)?;
    let mut csv = csv::Writer::from_writer(output.writer());
    for row in rows {
        csv.serialize(row)?;
    }
    csv.flush()?;
    drop(csv);
    output.finish()
}

/// Where an analysis writes its results. Without any, a summary is all there is.
#[derive(Args)]
pub struct Destinations {
    /// Write the results as CSV
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write the results as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw them as an SVG figure
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// Overwrite files that exist
    #[arg(long)]
    pub force: bool,
}

impl Destinations {
    /// Refuses files that are there already, before any work is done for them.
    pub fn check_free(&self) -> anyhow::Result<()> {
        check_all_free([&self.out, &self.json, &self.figure], self.force)
    }

    /// Writes the rows as CSV, all results as JSON, and the figure: each if it was asked for.
    pub fn write(
        &self,
        rows: impl IntoIterator<Item = impl Serialize>,
        results: &impl Serialize,
        draw: impl FnOnce() -> anyhow::Result<String>,
    ) -> anyhow::Result<()> {
        if let Some(path) = &self.out {
            write_rows(path, rows, self.force)?;
        }
        if let Some(path) = &self.json {
            write_json(path, results, self.force)?;
        }
        if let Some(path) = &self.figure {
            write_text(path, &draw()?, self.force)?;
        }
        Ok(())
    }
}
