//! Files that are complete or not there.

use anyhow::Context;
use std::fs;
use std::io::Write;
use std::path::Path;

/// Writes a file under a temporary name beside its own and renames it: an interrupted write leaves
/// the earlier file, or none.
pub fn replace(path: &Path, content: &str) -> anyhow::Result<()> {
    let name = path.file_name().context("a file needs a name")?;
    let part = path.with_file_name(format!(
        ".{}.{}.part",
        name.to_string_lossy(),
        std::process::id()
    ));
    write_and_rename(&part, path, content)
        .inspect_err(|_| drop(fs::remove_file(&part)))
        .with_context(|| format!("cannot write {}", path.display()))
}

fn write_and_rename(part: &Path, path: &Path, content: &str) -> std::io::Result<()> {
    let mut file = fs::File::create(part)?;
    file.write_all(content.as_bytes())?;
    file.sync_all()?;
    fs::rename(part, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_and_leaves_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("file.txt");
        replace(&path, "first").unwrap();
        replace(&path, "second").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_names_the_file_and_leaves_no_part() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("taken");
        fs::create_dir(&path).unwrap();
        let error = replace(&path, "text").unwrap_err();
        assert!(format!("{error:#}").contains("taken"));
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
