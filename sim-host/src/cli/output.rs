//! Output files: never overwritten unasked, never left half written.

use anyhow::{Context, bail};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// Refuses an output that is there already, before any work is done for it.
pub fn check_free(path: &Path, force: bool) -> anyhow::Result<()> {
    if path.exists() && !force {
        bail!("{} exists; give --force to overwrite it", path.display());
    }
    Ok(())
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
        let file = NamedTempFile::new_in(folder)
            .with_context(|| format!("cannot write into {}", folder.display()))?;
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
