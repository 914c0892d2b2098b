//! The emulator's process and its children: they are ended together, and their pipes end with the
//! emulator.
//!
//! The program called `qemu-system-arm` may be a wrapper whose child is the emulator, or leave a
//! process behind that keeps its pipes open. It is therefore in a separate process group, which is
//! killed as a whole, and its pipes end when it ends. The group does not receive the terminal's
//! Ctrl-C; waiting functions here read the flag that Ctrl-C sets.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
use std::io::{self, Read};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Interval at which a reader checks whether the emulator has ended.
const POLL: Duration = Duration::from_millis(20);

/// A running emulator, ended when dropped.
pub(crate) struct Emulator {
    child: Child,
    group: Pid,
    status: Option<ExitStatus>,
    ended: Arc<AtomicBool>,
}

impl Emulator {
    /// Starts the emulator in a separate process group. Its standard output and error must be
    /// pipes.
    pub(crate) fn spawn(command: &mut Command) -> io::Result<Self> {
        command.process_group(0);
        end_with_parent(command);
        let child = command.spawn()?;
        Ok(Self {
            group: Pid::from_child(&child),
            child,
            status: None,
            ended: Arc::default(),
        })
    }

    /// Its standard output; can be taken once.
    pub(crate) fn output(&mut self) -> Pipe<ChildStdout> {
        self.pipe(|child| child.stdout.take())
    }

    /// Its standard error; can be taken once.
    pub(crate) fn errors(&mut self) -> Pipe<ChildStderr> {
        self.pipe(|child| child.stderr.take())
    }

    fn pipe<P>(&mut self, take: impl Fn(&mut Child) -> Option<P>) -> Pipe<P> {
        Pipe {
            pipe: take(&mut self.child).expect("it is piped, and taken once"),
            ended: Arc::clone(&self.ended),
            left: None,
        }
    }

    /// The emulator's status if it has ended; its remaining children are then ended too.
    pub(crate) fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            let only_look = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
            if waitid(WaitId::Pid(self.group), only_look)?.is_some() {
                self.end()?;
            }
        }
        Ok(self.status)
    }

    fn end(&mut self) -> io::Result<()> {
        // Before waiting for the child, so that no other group can have its number. Fails if all
        // have already ended.
        let _ = kill_process_group(self.group, Signal::KILL);
        self.status = Some(self.child.wait()?);
        self.ended.store(true, Ordering::Release);
        Ok(())
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        if self.status.is_none() {
            // A failure cannot be handled any further.
            let _ = self.end();
        }
    }
}

/// Makes the kernel end the emulator if this program is killed, when no destructor runs.
fn end_with_parent(command: &mut Command) {
    // SAFETY: between fork and exec only async-signal-safe calls are allowed, and prctl is one.
    unsafe {
        command.pre_exec(|| {
            let signal = Some(Signal::KILL);
            Ok(rustix::process::set_parent_process_death_signal(signal)?)
        });
    }
}

/// A pipe from the emulator. It ends with the emulator, after its remaining content, even if
/// another process holds its other end.
pub(crate) struct Pipe<P> {
    pipe: P,
    ended: Arc<AtomicBool>,
    /// Remaining bytes after the emulator has ended.
    left: Option<usize>,
}

impl<P: Read + AsFd> Read for Pipe<P> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if self.left.is_none() && self.ended.load(Ordering::Acquire) {
                self.left = Some(rustix::io::ioctl_fionread(&self.pipe)? as usize);
            }
            match self.left {
                Some(left) => {
                    let most = left.min(buffer.len());
                    let length = self.pipe.read(&mut buffer[..most])?;
                    self.left = Some(left - length);
                    return Ok(length);
                }
                None if is_ready(&self.pipe, PollFlags::IN, POLL)? => {
                    return self.pipe.read(buffer);
                }
                None => {}
            }
        }
    }
}

/// Waits at most `limit` until a file can be read or written without waiting; a signal may end the
/// wait sooner.
pub(crate) fn is_ready(file: &impl AsFd, flags: PollFlags, limit: Duration) -> io::Result<bool> {
    let limit = Timespec {
        tv_sec: limit.as_secs() as i64,
        tv_nsec: limit.subsec_nanos().into(),
    };
    match poll(&mut [PollFd::new(file, flags)], Some(&limit)) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// Reads a stream to its end and returns its first bytes as text: the message of a program that
/// fails.
pub(crate) fn first_words(mut stream: impl Read) -> String {
    /// Maximum number of bytes stored.
    const KEPT: usize = 16 * 1024;
    let mut kept = Vec::new();
    let mut buffer = [0; 4096];
    // After an error, the bytes read so far are returned.
    while let Ok(length @ 1..) = stream.read(&mut buffer) {
        let room = KEPT - kept.len();
        kept.extend_from_slice(&buffer[..length.min(room)]);
    }
    String::from_utf8_lossy(&kept).trim().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Stdio;
    use std::time::Instant;

    fn shell(script: &str) -> Emulator {
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Emulator::spawn(&mut command).expect("there is a shell")
    }

    fn wait(emulator: &mut Emulator) -> ExitStatus {
        loop {
            if let Some(status) = emulator.try_wait().expect("it is a child") {
                return status;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn what_was_written_is_read_to_the_last_byte() {
        let mut emulator = shell("head -c 50000 /dev/zero; exit 3");
        let mut output = emulator.output();
        assert_eq!(wait(&mut emulator).code(), Some(3));
        let mut bytes = Vec::new();
        output.read_to_end(&mut bytes).expect("a pipe can be read");
        assert_eq!(bytes.len(), 50_000);
    }

    /// A process in a separate session is not in the killed group, and holds the pipe for a minute.
    #[test]
    fn a_pipe_ends_with_the_emulator_whoever_holds_it() {
        let start = Instant::now();
        let mut emulator = shell("setsid sleep 60 & echo here; exit 0");
        let mut output = emulator.output();
        wait(&mut emulator);
        let mut text = String::new();
        output
            .read_to_string(&mut text)
            .expect("a pipe can be read");
        assert_eq!(text, "here\n");
        assert!(start.elapsed() < Duration::from_secs(30));
    }
}
