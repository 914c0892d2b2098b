//! Input files, with a maximum length for each type.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Maximum length of a configuration, a manoeuvre or a record of work, bytes.
pub const TEXT_BYTES: u64 = 16 << 20;
/// Maximum length of a recording, bytes: telemetry of a day, or an hour in the loop.
pub const RECORDING_BYTES: u64 = 4 << 30;
/// Maximum length of a firmware image with all symbols, bytes.
pub const IMAGE_BYTES: u64 = 256 << 20;
/// Number of first bytes that identify the type of a file.
const START_BYTES: u64 = 64;

/// Reads a file of at most `most` bytes. If its first bytes are not of the expected type, only
/// these are read and returned, and the caller rejects them.
///
/// # Errors
/// If it cannot be read, or is longer.
pub fn read(path: &Path, most: u64, is_start: impl Fn(&[u8]) -> bool) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    if length > most {
        return Err(too_long(most));
    }
    let mut bytes = Vec::new();
    (&mut file).take(START_BYTES).read_to_end(&mut bytes)?;
    if is_start(&bytes) {
        // One byte more than allowed, because the length of a pipe or a device is unknown.
        file.take(most + 1 - bytes.len() as u64)
            .read_to_end(&mut bytes)?;
    }
    if bytes.len() as u64 > most {
        return Err(too_long(most));
    }
    Ok(bytes)
}

/// Reads at most `most` bytes of what is open already.
///
/// # Errors
/// If it cannot be read, or is longer.
pub fn read_rest(source: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // One byte more than allowed, because the length of a pipe or a device is unknown.
    source.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_long(most));
    }
    Ok(bytes)
}

/// Reads a text of at most `most` bytes.
///
/// # Errors
/// If it cannot be read, is longer, or is not UTF-8.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let bytes = read(path, most, |_| true)?;
    String::from_utf8(bytes)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no text"))
}

fn too_long(most: u64) -> io::Error {
    let fault = format!("it is longer than the {most} bytes that such a file can have");
    io::Error::new(io::ErrorKind::FileTooLarge, fault)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_read_than_may_be() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "abcde").unwrap();
        assert_eq!(read(&path, 5, |_| true).unwrap(), b"abcde");
        let kind = |result: io::Result<Vec<u8>>| result.unwrap_err().kind();
        assert_eq!(kind(read(&path, 4, |_| true)), io::ErrorKind::FileTooLarge);
        // A sparse file of a terabyte, and a device without an end.
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        assert_eq!(
            kind(read(&path, 1 << 30, |_| true)),
            io::ErrorKind::FileTooLarge
        );
        let endless = Path::new("/dev/zero");
        assert_eq!(
            kind(read(endless, 1000, |_| true)),
            io::ErrorKind::FileTooLarge
        );
        let start = read(endless, u64::MAX - 1, |bytes| bytes[0] == 1).unwrap();
        assert_eq!(start.len() as u64, START_BYTES);
    }
}
