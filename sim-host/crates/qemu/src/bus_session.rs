//! The product's image in the emulator, in step with a vehicle on the host: no semihosting, frames
//! over the UART, log over RTT.
//!
//! A debugger stops the core once per control tick, after the duties and frames of the tick and
//! before its input is taken. Meanwhile the virtual time stands still, so the host takes as long as
//! it likes, and a repeated run gives the same bytes.

use crate::emulator::{Emulator, first_words};
use crate::gdb::{Gdb, Register, Stop};
use crate::log::{Lines, LogDecoder, Stream};
use crate::machine::Machine;
use crate::pipes::{make_pipe, open_without_waiting, write_all};
use crate::qmp::Qmp;
use crate::rtt::Channel;
use crate::run::{self, RunError};
use image::Image;
use serde_json::json;
use shared_model::bus::{self, Message};
use shared_model::exchange::FrameBytes;
use shared_model::serial::{Deframer, Received};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The variable whose write stops the core, and the instruction that writes it.
const MARK: &str = "BEFORE_SENSOR_FRAME";
const WRITE: &str = "before_sensor_frame";
/// Registers of virtual PWM and bridge: periods (4 bytes), duty, period (2 each), bridge (4), and
/// for each of the last periods duty and bridge (4).
const REGISTERS: &str = "VIRTUAL_PWM";
const TRACE_AT: usize = 12;
const TRACE_LEN: u32 = 128;
const BRIDGE_ON: u32 = 1 << 16;
/// The emulator's multiplexer holds the bytes that the UART has no room for, so that a packet
/// arrives whole. No byte may be its escape character, so that is none.
const NO_ESCAPE: &str = "0x1ff";
/// Control ticks between two looks at the log.
const LOG_TICKS: u32 = 50;

/// A PWM period as its pins had it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Period {
    /// Duty code.
    pub duty_code: u16,
    /// The bridge was on.
    pub bridge_on: bool,
}

/// Outputs of a control tick.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tick {
    /// Its PWM periods.
    pub periods: Vec<Period>,
    /// Actuator frames; one, if the ECU was not left to itself.
    pub frames: Vec<FrameBytes>,
    /// Diagnostic frames.
    pub diagnostics: Vec<FrameBytes>,
}

/// The servo's pins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Servo {
    /// Duty code.
    pub duty: u16,
    /// Duty code of no voltage; 0 before the PWM is started.
    pub neutral: u16,
    /// The bridge is on.
    pub bridge: bool,
}

/// The ECU, stopped between two control ticks. Dropping it ends the emulator.
pub struct BusSession {
    gdb: Gdb,
    qmp: Qmp,
    from_ecu: File,
    to_ecu: File,
    deframer: Deframer,
    mark: u32,
    write: u32,
    registers: u32,
    periods: u32,
    ticks: u32,
    channel: Option<Channel>,
    decoder: LogDecoder,
    stream: Stream,
    log: Lines,
    /// Ends when it is dropped.
    _emulator: Emulator,
    limit: Duration,
    _directory: TempDir,
}

impl BusSession {
    /// Starts a configured image, stopped before its first instruction. `limit` is the longest wait
    /// for each answer of the emulator.
    ///
    /// # Errors
    /// If the emulator is missing or fails, or the image is not the product's.
    pub fn start(image: &Image, machine: Machine, limit: Duration) -> Result<Self, RunError> {
        let directory = tempfile::tempdir().map_err(RunError::NotStarted)?;
        let path = |name: &str| directory.path().join(name);
        let decoder = LogDecoder::new(image)?;
        let symbol = |name| image.address_of(name).ok_or(RunError::NoSymbol { name });
        let (mark, write) = (symbol(MARK)?, symbol(WRITE)?);
        let registers = symbol(REGISTERS)?;
        // Its bytes may not be those of its file: a configuration is written into them.
        let elf = path("ecu.elf");
        std::fs::write(&elf, &image.bytes).map_err(RunError::NotStarted)?;
        let (input, output) = (path("bus.in"), path("bus.out"));
        make_pipe(&input)?;
        make_pipe(&output)?;
        let opened =
            |path: &Path, read| open_without_waiting(path, read).map_err(RunError::NotStarted);
        let from_ecu = opened(&output, true)?;
        let bus = format!("pipe,id=bus,mux=on,path={}", path("bus").display());
        let listen = |name| format!("unix:{},server=on,wait=off", path(name).display());
        let (at_gdb, at_qmp) = (listen("gdb"), listen("qmp"));
        let options = ["-S", "-gdb", &at_gdb, "-qmp", &at_qmp, "-echr", NO_ESCAPE];
        let bus = ["-chardev", &bus];
        let serial = machine.serial_options("chardev:bus");
        let options = [&options[..], &bus, &serial].concat();
        let mut emulator = run::start_alone(&elf, machine, directory.path(), &options)?;
        let connected = (|| {
            let gdb = Gdb::connect(&path("gdb"), limit)?;
            let qmp = Qmp::connect(&path("qmp"), limit)?;
            // The emulator has its end open before it listens for the debugger.
            Ok((gdb, qmp, opened(&input, false)?))
        })();
        let (mut gdb, qmp, to_ecu) = match connected {
            Ok(connected) => connected,
            Err(error) => return Err(reason(&mut emulator, error)),
        };
        gdb.watch(mark)?;
        Ok(Self {
            gdb,
            qmp,
            from_ecu,
            to_ecu,
            deframer: Deframer::new(),
            mark,
            write,
            registers,
            periods: 0,
            ticks: 0,
            channel: Channel::of(image),
            decoder,
            stream: Stream::default(),
            log: Lines::default(),
            _emulator: emulator,
            limit,
            _directory: directory,
        })
    }

    /// Runs the ECU until a control tick is about to take its input, and returns the outputs of the
    /// PWM periods since the last.
    ///
    /// # Errors
    /// If there is no such tick within the limit: the ECU is in a safe state without tasks.
    pub fn tick(&mut self) -> Result<Tick, RunError> {
        let stop = self.gdb.go_on(self.limit)?;
        if stop == Stop::Breakpoint && self.gdb.read_register(Register::Pc)? == self.write {
            self.gdb.write_register(Register::Pc, self.write + 2)?;
        }
        if stop != Stop::Breakpoint {
            return Err(RunError::NotComplete {
                last_line: self.log.last(),
            });
        }
        if self.ticks.is_multiple_of(LOG_TICKS) {
            self.read_log()?;
        }
        self.ticks += 1;
        let mut tick = received(&mut self.from_ecu, &mut self.deframer)?;
        tick.periods = self.periods()?;
        Ok(tick)
    }

    /// Lets the ECU run for about `duration` of the host's time, without stops, and returns what it
    /// sent.
    ///
    /// # Errors
    /// If the emulator fails.
    pub fn run_freely(&mut self, duration: Duration) -> Result<Tick, RunError> {
        self.gdb.unwatch(self.mark)?;
        self.gdb.run_for(duration, self.limit)?;
        self.gdb.watch(self.mark)?;
        self.read_log()?;
        received(&mut self.from_ecu, &mut self.deframer)
    }

    /// Takes the debugger off, lets the ECU run for about `duration` of the host's time, and returns
    /// what it sent.
    ///
    /// # Errors
    /// If the stub does not answer.
    pub fn run_detached(self, duration: Duration) -> Result<Tick, RunError> {
        let Self {
            gdb,
            mut from_ecu,
            mut deframer,
            _emulator,
            _directory,
            ..
        } = self;
        gdb.detach()?;
        std::thread::sleep(duration);
        received(&mut from_ecu, &mut deframer)
    }

    /// Resets the machine; its RAM stays.
    ///
    /// # Errors
    /// If the emulator does not answer.
    pub fn reset(&mut self) -> Result<(), RunError> {
        self.qmp.execute("system_reset", json!({}))?;
        self.periods = 0;
        Ok(())
    }

    /// Sends bytes to the ECU, all of which arrive before it continues. At most 32.
    ///
    /// # Errors
    /// If the emulator takes no bytes.
    pub fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), RunError> {
        let sent = write_all(&mut self.to_ecu, self.limit, bytes);
        sent.map_err(RunError::NotStarted)?;
        let start = Instant::now();
        // Until the emulator has read them all; it takes them byte by byte.
        while rustix::io::ioctl_fionread(&self.to_ecu).is_ok_and(|left| left > 0) {
            if interrupt::requested() {
                return Err(RunError::Interrupted);
            }
            if start.elapsed() > self.limit {
                return Err(RunError::TimedOut {
                    limit: self.limit,
                    last_line: self.log.last(),
                });
            }
            std::thread::yield_now();
        }
        Ok(())
    }

    /// Sends a message to the ECU.
    ///
    /// # Errors
    /// If the emulator takes no bytes.
    pub fn send(&mut self, message: Message, frame: &FrameBytes) -> Result<(), RunError> {
        let mut packet = Vec::with_capacity(32);
        bus::pack(message, frame, |byte| packet.push(byte));
        self.send_bytes(&packet)
    }

    /// Lets the ECU run while `bytes` come in as fast as it takes them, for about `duration` of the
    /// host's time, and returns the actuator frames that it sent.
    ///
    /// # Errors
    /// If the emulator fails.
    pub fn babble(
        &mut self,
        bytes: &[u8],
        duration: Duration,
    ) -> Result<Vec<FrameBytes>, RunError> {
        let mut to_ecu = self.to_ecu.try_clone().map_err(RunError::NotStarted)?;
        let limit = duration;
        let bytes = bytes.to_vec();
        let sender = std::thread::spawn(move || {
            let start = Instant::now();
            // Ends with the time, or when the emulator takes no more.
            while start.elapsed() < limit && write_all(&mut to_ecu, limit, &bytes).is_ok() {}
        });
        let received = self.run_freely(duration);
        let _ = sender.join();
        Ok(received?.frames)
    }

    /// Makes the core continue at another address.
    ///
    /// # Errors
    /// If the stub does not answer.
    pub fn jump_to(&mut self, address: u32) -> Result<(), RunError> {
        self.gdb.write_register(Register::Pc, address)?;
        Ok(())
    }

    /// Leaves the log unread, its ring full.
    ///
    /// # Errors
    /// If the stub does not answer.
    pub fn leave_log_full(&mut self) -> Result<(), RunError> {
        if let Some(channel) = self.channel.take() {
            channel.fill(&mut self.gdb)?;
        }
        Ok(())
    }

    /// The debugger.
    pub fn gdb(&mut self) -> &mut Gdb {
        &mut self.gdb
    }

    /// Lines of the log since the last call; at most the last thousand.
    ///
    /// # Errors
    /// If the stub does not answer.
    pub fn log(&mut self) -> Result<Vec<String>, RunError> {
        self.read_log()?;
        Ok(std::mem::take(&mut self.log).into_vec())
    }

    /// The servo as its pins have it.
    ///
    /// # Errors
    /// If the stub does not answer.
    pub fn servo(&mut self) -> Result<Servo, RunError> {
        let bytes = self.gdb.read_memory(self.registers, TRACE_AT)?;
        let half = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        Ok(Servo {
            duty: half(4),
            neutral: half(6) / 2,
            bridge: bytes[8] != 0,
        })
    }

    /// PWM periods since the last call.
    fn periods(&mut self) -> Result<Vec<Period>, RunError> {
        let length = TRACE_AT + 4 * TRACE_LEN as usize;
        let bytes = self.gdb.read_memory(self.registers, length)?;
        let (periods, rest) = bytes.split_at(4);
        let periods = u32::from_le_bytes(periods.try_into().unwrap_or_default());
        let (trace, _) = rest[TRACE_AT - 4..].as_chunks::<4>();
        let new = periods.wrapping_sub(self.periods).min(TRACE_LEN);
        let new = (periods.wrapping_sub(new)..periods).map(|period| {
            let word = u32::from_le_bytes(trace[(period % TRACE_LEN) as usize]);
            Period {
                duty_code: word as u16,
                bridge_on: word & BRIDGE_ON != 0,
            }
        });
        self.periods = periods;
        Ok(new.collect())
    }

    fn read_log(&mut self) -> Result<(), RunError> {
        if let Some(channel) = self.channel {
            let bytes = channel.take(&mut self.gdb)?;
            let log = &mut self.log;
            self.decoder
                .decode_some(&mut self.stream, &bytes, &mut |line| log.push(line));
        }
        Ok(())
    }
}

/// Messages that the emulator has sent so far.
fn received(from_ecu: &mut File, deframer: &mut Deframer) -> Result<Tick, RunError> {
    let mut tick = Tick::default();
    let mut buffer = [0; 256];
    loop {
        let length = match from_ecu.read(&mut buffer) {
            Ok(0) => return Ok(tick),
            Ok(length) => length,
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(tick),
            Err(error) => return Err(RunError::NotStarted(error)),
        };
        for &byte in &buffer[..length] {
            let Received::Body(body) = deframer.push(byte) else {
                continue;
            };
            match bus::unpack(body) {
                Some((Message::Actuator, frame)) => tick.frames.push(frame),
                Some((Message::Diagnostic, frame)) => tick.diagnostics.push(frame),
                _ => {}
            }
        }
    }
}

/// Why the emulator cannot be reached: its own message if it has ended.
fn reason(emulator: &mut Emulator, error: RunError) -> RunError {
    let errors = emulator.errors();
    match emulator.try_wait() {
        Ok(Some(status)) => RunError::EmulatorFailed {
            status,
            message: first_words(errors),
        },
        _ => error,
    }
}
