//! The ECU in the emulator with one exchange per PWM period or per control tick: the host replaces
//! its servo and sensors.

use crate::emulator::{Emulator, first_words};
use crate::log::{Lines, LogDecoder};
use crate::machine::Machine;
use crate::periods::Periods;
use crate::pipes::{make_pipe, open_without_waiting, read_exact, read_some, write_all};
use crate::run::{self, Finished, RunError};
use image::Image;
use shared_model::exchange::{TO_HOST_LEN, ToEcu, ToHost};
use shared_model::tick_exchange::{MAX_TICK_TO_HOST_LEN, TickToEcu, TickToHost};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Names of the pipes in the working directory, as in the firmware.
const TO_HOST: &str = "to-host";
const TO_ECU: &str = "to-ecu";
const POLL: Duration = Duration::from_millis(2);

/// Part of the emulator's message when a fault occurs within a fault handler (lockup).
const LOCKUP: &str = "Lockup";

/// Link for the exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkKind {
    /// Pipes, read and written by the emulator once per control tick. The host starts each PWM
    /// period. The duty captured on the pin is the ECU's own.
    Ticks,
    /// The same with the cost of the PWM interrupt, whose measurement takes a quarter of the time.
    MeasuredTicks,
    /// As `Ticks` with one exchange per PWM period, in which the captured duty can be another.
    Files,
    /// As `Files`, but the board's timer starts each PWM period, and the gate measures the time
    /// between control ticks.
    Timed,
    /// The product's image, over its UART; see [`crate::bus_session`].
    Uart,
}

impl LinkKind {
    /// All kinds.
    pub const ALL: [Self; 5] = [
        Self::Ticks,
        Self::MeasuredTicks,
        Self::Files,
        Self::Timed,
        Self::Uart,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ticks => "ticks",
            Self::MeasuredTicks => "ticks-measured",
            Self::Files => "files",
            Self::Timed => "timed",
            Self::Uart => "uart",
        }
    }

    /// Its description in the help.
    pub fn description(self) -> &'static str {
        match self {
            Self::Ticks => "pipes at the host's pace, one exchange per control tick: the fastest",
            Self::MeasuredTicks => "as `ticks`, with the cost of the PWM interrupt",
            Self::Files => "pipes at the host's pace, one exchange per PWM period",
            Self::Timed => {
                "pipes at the pace of the board's timer, whose ticks the gate measures, one exchange per PWM period"
            }
            Self::Uart => "the image `ecu`, over its UART at the pace of its timer",
        }
    }

    fn setting(self) -> String {
        format!("link={}", self.name())
    }
}

/// Both directions of the link, non-blocking.
struct Transport {
    from_ecu: File,
    to_ecu: File,
    /// With an exchange per control tick: the periods of the tick. `None` with one per PWM period.
    tick: Option<Periods<ToHost>>,
    /// The ECU's last duty code.
    duty_code: u16,
}

/// An ECU in the emulator that waits for the vehicle's answer. Dropping it ends the emulator.
pub struct Session {
    transport: Transport,
    attended: Attended,
    limit: Duration,
    _directory: tempfile::TempDir,
}

/// The emulator with the readers of its log and its errors.
struct Attended {
    emulator: Emulator,
    /// Taken at the end.
    readers: Option<(JoinHandle<Vec<String>>, JoinHandle<String>)>,
    last_line: Arc<Mutex<String>>,
}

impl Attended {
    fn new(mut emulator: Emulator, decoder: LogDecoder) -> Self {
        let (mut console, errors) = (emulator.output(), emulator.errors());
        let last_line = Arc::new(Mutex::new(String::from("(none)")));
        let seen = Arc::clone(&last_line);
        let log = thread::spawn(move || {
            let mut lines = Lines::default();
            decoder.decode(&mut console, &mut |line| {
                *seen.lock().expect("no thread panics while it is locked") = line.to_owned();
                lines.push(line);
            });
            lines.into_vec()
        });
        let errors = thread::spawn(move || first_words(errors));
        Self {
            emulator,
            readers: Some((log, errors)),
            last_line,
        }
    }

    fn last_line(&self) -> String {
        let last_line = self
            .last_line
            .lock()
            .expect("no thread panics while it is locked");
        last_line.clone()
    }

    fn timed_out(&self, limit: Duration) -> RunError {
        RunError::TimedOut {
            limit,
            last_line: self.last_line(),
        }
    }

    /// Waits for the end, at most `limit`. Returns the emulator's status, the log, and the
    /// emulator's message.
    fn end(&mut self, limit: Duration) -> Result<(ExitStatus, Vec<String>, String), RunError> {
        let Some(status) = run::wait(&mut self.emulator, limit)? else {
            return Err(self.timed_out(limit));
        };
        // The readers end with the emulator.
        let (log, errors) = self.readers.take().expect("a run ends once");
        let log = log.join().expect("the log's reader does not panic");
        let message = errors.join().expect("the errors' reader does not panic");
        Ok((status, log, message))
    }

    /// The reason why the link was lost: the emulator's status.
    fn left(&mut self, limit: Duration) -> RunError {
        let exit_code = match self.end(limit) {
            Ok((status, _, message)) if status.code().is_none() && message.contains(LOCKUP) => None,
            Ok((status, _, message)) => match run::exit_code(status, message) {
                Ok(exit_code) => Some(exit_code),
                Err(error) => return error,
            },
            Err(error) => return error,
        };
        RunError::LinkLost {
            exit_code,
            last_line: self.last_line(),
        }
    }
}

impl Session {
    /// Starts the image with the scenario's settings and opens the link; waits at most `limit` for
    /// each answer.
    ///
    /// # Errors
    /// If the emulator is missing or fails, the image has no readable log, or the firmware does not
    /// open its end.
    pub fn start(
        image: &Image,
        machine: Machine,
        settings: &[String],
        link: LinkKind,
        options: &[&str],
        limit: Duration,
    ) -> Result<Self, RunError> {
        let directory = tempfile::tempdir().map_err(RunError::NotStarted)?;
        let decoder = LogDecoder::new(image)?;
        if !decoder.is_readable() {
            return Err(RunError::NoLog);
        }
        let mut settings = settings.to_vec();
        settings.push(link.setting());
        let pipes = Pipes::make(directory.path())?;
        let options = [run::SILENT, options].concat();
        let emulator = run::start(image, machine, &settings, directory.path(), &options)?;
        let mut attended = Attended::new(emulator, decoder);
        Ok(Self {
            transport: pipes.open(&mut attended, link, limit)?,
            attended,
            limit,
            _directory: directory,
        })
    }

    /// Receives the ECU's packet of the next PWM period. The ECU then waits for
    /// [`send`](Self::send).
    ///
    /// # Errors
    /// If the emulator has ended, or sends nothing within the limit.
    pub fn receive(&mut self) -> Result<ToHost, RunError> {
        let received = self.transport.receive(self.limit);
        let received = received.map_err(|error| self.lost(&error))?;
        self.transport.duty_code = received.packet.duty_code;
        Ok(received)
    }

    /// Sends the answer.
    ///
    /// # Errors
    /// If the emulator has ended, or reads nothing within the limit, or the answer has a captured
    /// duty that the link cannot carry.
    pub fn send(&mut self, answer: &ToEcu) -> Result<(), RunError> {
        let Transport {
            ref tick,
            duty_code: sent,
            ..
        } = self.transport;
        let captured = answer.packet.duty_code;
        if tick.is_some() && captured != sent {
            return Err(RunError::CapturedDuty { sent, captured });
        }
        let sent = self.transport.send(answer, self.limit);
        sent.map_err(|error| self.lost(&error))
    }

    fn lost(&mut self, error: &std::io::Error) -> RunError {
        match error.kind() {
            ErrorKind::TimedOut => self.attended.timed_out(self.limit),
            ErrorKind::Interrupted => RunError::Interrupted,
            _ => self.attended.left(self.limit),
        }
    }

    /// Waits for the firmware to end, after a packet with `stop`.
    ///
    /// # Errors
    /// If it does not end within the limit, or fails.
    pub fn finish(mut self) -> Result<Finished, RunError> {
        let (status, log, message) = self.attended.end(self.limit)?;
        run::finish(status, log, message, true)
    }
}

/// The pipes, which must exist before the emulator starts.
struct Pipes {
    from_ecu: File,
    to_ecu: PathBuf,
}

impl Pipes {
    fn make(directory: &Path) -> Result<Self, RunError> {
        for name in [TO_HOST, TO_ECU] {
            make_pipe(&directory.join(name))?;
        }
        // The emulator opens the other end later.
        let from_ecu = open_without_waiting(&directory.join(TO_HOST), true);
        Ok(Self {
            from_ecu: from_ecu.map_err(RunError::NotStarted)?,
            to_ecu: directory.join(TO_ECU),
        })
    }

    /// Opens the link after the emulator has opened its end.
    fn open(
        self,
        attended: &mut Attended,
        link: LinkKind,
        limit: Duration,
    ) -> Result<Transport, RunError> {
        Ok(Transport {
            from_ecu: self.from_ecu,
            to_ecu: retry(attended, limit, || {
                open_without_waiting(&self.to_ecu, false)
            })?,
            tick: matches!(link, LinkKind::Ticks | LinkKind::MeasuredTicks).then(Periods::default),
            duty_code: 0,
        })
    }
}

/// Repeats until the emulator has opened its end.
fn retry<T>(
    attended: &mut Attended,
    limit: Duration,
    open: impl Fn() -> std::io::Result<T>,
) -> Result<T, RunError> {
    let start = Instant::now();
    loop {
        if let Ok(opened) = open() {
            return Ok(opened);
        }
        let ended = attended.emulator.try_wait().map_err(RunError::NotStarted)?;
        if ended.is_some() {
            return Err(attended.left(limit));
        }
        if interrupt::requested() {
            return Err(RunError::Interrupted);
        }
        if start.elapsed() > limit {
            return Err(attended.timed_out(limit));
        }
        thread::sleep(POLL);
    }
}

impl Transport {
    fn receive(&mut self, limit: Duration) -> std::io::Result<ToHost> {
        if let Some(tick) = &mut self.tick {
            let from_ecu = &mut self.from_ecu;
            let next = tick.next_or(|| receive_tick(from_ecu, limit))?;
            return next.ok_or(ErrorKind::InvalidData.into());
        }
        let mut bytes = [0; TO_HOST_LEN];
        read_exact(&mut self.from_ecu, limit, &mut bytes)?;
        Ok(ToHost::decode(&bytes))
    }

    fn send(&mut self, answer: &ToEcu, limit: Duration) -> std::io::Result<()> {
        let Some(tick) = &mut self.tick else {
            return write_all(&mut self.to_ecu, limit, &answer.encode());
        };
        if answer.stop {
            tick.clear();
        }
        if !tick.is_last() {
            return Ok(());
        }
        let answer = TickToEcu {
            frame: answer.packet.frame,
            stop: answer.stop,
        };
        write_all(&mut self.to_ecu, limit, &answer.encode())
    }
}

/// Reads the message of a control tick. The ECU waits for the answer, so nothing follows it.
fn receive_tick(from_ecu: &mut File, limit: Duration) -> std::io::Result<Vec<ToHost>> {
    let mut bytes = [0; MAX_TICK_TO_HOST_LEN];
    let mut length = read_some(from_ecu, limit, &mut bytes)?;
    loop {
        let whole = TickToHost::length(&bytes[..length]).unwrap_or(2);
        if whole > bytes.len() || length > whole {
            return Err(ErrorKind::InvalidData.into());
        }
        if length == whole {
            return Ok(TickToHost::periods(&bytes[..length]).collect());
        }
        length += read_some(from_ecu, limit, &mut bytes[length..whole])?;
    }
}
