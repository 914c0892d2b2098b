//! A file that is written aside and takes its name when it is complete.

use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, open};
use std::fs::{File, Metadata, Permissions};
use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use tempfile::{Builder, TempPath};

/// The mode that any new file asks for; the process's mask takes from it.
const NEW_FILE: u32 = 0o666;

/// A file in the making.
pub struct Aside {
    target: PathBuf,
    earlier: Option<Metadata>,
    /// Its name so far; none where the file system has files without one, which vanish with the
    /// process.
    name: Option<TempPath>,
}

impl Aside {
    /// Begins a file that is to be `target`, in place of the `earlier` one.
    pub fn begin(target: PathBuf, earlier: Option<Metadata>) -> io::Result<(File, Self)> {
        let (file, name) = match unnamed(folder(&target)) {
            Ok(file) => (file, None),
            Err(_) => {
                let (file, name) = named(folder(&target))?;
                (file, Some(name))
            }
        };
        let aside = Self {
            target,
            earlier,
            name,
        };
        Ok((file, aside))
    }

    /// The file is complete: it takes its name, and with `force` another's place.
    pub(crate) fn take_name(self, file: &File, force: bool) -> io::Result<()> {
        if let Some(earlier) = &self.earlier {
            // Only root can give a file away; otherwise the owner changes, as with any editor that
            // renames.
            let _ = fchown(file, Some(earlier.uid()), Some(earlier.gid()));
            file.set_permissions(earlier.permissions())?;
        }
        file.sync_all()?;
        let name = match self.name {
            Some(name) => name,
            None => link(file, folder(&self.target))?,
        };
        let done = if force {
            name.persist(&self.target)
        } else {
            name.persist_noclobber(&self.target)
        };
        done.map_err(|error| error.error)
    }
}

fn folder(target: &Path) -> &Path {
    target.parent().unwrap_or(Path::new("/"))
}

/// A file without a name.
fn unnamed(folder: &Path) -> io::Result<File> {
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = open(folder, flags, Mode::from_bits_truncate(NEW_FILE))?;
    Ok(file.into())
}

/// A file with a unique name in the folder.
fn named(folder: &Path) -> io::Result<(File, TempPath)> {
    let file = builder()
        .permissions(Permissions::from_mode(NEW_FILE))
        .tempfile_in(folder);
    Ok(file.map_err(without_name)?.into_parts())
}

/// Gives an unnamed file a unique name in the folder.
fn link(file: &File, folder: &Path) -> io::Result<TempPath> {
    let descriptor = format!("/proc/self/fd/{}", file.as_fd().as_raw_fd());
    let link = |name: &Path| {
        let follow = AtFlags::SYMLINK_FOLLOW;
        Ok(linkat(CWD, descriptor.as_str(), CWD, name, follow)?)
    };
    let linked = builder().make_in(folder, link).map_err(without_name)?;
    Ok(linked.into_temp_path())
}

fn builder() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(".sim-host-");
    builder
}

/// The error without the hidden file's name, which the user has not given.
fn without_name(error: io::Error) -> io::Error {
    error.kind().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Write;

    #[test]
    fn an_error_does_not_name_the_hidden_file() {
        let at = tempfile::tempdir().unwrap();
        let begun = Aside::begin(at.path().join("none/file"), None);
        let error = begun.err().expect("there is no folder").to_string();
        assert!(!error.contains(".sim-host-"), "{error}");
    }

    /// Both ways of writing aside end in the same file, and leave nothing when they are given up.
    #[test]
    fn with_and_without_a_name() {
        for by_name in [false, true] {
            let at = tempfile::tempdir().unwrap();
            let target = at.path().join("file");
            let begin = || {
                let (mut file, mut aside) = Aside::begin(target.clone(), None).unwrap();
                if by_name {
                    let (other, name) = named(at.path()).unwrap();
                    (file, aside.name) = (other, Some(name));
                }
                file.write_all(b"text").unwrap();
                (file, aside)
            };
            drop(begin());
            assert_eq!(fs::read_dir(at.path()).unwrap().count(), 0);
            let (file, aside) = begin();
            aside.take_name(&file, false).unwrap();
            assert_eq!(fs::read(&target).unwrap(), b"text");
            let (file, aside) = begin();
            let error = aside.take_name(&file, false).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
            assert_eq!(fs::read_dir(at.path()).unwrap().count(), 1);
        }
    }
}
