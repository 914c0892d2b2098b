//! Output files of the whole program: checked before the work begins, then complete or not there.
//!
//! | destination | treatment |
//! |---|---|
//! | regular file, or nothing yet | written aside and renamed at the end; mode and owner are kept; an existing one needs force |
//! | symbolic link | followed, and it stays; it counts as existing even if its target is missing |
//! | file with more than one hard link | refused: a rename would cut the link, a write in place can be interrupted |
//! | pipe, character device, open descriptor (`/dev/stdout`, `>(command)`), `-` for standard output | written into |
//! | folder, socket, block device | refused |
//!
//! An interrupted or failed write leaves the earlier file as it was, and no part of the new one.

mod aside;
mod place;

use anyhow::{Context, bail, ensure};
use aside::Aside;
use place::{Identity, Place};
use serde::Serialize;
use std::fs::{self, File};
use std::io::{BufWriter, IntoInnerError, Write};
use std::path::Path;

/// Where an output's content is written to.
pub type Writer = BufWriter<File>;

/// The destinations of one job, checked before its work begins.
#[derive(Debug)]
pub struct Outputs {
    force: bool,
    taken: Vec<(String, Identity)>,
    data_on_stdout: bool,
}

impl Outputs {
    /// No destination yet. With `force`, files that exist may be overwritten.
    pub fn new(force: bool) -> Self {
        Self {
            force,
            taken: Vec::new(),
            data_on_stdout: false,
        }
    }

    /// Notes a file that the job reads, which no output may overwrite.
    pub fn reads(&mut self, option: &str, path: &Path) {
        if let Ok(metadata) = fs::metadata(path) {
            let name = format!("{option} {}", path.display());
            self.taken.push((name, Identity::of(&metadata)));
        }
    }

    /// Checks that the file can be written, and that no other option has it.
    ///
    /// # Errors
    /// The first reason against it.
    pub fn file(&mut self, option: &str, path: &Path) -> anyhow::Result<()> {
        let place = checked(path, self.force)?;
        let identity = place.identity().with_context(|| cannot_write(path))?;
        let stdout = Identity::of_stdout();
        match place {
            Place::Null => return Ok(()),
            Place::File { .. } => ensure!(
                stdout.as_ref() != Some(&identity),
                "{option} {}: the standard output of this command goes there too; give another name",
                path.display()
            ),
            Place::Stdout | Place::Stream(_) => {
                self.data_on_stdout |= stdout.as_ref() == Some(&identity);
            }
        }
        self.take(option, path, identity)
    }

    /// Checks that files can be written into the folder, which may be missing, and that no other option has its name.
    ///
    /// # Errors
    /// The first reason against it.
    pub fn folder(&mut self, option: &str, path: &Path) -> anyhow::Result<()> {
        let identity = place::folder(path).with_context(|| cannot_write(path))?;
        self.take(option, path, identity)
    }

    /// Whether one of them is standard output, so that nothing else may be written there.
    pub fn data_on_stdout(&self) -> bool {
        self.data_on_stdout
    }

    fn take(&mut self, option: &str, path: &Path, identity: Identity) -> anyhow::Result<()> {
        let name = format!("{option} {}", path.display());
        if let Some((other, _)) = self.taken.iter().find(|(_, taken)| *taken == identity) {
            bail!("{other} and {name} are the same file; give each its own");
        }
        self.taken.push((name, identity));
        Ok(())
    }
}

/// The place of a file that may be written.
fn checked(path: &Path, force: bool) -> anyhow::Result<Place> {
    let place = Place::of(path).with_context(|| cannot_write(path))?;
    if let Place::File { exists: true, .. } = place {
        ensure!(
            force,
            "{} exists; give --force to overwrite it",
            path.display()
        );
    }
    Ok(place)
}

fn cannot_write(path: &Path) -> String {
    if path == Path::new(place::STDOUT) {
        return "cannot write to standard output".into();
    }
    format!("cannot write {}", path.display())
}

/// Whether the path is, or will be, that of a regular file.
pub fn is_file(path: &Path) -> bool {
    matches!(Place::of(path), Ok(Place::File { .. }))
}

/// Makes a folder for outputs, with those above it, unless it is there.
///
/// # Errors
/// If it cannot be made.
pub fn make_folder(path: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(path).with_context(|| format!("cannot make the folder {}", path.display()))
}

/// Writes an output. With `force`, a file that exists is overwritten.
///
/// # Errors
/// If there is no place for it, if `content` fails, or if not all of it can be written.
pub fn write(
    path: &Path,
    force: bool,
    content: impl FnOnce(&mut Writer) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let place = checked(path, force)?;
    let attempt = || -> anyhow::Result<()> {
        let (file, aside) = match place {
            Place::Stdout => (place::stdout()?, None),
            Place::Stream(path) => (place::open_stream(&path)?, None),
            Place::Null => (place::open_stream(path)?, None),
            Place::File { path, earlier, .. } => {
                let (file, aside) = Aside::begin(path, earlier)?;
                (file, Some(aside))
            }
        };
        let mut writer = Writer::new(file);
        content(&mut writer)?;
        let file = writer.into_inner().map_err(IntoInnerError::into_error)?;
        Ok(aside.map_or(Ok(()), |aside| aside.take_name(&file, force))?)
    };
    attempt().with_context(|| cannot_write(path))
}

/// Writes a text.
///
/// # Errors
/// As [`write`].
pub fn write_text(path: &Path, text: &str, force: bool) -> anyhow::Result<()> {
    write(path, force, |to| Ok(to.write_all(text.as_bytes())?))
}

/// Writes results as JSON.
///
/// # Errors
/// As [`write`].
pub fn write_json(path: &Path, results: &impl Serialize, force: bool) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(results)? + "\n";
    write_text(path, &json, force)
}

/// Writes rows as CSV, the columns named as their fields are.
///
/// # Errors
/// As [`write`].
pub fn write_rows(
    path: &Path,
    rows: impl IntoIterator<Item = impl Serialize>,
    force: bool,
) -> anyhow::Result<()> {
    write(path, force, |to| {
        let mut csv = csv::Writer::from_writer(to);
        for row in rows {
            csv.serialize(row)?;
        }
        Ok(csv.flush()?)
    })
}

#[cfg(test)]
mod tests;
