//! The writer over all kinds of destinations.

use super::*;
use std::io::Read;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::process::Command;
use tempfile::{TempDir, tempdir};

/// An error and its causes, in one line.
fn chain(mut error: &dyn Error) -> String {
    let mut text = error.to_string();
    while let Some(source) = error.source() {
        text += &format!(": {source}");
        error = source;
    }
    text
}

const OLD: &str = "old";
const NEW: &str = "new";

/// What is to happen at a destination, without force and with it.
struct Case {
    name: &'static str,
    make: fn(&Path),
    without_force: Result<(), &'static str>,
    with_force: Result<(), &'static str>,
}

fn file(at: &Path) {
    fs::write(at.join("d"), OLD).unwrap();
}

const fn refused(name: &'static str, make: fn(&Path), part: &'static str) -> Case {
    Case {
        name,
        make,
        without_force: Err(part),
        with_force: Err(part),
    }
}

const fn needs_force(name: &'static str, make: fn(&Path)) -> Case {
    Case {
        name,
        make,
        without_force: Err("exists; give --force"),
        with_force: Ok(()),
    }
}

/// The destination is `d` but where a name says otherwise.
const CASES: [Case; 19] = [
    Case {
        name: "d",
        make: |_| (),
        without_force: Ok(()),
        with_force: Ok(()),
    },
    needs_force("d", file),
    needs_force("./d", file),
    needs_force("d", |at| {
        file(at);
        fs::set_permissions(at.join("d"), fs::Permissions::from_mode(0o640)).unwrap();
    }),
    needs_force("link", |at| {
        file(at);
        symlink("d", at.join("link")).unwrap();
    }),
    needs_force("link", |at| symlink("d", at.join("link")).unwrap()),
    needs_force("link", |at| {
        symlink("second", at.join("link")).unwrap();
        symlink(at.join("d"), at.join("second")).unwrap();
    }),
    refused(
        "link",
        |at| symlink("none/d", at.join("link")).unwrap(),
        "does not exist; create it first",
    ),
    refused(
        "link",
        |at| symlink("link", at.join("link")).unwrap(),
        "may be a loop",
    ),
    refused(
        "d",
        |at| {
            file(at);
            fs::hard_link(at.join("d"), at.join("other")).unwrap();
        },
        "2 names (hard links)",
    ),
    refused(
        "d",
        |at| fs::create_dir(at.join("d")).unwrap(),
        "it is a folder",
    ),
    refused(
        "d",
        |at| drop(UnixListener::bind(at.join("d")).unwrap()),
        "it is a socket",
    ),
    refused("d/", |_| (), "it is the name of a folder"),
    refused("d/.", |_| (), "it is the name of a folder"),
    refused("..", |_| (), "it is the name of a folder"),
    refused("", |_| (), "the name is empty"),
    refused("none/d", |_| (), "does not exist; create it first"),
    refused("d/x", file, "is not a folder"),
    refused("d/x/y", file, "is not a folder"),
];

/// What is seen of a file.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Seen {
    path: PathBuf,
    link: Option<PathBuf>,
    mode: u32,
    content: Option<Vec<u8>>,
}

/// Everything in a folder.
fn everything(at: &Path) -> Vec<Seen> {
    let seen = |entry: std::io::Result<fs::DirEntry>| {
        let path = entry.unwrap().path();
        let metadata = fs::symlink_metadata(&path).unwrap();
        Seen {
            link: fs::read_link(&path).ok(),
            mode: metadata.permissions().mode(),
            content: metadata.is_file().then(|| fs::read(&path).unwrap()),
            path,
        }
    };
    let mut all: Vec<_> = fs::read_dir(at).unwrap().map(seen).collect();
    all.sort();
    all
}

fn made(case: &Case) -> (TempDir, PathBuf) {
    let at = tempdir().unwrap();
    (case.make)(at.path());
    // Joined as text, so that what ends the name stays.
    let path = match case.name {
        "" => PathBuf::new(),
        name => format!("{}/{name}", at.path().display()).into(),
    };
    (at, path)
}

#[test]
fn each_kind_of_file_is_written_or_refused_and_then_unchanged() {
    for (n, case) in CASES.iter().enumerate() {
        for (force, expected) in [(false, case.without_force), (true, case.with_force)] {
            let (at, path) = made(case);
            let before = everything(at.path());
            let checked = Outputs::new(force).file("--out", &path);
            let written = write_text(&path, NEW, force);
            let context = format!("case {n}, {}, force {force}", case.name);
            match expected {
                Ok(()) => {
                    checked.and(written).expect(&context);
                    assert_eq!(fs::read_to_string(at.path().join("d")).unwrap(), NEW);
                    let was_there = |seen: &&Seen| before.iter().any(|b| b.path == seen.path);
                    let kept = |all: &[Seen]| -> Vec<_> {
                        let of_file =
                            |seen: &Seen| (seen.path.clone(), seen.link.clone(), seen.mode);
                        all.iter().filter(was_there).map(of_file).collect()
                    };
                    assert_eq!(kept(&everything(at.path())), kept(&before), "{context}");
                }
                Err(part) => {
                    for error in [checked.unwrap_err(), written.unwrap_err()] {
                        let error = chain(&error);
                        assert!(error.contains(part), "{context}: {error} lacks {part:?}");
                        assert!(
                            error.contains(&path.display().to_string()),
                            "{context}: {error}"
                        );
                        assert!(!error.contains(".sim-host-"), "{context}: {error}");
                    }
                    assert_eq!(everything(at.path()), before, "{context}");
                }
            }
        }
    }
}

#[test]
fn a_name_that_is_too_long_is_refused() {
    let at = tempdir().unwrap();
    let longest = at.path().join("x".repeat(255));
    write_text(&longest, NEW, false).unwrap();
    let error = Outputs::new(false).file("--out", &at.path().join("x".repeat(256)));
    assert!(chain(&error.unwrap_err()).contains("File name too long"));
}

/// Root may write anywhere, so that this shows something for others only.
#[test]
fn what_must_not_be_written_is_refused_before_the_work() {
    let at = tempdir().unwrap();
    let path = at.path().join("d");
    file(at.path());
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    if fs::OpenOptions::new().append(true).open(&path).is_ok() {
        return;
    }
    let error = Outputs::new(true).file("--out", &path).unwrap_err();
    assert!(chain(&error).contains("ermission denied"));
    fs::remove_file(&path).unwrap();
    fs::set_permissions(at.path(), fs::Permissions::from_mode(0o555)).unwrap();
    let error = Outputs::new(false).file("--out", &path).unwrap_err();
    assert!(chain(&error).contains("ermission denied"));
}

#[test]
fn a_failed_write_leaves_the_earlier_file_and_nothing_else() {
    let at = tempdir().unwrap();
    file(at.path());
    let before = everything(at.path());
    for name in ["d", "new"] {
        let path = at.path().join(name);
        let failed = write(&path, true, |to| {
            to.write_all(&[b'x'; 100_000])?;
            Err("no more".into())
        });
        assert!(chain(&failed.unwrap_err()).contains(name));
        assert_eq!(everything(at.path()), before);
    }
}

#[test]
fn a_pipe_is_written_into_without_force() {
    // A pipe each: a process that another test is about to start may hold an earlier reader for a
    // moment.
    for name in ["d", "link"] {
        let at = tempdir().unwrap();
        let path = at.path().join("d");
        let made = Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        symlink("d", at.path().join("link")).unwrap();
        let before = everything(at.path());
        Outputs::new(false)
            .file("--out", &at.path().join(name))
            .unwrap();
        let reader = std::thread::spawn(move || fs::read_to_string(path).unwrap());
        write_text(&at.path().join(name), NEW, false).unwrap();
        assert_eq!(reader.join().unwrap(), NEW);
        assert_eq!(everything(at.path()), before);
    }
}

/// A device's node that the test may lose; those of the system only for users who could not replace
/// them.
fn device(at: &Path, name: &str, minor: &str) -> PathBuf {
    let own = at.join(name);
    let made = Command::new("mknod")
        .arg(&own)
        .args(["c", "1", minor])
        .output();
    let usable = fs::OpenOptions::new().append(true).open(&own).is_ok();
    if made.is_ok_and(|made| made.status.success()) && usable {
        return own;
    }
    Path::new("/dev").join(name)
}

/// Without force and without a rename; on the full one with an error.
#[test]
fn devices_are_written_into() {
    let at = tempdir().unwrap();
    let link = at.path().join("link");
    symlink(device(at.path(), "full", "7"), &link).unwrap();
    let null = device(at.path(), "null", "3");
    let before = everything(at.path());
    let error = write_text(&link, NEW, false).unwrap_err();
    assert!(
        chain(&error).contains("No space left on device"),
        "{}",
        chain(&error)
    );
    let mut outputs = Outputs::new(false);
    for option in ["--out", "--json"] {
        outputs.file(option, &null).unwrap();
        write_text(&null, NEW, false).unwrap();
    }
    assert_eq!(everything(at.path()), before);
}

/// What a descriptor's file holds is neither replaced nor cut, as with `3>> file --out /dev/fd/3`.
#[test]
fn an_open_descriptor_is_written_into() {
    use std::os::fd::AsRawFd;
    let at = tempdir().unwrap();
    file(at.path());
    let path = at.path().join("d");
    let opened = fs::OpenOptions::new().append(true).open(&path).unwrap();
    for folder in [
        "/dev/fd",
        "/proc/self/fd",
        &format!("/proc/{}/fd", std::process::id()),
    ] {
        let name = PathBuf::from(format!("{folder}/{}", opened.as_raw_fd()));
        Outputs::new(false).file("--out", &name).unwrap();
        write_text(&name, NEW, false).unwrap();
    }
    assert_eq!(fs::read_to_string(&path).unwrap(), "oldnewnewnew");
    let read_only = File::open(&path).unwrap();
    let name = PathBuf::from(format!("/dev/fd/{}", read_only.as_raw_fd()));
    let error = Outputs::new(true).file("--out", &name).unwrap_err();
    assert!(
        chain(&error).contains("for reading only"),
        "{}",
        chain(&error)
    );
    let error = Outputs::new(true)
        .file("--out", Path::new("/dev/fd/9999"))
        .unwrap_err();
    assert!(chain(&error).contains("is not open"), "{}", chain(&error));

    let (mut from, to) = std::io::pipe().unwrap();
    let name = PathBuf::from(format!("/dev/fd/{}", to.as_raw_fd()));
    write_text(&name, NEW, false).unwrap();
    drop(to);
    let mut text = String::new();
    from.read_to_string(&mut text).unwrap();
    assert_eq!(text, NEW);
}

/// By whatever names, and whether it is there or not.
#[test]
fn two_options_cannot_have_the_same_file() {
    let at = tempdir().unwrap();
    let at = at.path();
    fs::create_dir(at.join("sub")).unwrap();
    fs::write(at.join("there"), OLD).unwrap();
    symlink("there", at.join("to-there")).unwrap();
    symlink("absent", at.join("to-absent")).unwrap();
    let file: fn(&mut Outputs, &Path) -> Result<(), WriteError> = |o, path| o.file("--json", path);
    let folder: fn(&mut Outputs, &Path) -> Result<(), WriteError> =
        |o, path| o.folder("--work", path);
    for (one, other, take) in [
        ("absent", "absent", file),
        ("absent", "./absent", file),
        ("absent", "sub/../absent", file),
        ("absent", "to-absent", file),
        ("there", "sub/../there", file),
        ("there", "to-there", file),
        ("absent", "absent", folder),
        ("absent", "absent/", folder),
    ] {
        let mut outputs = Outputs::new(true);
        outputs.file("--out", &at.join(one)).unwrap();
        let error = take(&mut outputs, &at.join(other)).unwrap_err();
        let error = chain(&error);
        assert!(
            error.contains("are the same file"),
            "{one} {other}: {error}"
        );
        take(&mut Outputs::new(true), &at.join("sub/free")).unwrap();
    }
    let mut outputs = Outputs::new(true);
    outputs.reads("--config", &at.join("to-there"));
    assert!(outputs.file("--out", &at.join("there")).is_err());
    outputs.file("--out", &at.join("absent")).unwrap();
}

#[test]
fn a_folder_is_one_that_can_be_made() {
    let at = tempdir().unwrap();
    let at = at.path();
    fs::write(at.join("d"), OLD).unwrap();
    symlink("none", at.join("link")).unwrap();
    let check = |name: &str| Outputs::new(false).folder("--out", &at.join(name));
    for name in ["", "new", "new/er/", "."] {
        check(name).unwrap();
    }
    for (name, part) in [
        ("d", "is not a folder"),
        ("d/x", "Not a directory"),
        ("link", "link to nothing"),
        ("link/x", "link to nothing"),
    ] {
        let error = chain(&check(name).unwrap_err());
        assert!(error.contains(part), "{name}: {error}");
    }
    make_folder(&at.join("new/er")).unwrap();
    assert!(at.join("new/er").is_dir());
}
