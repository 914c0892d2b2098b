//! Pipes to the emulator, with a limit to every wait.

use crate::emulator::is_ready;
use crate::run::RunError;
use rustix::event::PollFlags;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest wait between two checks for an interruption.
const LOOK: Duration = Duration::from_millis(100);

/// Makes a named pipe.
pub(crate) fn make_pipe(path: &Path) -> Result<(), RunError> {
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0)
        .map_err(|error| RunError::NotStarted(error.into()))
}

/// Opens one end of a named pipe without waiting for the other.
pub(crate) fn open_without_waiting(path: &Path, read: bool) -> std::io::Result<File> {
    OpenOptions::new()
        .read(read)
        .write(!read)
        .custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32)
        .open(path)
}

/// Fills `bytes`, waiting at most `limit` for each part, because a faulty ECU may stop in the
/// middle of a packet.
pub(crate) fn read_exact(
    file: &mut File,
    limit: Duration,
    mut bytes: &mut [u8],
) -> std::io::Result<()> {
    while !bytes.is_empty() {
        let length = read_some(file, limit, bytes)?;
        bytes = &mut bytes[length..];
    }
    Ok(())
}

/// Reads at least one byte into `bytes`, waiting at most `limit`.
pub(crate) fn read_some(
    file: &mut File,
    limit: Duration,
    bytes: &mut [u8],
) -> std::io::Result<usize> {
    wait_until_ready(file, PollFlags::IN, limit)?;
    match file.read(bytes)? {
        0 => Err(ErrorKind::UnexpectedEof.into()),
        length => Ok(length),
    }
}

/// Writes all bytes, waiting at most `limit` for room each time.
pub(crate) fn write_all(file: &mut File, limit: Duration, mut bytes: &[u8]) -> std::io::Result<()> {
    while !bytes.is_empty() {
        match file.write(bytes) {
            Ok(length) => bytes = &bytes[length..],
            // The pipe is full if the emulator reads nothing.
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                wait_until_ready(file, PollFlags::OUT, limit)?;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Waits at most `limit`, or until the user interrupts.
fn wait_until_ready(file: &File, flags: PollFlags, limit: Duration) -> std::io::Result<()> {
    // The clock is read only if the answer is not immediate.
    if is_ready(file, flags, limit.min(LOOK))? {
        return Ok(());
    }
    let start = Instant::now();
    let limit = limit.saturating_sub(LOOK);
    loop {
        if interrupt::requested() {
            return Err(ErrorKind::Interrupted.into());
        }
        let left = limit.saturating_sub(start.elapsed());
        if is_ready(file, flags, left.min(LOOK))? {
            return Ok(());
        }
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_model::exchange::TO_HOST_LEN;
    use std::os::fd::OwnedFd;

    #[test]
    fn half_a_packet_ends_with_the_limit_and_a_closed_link_at_once() {
        let (ours, mut theirs) = std::io::pipe().expect("a pipe can be made");
        let mut ours = File::from(OwnedFd::from(ours));
        let mut read = || {
            let mut bytes = [0; TO_HOST_LEN];
            read_exact(&mut ours, Duration::from_millis(20), &mut bytes)
                .map_err(|error| error.kind())
        };
        theirs.write_all(&[0; TO_HOST_LEN]).expect("it takes them");
        assert_eq!(read(), Ok(()));
        theirs.write_all(&[0; 2]).expect("it takes them");
        assert_eq!(read(), Err(ErrorKind::TimedOut));
        drop(theirs);
        assert_eq!(read(), Err(ErrorKind::UnexpectedEof));
    }
}
