//! Bulk telemetry: the ECU's record of a run, to the bit.
//!
//! A stream is one header, one record per model step, and one trailer. Each is a tag byte, a body
//! in little-endian order and a CRC-16, so that a flipped bit is found where it is and a stream
//! that was cut short lacks its trailer. The numbers of the state are their bits: nothing is
//! rounded on the way.

use crate::MAX_RATIO;
use crate::friction::FrictionMode;
use crate::vehicle::State;
use core::fmt;
use nalgebra::Vector4;

/// Version of the format; a reader refuses any other.
pub const VERSION: u16 = 2;

const CHECKSUM: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);

const HEADER_TAG: u8 = b'H';
const RECORD_TAG: u8 = b'R';
const TRAILER_TAG: u8 = b'T';

/// Encoded length of a header, bytes.
pub const HEADER_LEN: usize = 1 + 35 + 2;
/// Encoded length of a record without its duty codes, bytes.
pub const RECORD_FIXED_LEN: usize = 1 + 25 + 2;
/// Encoded length of a trailer, bytes.
pub const TRAILER_LEN: usize = 1 + 24 + 2;

/// Encoded length of a record with its duty codes, bytes.
pub const fn record_len(samples_per_step: u16) -> usize {
    RECORD_FIXED_LEN + 2 * samples_per_step as usize
}

/// First frame of a stream: the meaning of the records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Header {
    /// PWM samples, and so duty codes, in a record.
    pub samples_per_step: u16,
    /// Model steps per second.
    pub step_rate_hz: u32,
    /// Counts of the PWM timer's period.
    pub pwm_period: u16,
    /// Counts per second of the clock that measures the tasks.
    pub cost_clock_hz: u32,
    /// Instructions per second of a simulated core; 0 on silicon.
    pub instruction_rate_hz: u32,
    /// State in which the run starts.
    pub initial: State<f32>,
}

/// One model step. The duty codes of its PWM samples follow it in the stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// Number of the step, from 1; the state is that at `index` steps after the start.
    pub index: u32,
    /// State after the step.
    pub state: State<f32>,
    /// Counts of the cost clock that the control task took.
    pub control_cost: u16,
    /// Most counts of the cost clock that the PWM task took in one of the step's samples.
    pub pwm_cost: u16,
}

/// Last frame of a stream: the end of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trailer {
    /// Exit code of the firmware.
    pub exit_code: u32,
    /// Records written.
    pub records: u32,
    /// Records or duty codes lost because a ring was full, and control tasks that were not done
    /// when due again.
    pub overruns: u32,
    /// Deepest use of the stack, bytes.
    pub stack_bytes: u32,
    /// Duty code on the PWM at the end.
    pub final_duty: u16,
    /// Duty code of no voltage.
    pub neutral_duty: u16,
    /// Shortest interval from one PWM interrupt to the next, counts of the cost clock, saturated;
    /// above the longest where there is none.
    pub min_interval: u16,
    /// Longest interval from one PWM interrupt to the next, counts of the cost clock, saturated.
    pub max_interval: u16,
}

/// Reason why a frame cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// Fewer bytes than the frame has.
    CutShort {
        /// Bytes that the frame has.
        needed: usize,
        /// Bytes that there are.
        found: usize,
    },
    /// The tag is not the expected one.
    UnknownTag(u8),
    /// The checksum does not match the bytes.
    Checksum {
        /// Checksum of the bytes.
        computed: u16,
        /// Checksum in the frame.
        stored: u16,
    },
    /// Another version of the format.
    Version(u16),
    /// No such friction mode.
    FrictionMode(u8),
    /// A number that no run has.
    OutOfRange {
        /// Its name.
        field: &'static str,
        /// The value.
        value: u32,
        /// Least value.
        min: u32,
        /// Greatest value.
        max: u32,
    },
    /// The initial state has a number that is not finite.
    InitialState,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CutShort { needed, found } => {
                write!(f, "cut short: {found} of a frame's {needed} bytes")
            }
            Self::UnknownTag(tag) => write!(f, "unknown frame tag {tag:#04x}"),
            Self::Checksum { computed, stored } => write!(
                f,
                "checksum {stored:#06x} in the frame, {computed:#06x} from its bytes: a bit was changed"
            ),
            Self::Version(version) => {
                write!(f, "format version {version}; this program reads {VERSION}")
            }
            Self::FrictionMode(code) => write!(f, "unknown friction mode {code}"),
            Self::OutOfRange {
                field,
                value,
                min,
                max,
            } => write!(f, "{field} = {value}: must be from {min} to {max}"),
            Self::InitialState => f.write_str("the initial state has a number that is not finite"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Writes a frame's bytes one after the other; what does not fit the buffer is dropped, and the
/// frame then has length 0.
struct Writer<'a> {
    buffer: &'a mut [u8],
    length: usize,
    overflowed: bool,
}

impl<'a> Writer<'a> {
    fn new(buffer: &'a mut [u8], tag: u8) -> Self {
        let mut writer = Self {
            buffer,
            length: 0,
            overflowed: false,
        };
        writer.bytes(&[tag]);
        writer
    }

    fn bytes(&mut self, bytes: &[u8]) {
        let end = self.length + bytes.len();
        match self.buffer.get_mut(self.length..end) {
            Some(place) => {
                place.copy_from_slice(bytes);
                self.length = end;
            }
            None => self.overflowed = true,
        }
    }

    fn u16(&mut self, value: u16) {
        self.bytes(&value.to_le_bytes());
    }

    fn u32(&mut self, value: u32) {
        self.bytes(&value.to_le_bytes());
    }

    fn state(&mut self, state: &State<f32>) {
        for value in state.x.iter() {
            self.u32(value.to_bits());
        }
        self.bytes(&[state.friction as u8]);
    }

    fn finish(mut self) -> usize {
        let written = self.buffer.get(..self.length).unwrap_or(&[]);
        let checksum = CHECKSUM.checksum(written);
        self.u16(checksum);
        if self.overflowed { 0 } else { self.length }
    }
}

/// Reads a frame's fields one after the other, the checksum being right.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Checks tag, length and checksum of the frame of `length` bytes at the start of `bytes`.
    fn new(bytes: &'a [u8], tag: u8, length: usize) -> Result<Self, FrameError> {
        let found = *bytes.first().ok_or(FrameError::CutShort {
            needed: length,
            found: 0,
        })?;
        if found != tag {
            return Err(FrameError::UnknownTag(found));
        }
        let frame = bytes.get(..length).ok_or(FrameError::CutShort {
            needed: length,
            found: bytes.len(),
        })?;
        let (body, stored) = frame.split_at(length - 2);
        let computed = CHECKSUM.checksum(body);
        let stored = u16::from_le_bytes([stored[0], stored[1]]);
        if computed != stored {
            return Err(FrameError::Checksum { computed, stored });
        }
        Ok(Self { bytes: &body[1..] })
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        // The lengths are those of this module's constants, which a test holds to the fields.
        let (taken, rest) = self
            .bytes
            .split_first_chunk()
            .expect("frame is long enough");
        self.bytes = rest;
        *taken
    }

    fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn state(&mut self) -> Result<State<f32>, FrameError> {
        let x = core::array::from_fn(|_| f32::from_bits(self.u32()));
        let [code] = self.take();
        let friction = FrictionMode::from_code(code).ok_or(FrameError::FrictionMode(code))?;
        Ok(State {
            x: Vector4::from(x),
            friction,
        })
    }
}

impl Header {
    /// Writes the frame into `buffer`; returns its length, or 0 if the buffer is shorter than
    /// [`HEADER_LEN`].
    pub fn encode(&self, buffer: &mut [u8]) -> usize {
        let mut writer = Writer::new(buffer, HEADER_TAG);
        writer.u16(VERSION);
        writer.u16(self.samples_per_step);
        writer.u32(self.step_rate_hz);
        writer.u16(self.pwm_period);
        writer.u32(self.cost_clock_hz);
        writer.u32(self.instruction_rate_hz);
        writer.state(&self.initial);
        writer.finish()
    }

    /// Reads the frame at the start of `bytes`.
    ///
    /// # Errors
    /// If it is cut short, damaged or of another version, or has a number that no run has.
    pub fn decode(bytes: &[u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes, HEADER_TAG, HEADER_LEN)?;
        let version = reader.u16();
        if version != VERSION {
            return Err(FrameError::Version(version));
        }
        let header = Self {
            samples_per_step: reader.u16(),
            step_rate_hz: reader.u32(),
            pwm_period: reader.u16(),
            cost_clock_hz: reader.u32(),
            instruction_rate_hz: reader.u32(),
            initial: reader.state()?,
        };
        header.validate()?;
        Ok(header)
    }

    /// Checks the values of a header from outside: a valid checksum does not make them plausible.
    fn validate(&self) -> Result<(), FrameError> {
        let samples = u32::from(self.samples_per_step);
        let period = u32::from(self.pwm_period);
        let fields = [
            ("samples_per_step", samples, 1, MAX_RATIO),
            ("step_rate_hz", self.step_rate_hz, 1, 1_000_000),
            ("pwm_period", period, 2, u16::MAX.into()),
            ("cost_clock_hz", self.cost_clock_hz, 1, u32::MAX),
        ];
        for (field, value, min, max) in fields {
            if !(min..=max).contains(&value) {
                return Err(FrameError::OutOfRange {
                    field,
                    value,
                    min,
                    max,
                });
            }
        }
        let is_finite = self.initial.x.iter().all(|value| value.is_finite());
        is_finite.then_some(()).ok_or(FrameError::InitialState)
    }
}

impl Record {
    /// Writes the frame with its duty codes into `buffer`; returns its length, or 0 if it does not
    /// fit.
    ///
    /// ```
    /// use shared_model::telemetry::{Record, record_len};
    /// # use shared_model::{friction::FrictionMode, vehicle::State};
    /// # let state = State { x: [0.1, -0.2, 0.3, 0.0].into(), friction: FrictionMode::Sticking };
    /// let record = Record { index: 7, state, control_cost: 40, pwm_cost: 5 };
    /// let mut buffer = [0; record_len(2)];
    /// assert_eq!(record.encode([1250, 1251], &mut buffer), record_len(2));
    /// let mut duties = Vec::new();
    /// assert_eq!(Record::decode(&buffer, 2, |code| duties.push(code)).unwrap(), record);
    /// assert_eq!(duties, [1250, 1251]);
    /// // One flipped bit anywhere is found.
    /// buffer[9] ^= 1 << 4;
    /// assert!(Record::decode(&buffer, 2, |_| {}).is_err());
    /// ```
    pub fn encode(&self, duty_codes: impl IntoIterator<Item = u16>, buffer: &mut [u8]) -> usize {
        let mut writer = Writer::new(buffer, RECORD_TAG);
        writer.u32(self.index);
        writer.state(&self.state);
        writer.u16(self.control_cost);
        writer.u16(self.pwm_cost);
        for code in duty_codes {
            writer.u16(code);
        }
        writer.finish()
    }

    /// Reads the frame at the start of `bytes`; `on_duty` receives its duty codes.
    ///
    /// # Errors
    /// If it is cut short or damaged, or is no record.
    pub fn decode(
        bytes: &[u8],
        samples_per_step: u16,
        mut on_duty: impl FnMut(u16),
    ) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes, RECORD_TAG, record_len(samples_per_step))?;
        let record = Self {
            index: reader.u32(),
            state: reader.state()?,
            control_cost: reader.u16(),
            pwm_cost: reader.u16(),
        };
        for _ in 0..samples_per_step {
            on_duty(reader.u16());
        }
        Ok(record)
    }
}

impl Trailer {
    /// Writes the frame into `buffer`; returns its length, or 0 if the buffer is shorter than
    /// [`TRAILER_LEN`].
    pub fn encode(&self, buffer: &mut [u8]) -> usize {
        let mut writer = Writer::new(buffer, TRAILER_TAG);
        writer.u32(self.exit_code);
        writer.u32(self.records);
        writer.u32(self.overruns);
        writer.u32(self.stack_bytes);
        writer.u16(self.final_duty);
        writer.u16(self.neutral_duty);
        writer.u16(self.min_interval);
        writer.u16(self.max_interval);
        writer.finish()
    }

    /// Reads the frame at the start of `bytes`.
    ///
    /// # Errors
    /// If it is cut short or damaged, or is no trailer.
    pub fn decode(bytes: &[u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes, TRAILER_TAG, TRAILER_LEN)?;
        Ok(Self {
            exit_code: reader.u32(),
            records: reader.u32(),
            overruns: reader.u32(),
            stack_bytes: reader.u32(),
            final_duty: reader.u16(),
            neutral_duty: reader.u16(),
            min_interval: reader.u16(),
            max_interval: reader.u16(),
        })
    }
}

/// Whether the frame at the start of `bytes` is a trailer.
pub fn is_trailer(bytes: &[u8]) -> bool {
    bytes.first() == Some(&TRAILER_TAG)
}
