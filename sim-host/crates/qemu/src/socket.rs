//! A local socket of the emulator, with a time-out on every operation.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

const POLL: Duration = Duration::from_millis(2);
/// Maximum length of a one-line answer, bytes.
pub(crate) const LONGEST_LINE: u64 = 1 << 20;

/// An error of a request to the emulator.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// No answer in time.
    #[error("no answer within {} s", .0.as_secs_f64())]
    TimedOut(Duration),
    /// The connection failed, or the emulator ended.
    #[error("the connection failed: {0}")]
    Lost(std::io::Error),
    /// An answer outside the protocol.
    #[error("unexpected answer {0:?}")]
    NotUnderstood(String),
    /// The emulator rejected the request.
    #[error("{request:?} was rejected: {answer}")]
    Refused {
        /// The request.
        request: String,
        /// The answer.
        answer: String,
    },
}

/// The socket.
#[derive(Debug)]
pub(crate) struct Socket {
    stream: BufReader<UnixStream>,
    limit: Duration,
}

impl Socket {
    /// Connects as soon as the emulator listens. `limit` is the time limit of the connection and of
    /// each answer.
    pub(crate) fn connect(path: &Path, limit: Duration) -> Result<Self, SocketError> {
        let start = Instant::now();
        let stream = loop {
            match UnixStream::connect(path) {
                Ok(stream) => break stream,
                Err(_) if interrupt::requested() => {
                    return Err(SocketError::Lost(std::io::ErrorKind::Interrupted.into()));
                }
                Err(error) if start.elapsed() >= limit => return Err(SocketError::Lost(error)),
                Err(_) => thread::sleep(POLL),
            }
        };
        let stream = BufReader::new(stream);
        let mut socket = Self { stream, limit };
        socket.wait_at_most(limit)?;
        Ok(socket)
    }

    /// Longest wait for a byte from now on, more than zero.
    pub(crate) fn wait_at_most(&mut self, limit: Duration) -> Result<(), SocketError> {
        self.limit = limit;
        let stream = self.stream.get_ref();
        let set = stream.set_read_timeout(Some(limit));
        let set = set.and_then(|()| stream.set_write_timeout(Some(limit)));
        set.map_err(SocketError::Lost)
    }

    pub(crate) fn limit(&self) -> Duration {
        self.limit
    }

    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), SocketError> {
        let written = self.stream.get_mut().write_all(bytes);
        written.map_err(|error| self.why(error))
    }

    pub(crate) fn read_byte(&mut self) -> Result<u8, SocketError> {
        let mut byte = [0];
        let read = self.stream.read_exact(&mut byte);
        read.map_err(|error| self.why(error))?;
        Ok(byte[0])
    }

    pub(crate) fn read_line(&mut self) -> Result<String, SocketError> {
        let mut line = String::new();
        let mut stream = (&mut self.stream).take(LONGEST_LINE);
        match stream.read_line(&mut line) {
            Ok(0) => Err(self.why(std::io::ErrorKind::UnexpectedEof.into())),
            Ok(_) if line.ends_with('\n') => Ok(line),
            Ok(_) => Err(SocketError::NotUnderstood("a line without end".into())),
            Err(error) => Err(self.why(error)),
        }
    }

    fn why(&self, error: std::io::Error) -> SocketError {
        use std::io::ErrorKind::{TimedOut, WouldBlock};
        match error.kind() {
            TimedOut | WouldBlock => SocketError::TimedOut(self.limit),
            _ => SocketError::Lost(error),
        }
    }
}
