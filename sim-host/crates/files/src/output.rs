//! Output files: checked before the work begins, then complete or absent.
//!
//! | destination | treatment |
//! |---|---|
//! | regular file, or nothing yet | written to a temporary file and renamed at the end; mode and owner are kept; an existing file requires `--force` |
//! | symbolic link | followed and kept; it counts as existing even if its target is missing |
//! | file with more than one hard link | refused: a rename would cut the link, a write in place can be interrupted |
//! | pipe, character device, open descriptor (`/dev/stdout`, `>(command)`), `-` for standard output | written into |
//! | folder, socket, block device | refused |
//!
//! An interrupted or failed write leaves the earlier file as it was, and no part of the new one.

mod aside;
mod place;

use aside::Aside;
use place::{Identity, Place};
use serde::Serialize;
use std::convert::Infallible;
use std::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};

pub use place::Unwritable;

/// Destination of an output's content.
pub type Writer = BufWriter<File>;

/// The reason why the content of an output could not be produced or written.
pub type ContentError = Box<dyn Error + Send + Sync>;

/// An error of an output.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// It has no valid destination, or its content could not be produced or written.
    #[error("cannot write {output}")]
    Output {
        /// Its path, or standard output.
        output: String,
        /// The reason.
        source: ContentError,
    },
    /// The file exists and must not be overwritten.
    #[error("{} exists; give --force to overwrite it", .0.display())]
    Exists(PathBuf),
    /// Two destinations of a job are the same file.
    #[error("{first} and {second} are the same file; give each a separate file")]
    Twice {
        /// Option and path of one.
        first: String,
        /// Option and path of the other.
        second: String,
    },
    /// Standard output is redirected into the file.
    #[error("{0}: standard output of this command is also written to this file; give another name")]
    IsStdout(String),
    /// A folder for outputs cannot be created.
    #[error("cannot create the folder {}", path.display())]
    Folder {
        /// Its path.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
}

/// The destinations of one job, checked before its work begins.
#[derive(Debug)]
pub struct Outputs {
    force: bool,
    taken: Vec<(String, Identity)>,
    data_on_stdout: bool,
}

impl Outputs {
    /// No destination yet. With `force`, existing files may be overwritten.
    pub fn new(force: bool) -> Self {
        Self {
            force,
            taken: Vec::new(),
            data_on_stdout: false,
        }
    }

    /// Adds an input file, which no output may overwrite.
    pub fn reads(&mut self, option: &str, path: &Path) {
        if let Ok(metadata) = fs::metadata(path) {
            self.taken
                .push((named(option, path), Identity::of(&metadata)));
        }
    }

    /// Checks that the file can be written and is not that of another option.
    ///
    /// # Errors
    /// The first violation.
    pub fn file(&mut self, option: &str, path: &Path) -> Result<(), WriteError> {
        let place = checked(path, self.force)?;
        let identity = place.identity().map_err(|error| unwritten(path, error))?;
        let stdout = Identity::of_stdout();
        match place {
            Place::Null => return Ok(()),
            Place::File { .. } if stdout.as_ref() == Some(&identity) => {
                return Err(WriteError::IsStdout(named(option, path)));
            }
            Place::File { .. } => {}
            Place::Stdout | Place::Stream(_) => {
                self.data_on_stdout |= stdout.as_ref() == Some(&identity);
            }
        }
        self.take(option, path, identity)
    }

    /// Checks that files can be written into the folder, which may be missing, and that it is not
    /// that of another option.
    ///
    /// # Errors
    /// The first violation.
    pub fn folder(&mut self, option: &str, path: &Path) -> Result<(), WriteError> {
        let identity = place::folder(path).map_err(|error| unwritten(path, error))?;
        self.take(option, path, identity)
    }

    /// Whether one of the outputs is standard output, so that messages must not be written to it.
    pub fn data_on_stdout(&self) -> bool {
        self.data_on_stdout
    }

    fn take(&mut self, option: &str, path: &Path, identity: Identity) -> Result<(), WriteError> {
        let second = named(option, path);
        if let Some((first, _)) = self.taken.iter().find(|(_, taken)| *taken == identity) {
            let first = first.clone();
            return Err(WriteError::Twice { first, second });
        }
        self.taken.push((second, identity));
        Ok(())
    }
}

/// The place of a file that may be written.
fn checked(path: &Path, force: bool) -> Result<Place, WriteError> {
    let place = Place::of(path).map_err(|error| unwritten(path, error))?;
    match place {
        Place::File { exists: true, .. } if !force => Err(WriteError::Exists(path.into())),
        _ => Ok(place),
    }
}

fn named(option: &str, path: &Path) -> String {
    format!("{option} {}", path.display())
}

fn unwritten(path: &Path, error: impl Into<ContentError>) -> WriteError {
    let output = if path == Path::new(place::STDOUT) {
        "to standard output".into()
    } else {
        path.display().to_string()
    };
    let source = error.into();
    WriteError::Output { output, source }
}

/// Whether the path is, or will be, that of a regular file.
pub fn is_file(path: &Path) -> bool {
    matches!(Place::of(path), Ok(Place::File { .. }))
}

/// Creates a folder for outputs and its parents, unless it exists.
///
/// # Errors
/// If it cannot be created.
pub fn make_folder(path: &Path) -> Result<(), WriteError> {
    let path = path.to_owned();
    fs::create_dir_all(&path).map_err(|source| WriteError::Folder { path, source })
}

/// Writes an output. With `force`, an existing file is overwritten.
///
/// # Errors
/// If it has no valid destination, `content` fails, or it cannot be written completely.
pub fn write(
    path: &Path,
    force: bool,
    content: impl FnOnce(&mut Writer) -> Result<(), ContentError>,
) -> Result<(), WriteError> {
    let place = checked(path, force)?;
    let attempt = || -> Result<(), ContentError> {
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
    attempt().map_err(|error| unwritten(path, error))
}

/// Writes a text.
///
/// # Errors
/// As [`write()`].
pub fn write_text(path: &Path, text: &str, force: bool) -> Result<(), WriteError> {
    write(path, force, |to| Ok(to.write_all(text.as_bytes())?))
}

/// Writes results as JSON.
///
/// # Errors
/// As [`write()`].
pub fn write_json(path: &Path, results: &impl Serialize, force: bool) -> Result<(), WriteError> {
    write(path, force, |to| {
        serde_json::to_writer_pretty(&mut *to, results)?;
        Ok(to.write_all(b"\n")?)
    })
}

/// Writes rows as CSV, with the field names as column names.
///
/// # Errors
/// As [`write()`].
pub fn write_rows(
    path: &Path,
    rows: impl IntoIterator<Item = impl Serialize>,
    force: bool,
) -> Result<(), WriteError> {
    let rows = rows.into_iter().map(Ok::<_, Infallible>);
    write_fallible_rows(path, rows, force)
}

/// Writes rows that are produced one at a time as CSV, as [`write_rows`].
///
/// # Errors
/// As [`write()`]; the content fails at the first row that is an error.
pub fn write_fallible_rows(
    path: &Path,
    rows: impl IntoIterator<Item = Result<impl Serialize, impl Into<ContentError>>>,
    force: bool,
) -> Result<(), WriteError> {
    write(path, force, |to| {
        let mut csv = csv::Writer::from_writer(to);
        for row in rows {
            csv.serialize(row.map_err(Into::into)?)?;
        }
        Ok(csv.flush()?)
    })
}

#[cfg(test)]
mod tests;
