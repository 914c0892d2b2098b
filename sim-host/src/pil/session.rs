//! The ECU in the emulator, one exchange a PWM period: how a host stands in for its servo and sensors.

use crate::pil::elf::Image;
use crate::pil::log::LogDecoder;
use crate::pil::qemu::{self, Emulator, Machine, RunError};
use shared_model::exchange::{TO_HOST_LEN, ToEcu, ToHost};
use shared_model::serial::{self, Deframer, Received};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Names of the pipes in the working directory, as the firmware has them.
const TO_HOST: &str = "to-host";
const TO_ECU: &str = "to-ecu";
const UART_SOCKET: &str = "uart";
const POLL: Duration = Duration::from_millis(2);

/// What carries the exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LinkKind {
    /// Pipes, read and written by the emulator; the host says when a PWM period begins: fast.
    Files,
    /// The same, but the board's timer says when a PWM period begins, and the gate measures the time between control ticks.
    Timed,
    /// The board's UART, framed, at the host's pace: realistic and slow.
    Uart,
}

impl LinkKind {
    fn setting(self) -> &'static str {
        match self {
            Self::Files => "link=files",
            Self::Timed => "link=timed",
            Self::Uart => "link=uart",
        }
    }
}

enum Transport {
    Files {
        from_ecu: File,
        to_ecu: File,
    },
    Uart {
        stream: UnixStream,
        deframer: Deframer,
    },
}

/// An ECU in the emulator that waits for its vehicle. The emulator ends when this is dropped.
pub struct Session {
    transport: Transport,
    emulator: Emulator,
    log: Option<JoinHandle<Vec<String>>>,
    last_line: Arc<Mutex<String>>,
    limit: Duration,
    _directory: tempfile::TempDir,
}

/// How a session ended.
#[derive(Debug, Clone)]
pub struct Ended {
    /// The firmware's exit code.
    pub exit_code: i32,
    /// Its log.
    pub log: Vec<String>,
}

impl Session {
    /// Starts the image with the scenario's settings and opens the link; waits at most `limit` for each answer.
    ///
    /// # Errors
    /// If the emulator is missing or fails, or the firmware does not open its end.
    pub fn start(
        image: &Image,
        machine: Machine,
        settings: &[String],
        link: LinkKind,
        options: &[&str],
        limit: Duration,
    ) -> Result<Self, RunError> {
        let directory = tempfile::tempdir().map_err(RunError::NotStarted)?;
        let decoder = LogDecoder::new(image).map_err(RunError::Log)?;
        let mut settings = settings.to_vec();
        settings.push(link.setting().into());
        let socket = directory.path().join(UART_SOCKET);
        let line = format!("unix:{},server=on,wait=on", socket.display());
        let serial = match link {
            LinkKind::Files | LinkKind::Timed => qemu::SILENT.to_vec(),
            LinkKind::Uart => machine.serial_options(&line),
        };
        let waiting = prepare(link, directory.path())?;
        let options = [&serial, options].concat();
        let mut emulator = qemu::start(image, machine, &settings, directory.path(), &options)?;
        let console = emulator.0.stdout.take().expect("stdout is piped");
        let last_line = Arc::new(Mutex::new(String::from("(none)")));
        let seen = Arc::clone(&last_line);
        let log = thread::spawn(move || {
            let mut lines = Vec::new();
            decoder.decode(console, |line| {
                *seen.lock().expect("nobody panics with it") = line.to_owned();
                lines.push(line.to_owned());
            });
            lines
        });
        let mut session = Opening {
            emulator: &mut emulator,
            last_line: &last_line,
            start: Instant::now(),
            limit,
        };
        let transport = session.open(waiting)?;
        Ok(Self {
            transport,
            emulator,
            log: Some(log),
            last_line,
            limit,
            _directory: directory,
        })
    }

    /// What the ECU puts out in its next PWM period. It then waits for [`send`](Self::send).
    ///
    /// # Errors
    /// If the emulator has ended, or nothing comes within the limit.
    pub fn receive(&mut self) -> Result<ToHost, RunError> {
        let mut bytes = [0; TO_HOST_LEN];
        let received = match &mut self.transport {
            Transport::Files { from_ecu, .. } => read_exact(from_ecu, self.limit, &mut bytes),
            Transport::Uart { stream, deframer } => receive_packet(stream, deframer, &mut bytes),
        };
        match received {
            Ok(()) => Ok(ToHost::decode(&bytes)),
            Err(error) => Err(self.lost(error)),
        }
    }

    /// Answers what was received.
    ///
    /// # Errors
    /// If the emulator has ended.
    pub fn send(&mut self, answer: &ToEcu) -> Result<(), RunError> {
        let bytes = answer.encode();
        let sent = match &mut self.transport {
            Transport::Files { to_ecu, .. } => to_ecu.write_all(&bytes),
            Transport::Uart { stream, .. } => {
                let mut packet = Vec::with_capacity(bytes.len() + 4);
                serial::frame(&bytes, |byte| packet.push(byte));
                stream.write_all(&packet)
            }
        };
        sent.map_err(|error| self.lost(error))
    }

    fn lost(&mut self, error: std::io::Error) -> RunError {
        let last_line = self
            .last_line
            .lock()
            .expect("nobody panics with it")
            .clone();
        if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) {
            return RunError::TimedOut {
                limit: self.limit,
                last_line,
            };
        }
        let status = self.emulator.0.wait().ok();
        RunError::LinkLost {
            exit_code: status.and_then(|status| status.code()),
            last_line,
        }
    }

    /// Waits for the firmware to end, which it does once it was told to stop.
    ///
    /// # Errors
    /// If it does not end within the limit.
    pub fn finish(mut self) -> Result<Ended, RunError> {
        let status = qemu::wait(&mut self.emulator.0, self.limit)?;
        let Some(status) = status else {
            let last_line = self
                .last_line
                .lock()
                .expect("nobody panics with it")
                .clone();
            return Err(RunError::TimedOut {
                limit: self.limit,
                last_line,
            });
        };
        let log = self.log.take().and_then(|log| log.join().ok());
        Ok(Ended {
            exit_code: status.code().unwrap_or(-1),
            log: log.unwrap_or_default(),
        })
    }
}

/// What has to be there before the emulator starts.
enum Waiting {
    Files { from_ecu: File, to_ecu: PathBuf },
    Uart { socket: PathBuf },
}

fn prepare(link: LinkKind, directory: &Path) -> Result<Waiting, RunError> {
    match link {
        LinkKind::Files | LinkKind::Timed => {
            for name in [TO_HOST, TO_ECU] {
                make_pipe(&directory.join(name))?;
            }
            // Opened without waiting for the other end, which the emulator opens later.
            let from_ecu = OpenOptions::new()
                .read(true)
                .custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32)
                .open(directory.join(TO_HOST))
                .map_err(RunError::NotStarted)?;
            Ok(Waiting::Files {
                from_ecu,
                to_ecu: directory.join(TO_ECU),
            })
        }
        LinkKind::Uart => Ok(Waiting::Uart {
            socket: directory.join(UART_SOCKET),
        }),
    }
}

fn make_pipe(path: &Path) -> Result<(), RunError> {
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0)
        .map_err(|error| RunError::NotStarted(error.into()))
}

/// The emulator has been started and opens its end of the link.
struct Opening<'a> {
    emulator: &'a mut Emulator,
    last_line: &'a Mutex<String>,
    start: Instant,
    limit: Duration,
}

impl Opening<'_> {
    fn open(&mut self, waiting: Waiting) -> Result<Transport, RunError> {
        match waiting {
            Waiting::Files { from_ecu, to_ecu } => {
                let to_ecu = self.retry(|| {
                    OpenOptions::new()
                        .write(true)
                        .custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32)
                        .open(&to_ecu)
                })?;
                for end in [&from_ecu, &to_ecu] {
                    rustix::fs::fcntl_setfl(end, rustix::fs::OFlags::empty())
                        .map_err(|error| RunError::NotStarted(error.into()))?;
                }
                Ok(Transport::Files { from_ecu, to_ecu })
            }
            Waiting::Uart { socket } => {
                let stream = self.retry(|| UnixStream::connect(&socket))?;
                stream
                    .set_read_timeout(Some(self.limit))
                    .map_err(RunError::NotStarted)?;
                Ok(Transport::Uart {
                    stream,
                    deframer: Deframer::new(),
                })
            }
        }
    }

    /// Tries until the emulator has opened its end.
    fn retry<T>(&mut self, open: impl Fn() -> std::io::Result<T>) -> Result<T, RunError> {
        loop {
            if let Ok(opened) = open() {
                return Ok(opened);
            }
            let ended = self.emulator.0.try_wait().map_err(RunError::NotStarted)?;
            let last_line = || {
                self.last_line
                    .lock()
                    .expect("nobody panics with it")
                    .clone()
            };
            if let Some(status) = ended {
                // The log's reader may be a moment behind.
                thread::sleep(10 * POLL);
                return Err(RunError::LinkLost {
                    exit_code: status.code(),
                    last_line: last_line(),
                });
            }
            if self.start.elapsed() > self.limit {
                return Err(RunError::TimedOut {
                    limit: self.limit,
                    last_line: last_line(),
                });
            }
            thread::sleep(POLL);
        }
    }
}

/// Fills `bytes`, waiting at most `limit` for each piece: a faulty ECU may stop in the middle of a packet.
fn read_exact(file: &mut File, limit: Duration, mut bytes: &mut [u8]) -> std::io::Result<()> {
    while !bytes.is_empty() {
        wait_readable(file, limit)?;
        match file.read(bytes)? {
            0 => return Err(ErrorKind::UnexpectedEof.into()),
            length => bytes = &mut bytes[length..],
        }
    }
    Ok(())
}

fn wait_readable(file: &File, limit: Duration) -> std::io::Result<()> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let limit = Timespec {
        tv_sec: limit.as_secs() as i64,
        tv_nsec: limit.subsec_nanos().into(),
    };
    let mut polled = [PollFd::new(file, PollFlags::IN)];
    match poll(&mut polled, Some(&limit))? {
        0 => Err(ErrorKind::TimedOut.into()),
        _ => Ok(()),
    }
}

fn receive_packet(
    stream: &mut UnixStream,
    deframer: &mut Deframer,
    bytes: &mut [u8; TO_HOST_LEN],
) -> std::io::Result<()> {
    let mut buffer = [0; 64];
    loop {
        // The ECU sends nothing behind its packet until it is answered, so nothing is read past it.
        let length = stream.read(&mut buffer)?;
        if length == 0 {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        for &byte in &buffer[..length] {
            match deframer.push(byte) {
                Received::Nothing => {}
                Received::Damaged => return Err(ErrorKind::InvalidData.into()),
                Received::Body(body) => {
                    let body = body.try_into().map_err(|_| ErrorKind::InvalidData)?;
                    *bytes = body;
                    return Ok(());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
