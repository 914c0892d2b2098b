//! Destination of the bytes of a path.

use rustix::fs::{Access, OFlags, access, major, minor};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// The name of standard output.
pub(crate) const STDOUT: &str = "-";

/// Maximum number of links followed, as in the kernel.
const MOST_LINKS: usize = 40;

/// Device numbers of `/dev/null` in Linux, which any number of outputs may share.
const NULL_DEVICE: (u32, u32) = (1, 3);

/// The reason why a path cannot be written.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each message is its description")]
pub enum Unwritable {
    #[error("it is a folder; give the name of a file")]
    Folder,
    #[error("it is a socket or a block device; give a file, a pipe or a character device")]
    SocketOrBlockDevice,
    #[error(
        "the file has {0} names (hard links), and only one of them would be written; delete this name first or give another"
    )]
    HardLinks(u64),
    #[error("too many symbolic links, which may be a loop")]
    TooManyLinks,
    #[error("{} is a symbolic link to nothing", .0.display())]
    DanglingLink(PathBuf),
    #[error("a folder cannot be standard output; give ./- for a folder of this name")]
    FolderOnStdout,
    #[error("the folder {} does not exist; create it first", .0.display())]
    NoFolder(PathBuf),
    #[error("{} is not a folder", .0.display())]
    NotAFolder(PathBuf),
    #[error("the name is empty")]
    EmptyName,
    #[error("it is the name of a folder; give the name of a file")]
    NamesAFolder,
    #[error("descriptor {} is not open", .0.display())]
    ClosedDescriptor(OsString),
    #[error("descriptor {} is open for reading only", .0.display())]
    ReadOnlyDescriptor(OsString),
    #[error("{at}")]
    At { at: String, source: io::Error },
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Destination of the bytes of an output.
#[derive(Debug)]
pub enum Place {
    /// To standard output.
    Stdout,
    /// Into a pipe, a character device or an open descriptor.
    Stream(PathBuf),
    /// Nowhere.
    Null,
    /// To a regular file.
    File {
        /// Its path without links.
        path: PathBuf,
        /// Metadata of an existing file.
        earlier: Option<Metadata>,
        /// There is one, or a link to where it would be.
        exists: bool,
    },
}

/// Identity of a file, equal for all of its names: device and inode of the file, or of an existing
/// parent folder together with the rest of the name.
#[derive(Debug, PartialEq)]
pub struct Identity {
    node: (u64, u64),
    rest: OsString,
}

impl Identity {
    /// Identity of an existing file.
    pub fn of(metadata: &Metadata) -> Self {
        Self {
            node: (metadata.dev(), metadata.ino()),
            rest: OsString::new(),
        }
    }

    /// Identity of standard output, if it is open.
    pub(crate) fn of_stdout() -> Option<Self> {
        let metadata = stdout().and_then(|file| file.metadata());
        metadata.ok().map(|metadata| Self::of(&metadata))
    }
}

impl Place {
    /// Follows the path, and checks that its target can be written.
    pub fn of(path: &Path) -> Result<Self, Unwritable> {
        if path == Path::new(STDOUT) {
            check_descriptor(Path::new("/proc/self/fd"), OsStr::new("1"))?;
            return Ok(Self::Stdout);
        }
        let mut path = path.to_owned();
        for links in 0..MOST_LINKS {
            let (folder, name) = split(&path)?;
            if is_of_descriptors(&folder) {
                return Self::of_descriptor(&folder, &name);
            }
            let here = folder.join(name);
            match fs::symlink_metadata(&here) {
                Ok(metadata) if metadata.is_symlink() => path = folder.join(fs::read_link(&here)?),
                Ok(metadata) => return Self::of_node(here, metadata),
                Err(error) if error.kind() == ErrorKind::NotFound => {
                    check_writable(&folder)?;
                    return Ok(Self::File {
                        path: here,
                        earlier: None,
                        exists: links > 0,
                    });
                }
                Err(error) => return Err(error.into()),
            }
        }
        Err(Unwritable::TooManyLinks)
    }

    fn of_node(path: PathBuf, metadata: Metadata) -> Result<Self, Unwritable> {
        let kind = metadata.file_type();
        if kind.is_dir() {
            return Err(Unwritable::Folder);
        }
        if kind.is_socket() || kind.is_block_device() {
            return Err(Unwritable::SocketOrBlockDevice);
        }
        check_writable(&path)?;
        if !kind.is_file() {
            let device = (major(metadata.rdev()), minor(metadata.rdev()));
            let is_null = kind.is_char_device() && device == NULL_DEVICE;
            return Ok(if is_null {
                Self::Null
            } else {
                Self::Stream(path)
            });
        }
        if metadata.nlink() != 1 {
            return Err(Unwritable::HardLinks(metadata.nlink()));
        }
        check_writable(split(&path)?.0.as_path())?;
        Ok(Self::File {
            path,
            earlier: Some(metadata),
            exists: true,
        })
    }

    /// An open descriptor, which is written into even if it is that of a regular file, as its
    /// opener requested.
    fn of_descriptor(folder: &Path, name: &OsStr) -> Result<Self, Unwritable> {
        check_descriptor(folder, name)?;
        let path = folder.join(name);
        let own = fs::canonicalize("/proc/self/fd").is_ok_and(|own| own == folder);
        if own && name == "1" {
            return Ok(Self::Stdout);
        }
        let metadata = fs::metadata(&path)?;
        if metadata.is_file() {
            return Ok(Self::Stream(path));
        }
        Self::of_node(path, metadata)
    }

    /// Its identity, equal for all names of the same file.
    pub fn identity(&self) -> Result<Identity, Unwritable> {
        let metadata = match self {
            Self::Stdout => stdout()?.metadata()?,
            Self::Stream(path) => fs::metadata(path)?,
            Self::Null => fs::metadata("/dev/null")?,
            Self::File {
                earlier: Some(earlier),
                ..
            } => earlier.clone(),
            Self::File { path, .. } => {
                let (folder, rest) = split(path)?;
                return Ok(Identity {
                    node: Identity::of(&fs::metadata(folder)?).node,
                    rest,
                });
            }
        };
        Ok(Identity::of(&metadata))
    }
}

/// Standard output as a file: without the buffer that ends lines, and with errors.
pub fn stdout() -> io::Result<File> {
    let own = io::stdout().as_fd().try_clone_to_owned()?;
    Ok(own.into())
}

/// Opens a descriptor, or a destination that is not a regular file, for writing.
pub(crate) fn open_stream(path: &Path) -> io::Result<File> {
    // A terminal must not become the controlling terminal, and the content of a descriptor's file
    // is kept.
    let flags = OFlags::NOCTTY | OFlags::APPEND;
    OpenOptions::new()
        .append(true)
        .custom_flags(flags.bits() as i32)
        .open(path)
}

/// Checks that files can be written into a folder, which may be missing. Returns its identity.
pub fn folder(path: &Path) -> Result<Identity, Unwritable> {
    if path == Path::new(STDOUT) {
        return Err(Unwritable::FolderOnStdout);
    }
    let mut there = path;
    let metadata = loop {
        let or_here = if there == Path::new("") {
            Path::new(".")
        } else {
            there
        };
        match fs::metadata(or_here) {
            Ok(metadata) => break metadata,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                if fs::symlink_metadata(or_here).is_ok() {
                    return Err(Unwritable::DanglingLink(there.into()));
                }
                there = there.parent().unwrap_or(Path::new("/"));
            }
            Err(error) => return Err(at(there.display(), error)),
        }
    };
    if !metadata.is_dir() {
        return Err(Unwritable::NotAFolder(there.into()));
    }
    check_writable(if there == Path::new("") {
        Path::new(".")
    } else {
        there
    })?;
    let rest = path.strip_prefix(there).unwrap_or(Path::new(""));
    Ok(Identity {
        node: Identity::of(&metadata).node,
        rest: rest.into(),
    })
}

/// The folder of a path, without links, and its last name.
fn split(path: &Path) -> Result<(PathBuf, OsString), Unwritable> {
    if path == Path::new("") {
        return Err(Unwritable::EmptyName);
    }
    let bytes = path.as_os_str().as_encoded_bytes();
    let name = path
        .file_name()
        .filter(|_| !bytes.ends_with(b"/") && !bytes.ends_with(b"/."));
    let name = name.ok_or(Unwritable::NamesAFolder)?;
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let real = fs::canonicalize(folder).map_err(|error| match error.kind() {
        ErrorKind::NotFound => Unwritable::NoFolder(folder.into()),
        ErrorKind::NotADirectory => Unwritable::NotAFolder(folder.into()),
        _ => at(folder.display(), error),
    })?;
    if !real.is_dir() {
        return Err(Unwritable::NotAFolder(folder.into()));
    }
    Ok((real, name.to_owned()))
}

fn check_writable(path: &Path) -> Result<(), Unwritable> {
    let is_folder = path.is_dir();
    let wanted = if is_folder {
        Access::WRITE_OK | Access::EXEC_OK
    } else {
        Access::WRITE_OK
    };
    let what = if is_folder { "the folder" } else { "" };
    access(path, wanted)
        .map_err(|error| at(format!("{what} {}", path.display()).trim(), error.into()))
}

fn at(place: impl ToString, source: io::Error) -> Unwritable {
    let at = place.to_string();
    Unwritable::At { at, source }
}

/// `/proc/N/fd`, the folder of a process's open descriptors.
fn is_of_descriptors(folder: &Path) -> bool {
    folder.starts_with("/proc") && folder.ends_with("fd")
}

/// Rejects a descriptor that is not open for writing.
fn check_descriptor(folder: &Path, name: &OsStr) -> Result<(), Unwritable> {
    let path = folder.join(name);
    if fs::metadata(&path).is_err() {
        return Err(Unwritable::ClosedDescriptor(name.into()));
    }
    let info = fs::read_to_string(folder.with_file_name("fdinfo").join(name)).unwrap_or_default();
    let flags = info.lines().find_map(|line| line.strip_prefix("flags:"));
    let flags = flags.and_then(|octal| u32::from_str_radix(octal.trim(), 8).ok());
    let writes = OFlags::WRONLY | OFlags::RDWR;
    if flags.is_some_and(|flags| !OFlags::from_bits_retain(flags).intersects(writes)) {
        return Err(Unwritable::ReadOnlyDescriptor(name.into()));
    }
    Ok(())
}
