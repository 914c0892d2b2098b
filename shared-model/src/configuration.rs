//! The ECU's configuration as two blocks of bytes in its flash: the application's parameters, and
//! the gate's limits, which are sealed apart from them.
//!
//! | bytes | content |
//! |---|---|
//! | 0..4 | magic number |
//! | 4..6 | layout: a checksum of all parameters' names, so that another version's block is known |
//! | 6..8 | board: a checksum of its name |
//! | 8..10 | length of the values, bytes |
//! | 10..12 | [`Part`] |
//! | 12.. | values: choices as the number of the alternative (1 byte), then numbers as f32 |
//! | the last 4 | CRC-32 of everything before |
//!
//! All numbers are little-endian. A block that passes is checked by [`Scenario::validate`] like any
//! scenario, and the ranges of the gate's limits are hard bounds: no block can widen them.

use crate::parameter::ParameterSet;
use crate::settings::Choice;
use crate::{InvalidScenario, Scenario};

const MAGIC: [u8; 4] = *b"DSCF";
const HEADER_LEN: usize = 12;
const CHECKSUM_LEN: usize = 4;
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
const SHORT_CHECKSUM: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_3740);

/// Room for a block in the flash, bytes.
pub const BLOCK_LEN: usize = 512;
/// Bytes of the flash for both blocks: the application's, then the gate's.
pub const CONFIGURATION_LEN: usize = 2 * BLOCK_LEN;
/// Value of an erased byte of flash.
pub const ERASED: u8 = 0xFF;

/// The blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Part {
    /// Vehicle, steering, dither, servo, controller and rates.
    Application = 0,
    /// The gate's limits.
    Gate = 1,
}

/// Reason why the ECU refuses its configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ConfigurationError {
    /// Nothing is written.
    Erased(Part),
    /// It begins with something else than a block's magic number, or is another part.
    NoBlock(Part),
    /// It is of another version: its parameters are others.
    Layout(Part),
    /// It is for another board.
    Board(Part),
    /// It does not fit its place.
    Length(Part),
    /// Its checksum is wrong: it is damaged.
    Checksum(Part),
    /// A choice has a number that is no alternative.
    Choice(Part),
    /// Its numbers are no valid scenario.
    Invalid(InvalidScenario),
    /// Its timer clock is not the board's, Hz.
    TimerClock(f32),
}

impl ConfigurationError {
    /// Its number in a diagnostic frame; 0 is no error. The gate's have 16 more.
    pub fn code(&self) -> u8 {
        let (code, part) = match self {
            Self::Erased(part) => (1, *part),
            Self::NoBlock(part) => (2, *part),
            Self::Layout(part) => (3, *part),
            Self::Board(part) => (4, *part),
            Self::Length(part) => (5, *part),
            Self::Checksum(part) => (6, *part),
            Self::Choice(part) => (7, *part),
            Self::Invalid(_) => (8, Part::Application),
            Self::TimerClock(_) => (9, Part::Application),
        };
        code + 16 * part as u8
    }

    /// The reason in words.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::Erased(_) => "erased",
            Self::NoBlock(_) => "no configuration block",
            Self::Layout(_) => "of another version",
            Self::Board(_) => "for another board",
            Self::Length(_) => "truncated or too long",
            Self::Checksum(_) => "damaged",
            Self::Choice(_) => "a choice that is no alternative",
            Self::Invalid(_) => "a value out of range",
            Self::TimerClock(_) => "for another timer clock",
        }
    }
}

/// Passes over the values of a block in their one order.
trait Values {
    fn number(&mut self, number: &mut f32);
    fn choice<C: Choice>(&mut self, choice: &mut C);

    fn numbers<P: ParameterSet<f32>>(&mut self, set: &mut P) {
        for field in P::FIELDS {
            self.number((field.accessor)(set));
        }
    }
}

fn pass(part: Part, scenario: &mut Scenario<f32>, values: &mut impl Values) {
    if part == Part::Gate {
        values.numbers(&mut scenario.gate);
        return;
    }
    values.choice(&mut scenario.vehicle.slip_form);
    values.choice(&mut scenario.tires.model);
    values.choice(&mut scenario.friction.law);
    values.choice(&mut scenario.friction.dithered);
    values.choice(&mut scenario.dither.waveform);
    values.choice(&mut scenario.dither.application);
    values.choice(&mut scenario.controller.suppression);
    values.numbers(&mut scenario.vehicle);
    values.numbers(&mut scenario.tires.front);
    values.numbers(&mut scenario.tires.rear);
    values.numbers(&mut scenario.steering);
    values.numbers(&mut scenario.friction);
    values.numbers(&mut scenario.dither);
    values.numbers(&mut scenario.servo);
    values.numbers(&mut scenario.controller);
    values.numbers(&mut scenario.run);
}

/// A checksum of the parameters' names and alternatives in their order.
pub fn layout() -> u16 {
    struct Names(crc::Digest<'static, u16>);
    impl Names {
        // Out of line: in line, a hundred names take 20 kB of flash.
        #[inline(never)]
        fn name(&mut self, name: &str) {
            self.0.update(name.as_bytes());
            self.0.update(&[0]);
        }
    }
    impl Values for Names {
        fn number(&mut self, _number: &mut f32) {}

        fn choice<C: Choice>(&mut self, _choice: &mut C) {
            for alternative in C::ALL {
                self.name(alternative.name());
            }
        }

        fn numbers<P: ParameterSet<f32>>(&mut self, _set: &mut P) {
            for field in P::FIELDS {
                self.name(field.name);
            }
        }
    }
    let mut names = Names(SHORT_CHECKSUM.digest());
    let mut scenario = Scenario::reconstruction();
    for part in [Part::Application, Part::Gate] {
        pass(part, &mut scenario, &mut names);
    }
    names.0.finalize()
}

/// The number of a board in a block.
pub(crate) fn board_number(board: &str) -> u16 {
    SHORT_CHECKSUM.checksum(board.as_bytes())
}

struct Writer<'a> {
    free: &'a mut [u8],
    written: usize,
}

impl Writer<'_> {
    fn bytes(&mut self, bytes: &[u8]) {
        let free = core::mem::take(&mut self.free);
        if let Some((place, rest)) = free.split_at_mut_checked(bytes.len()) {
            place.copy_from_slice(bytes);
            self.written += bytes.len();
            self.free = rest;
        }
    }
}

impl Values for Writer<'_> {
    fn number(&mut self, number: &mut f32) {
        self.bytes(&number.to_le_bytes());
    }

    fn choice<C: Choice>(&mut self, choice: &mut C) {
        let index = C::ALL.iter().position(|one| one == choice);
        self.bytes(&[index.unwrap_or(0) as u8]);
    }
}

struct Reader<'a> {
    left: &'a [u8],
    is_valid: bool,
}

impl Reader<'_> {
    fn bytes<const LEN: usize>(&mut self) -> [u8; LEN] {
        if let Some((bytes, rest)) = self.left.split_first_chunk() {
            self.left = rest;
            *bytes
        } else {
            self.is_valid = false;
            [0; LEN]
        }
    }
}

impl Values for Reader<'_> {
    fn number(&mut self, number: &mut f32) {
        *number = f32::from_le_bytes(self.bytes());
    }

    fn choice<C: Choice>(&mut self, choice: &mut C) {
        let [index] = self.bytes();
        match C::ALL.get(usize::from(index)) {
            Some(alternative) => *choice = *alternative,
            None => self.is_valid = false,
        }
    }
}

/// The block of a part of the scenario, for the board of that name; the bytes after it are erased.
///
/// ```
/// use shared_model::Scenario;
/// use shared_model::configuration::{Part, block, decode};
/// let mut scenario = Scenario::<f32>::reconstruction();
/// scenario.run.wheel_speed_rpm = 1600.0;
/// let flash = [
///     block(Part::Application, &scenario, "mps2"),
///     block(Part::Gate, &scenario, "mps2"),
/// ];
/// assert_eq!(decode(flash.as_flattened(), "mps2"), Ok(scenario));
/// ```
pub fn block(part: Part, scenario: &Scenario<f32>, board: &str) -> [u8; BLOCK_LEN] {
    let mut block = [ERASED; BLOCK_LEN];
    let Some((header, rest)) = block.split_first_chunk_mut::<HEADER_LEN>() else {
        return block;
    };
    let mut values = Writer {
        free: rest,
        written: 0,
    };
    pass(part, &mut { *scenario }, &mut values);
    let length = values.written;
    let [layout_low, layout_high] = layout().to_le_bytes();
    let [board_low, board_high] = board_number(board).to_le_bytes();
    let [length_low, length_high] = (length as u16).to_le_bytes();
    let [a, b, c, d] = MAGIC;
    *header = [
        a,
        b,
        c,
        d,
        layout_low,
        layout_high,
        board_low,
        board_high,
        length_low,
        length_high,
        part as u8,
        0,
    ];
    let (covered, after) = block.split_at_mut(HEADER_LEN + length);
    if let Some(place) = after.first_chunk_mut() {
        *place = CHECKSUM.checksum(covered).to_le_bytes();
    }
    block
}

/// The scenario in the configuration of a board. Not validated.
///
/// # Errors
/// The first reason why it is refused.
pub fn decode(bytes: &[u8], board: &str) -> Result<Scenario<f32>, ConfigurationError> {
    let mut scenario = Scenario::reconstruction();
    for (part, start) in [(Part::Application, 0), (Part::Gate, BLOCK_LEN)] {
        let block = bytes.get(start..start + BLOCK_LEN);
        let block = block.ok_or(ConfigurationError::Length(part))?;
        decode_part(part, block, board, &mut scenario)?;
    }
    Ok(scenario)
}

/// Reads one block into the scenario.
///
/// # Errors
/// The first reason why it is refused.
pub(crate) fn decode_part(
    part: Part,
    block: &[u8],
    board: &str,
    scenario: &mut Scenario<f32>,
) -> Result<(), ConfigurationError> {
    if block.iter().all(|&byte| byte == ERASED) {
        return Err(ConfigurationError::Erased(part));
    }
    let header = block.first_chunk::<HEADER_LEN>();
    let header = header.ok_or(ConfigurationError::Length(part))?;
    let [
        a,
        b,
        c,
        d,
        layout_low,
        layout_high,
        board_low,
        board_high,
        length_low,
        length_high,
        number,
        zero,
    ] = *header;
    if [a, b, c, d] != MAGIC {
        return Err(ConfigurationError::NoBlock(part));
    }
    let length = usize::from(u16::from_le_bytes([length_low, length_high]));
    let covered = block.get(..HEADER_LEN + length);
    let stated = block.get(HEADER_LEN + length..HEADER_LEN + length + CHECKSUM_LEN);
    let (Some(covered), Some(stated)) = (covered, stated) else {
        return Err(ConfigurationError::Length(part));
    };
    // Before anything in it is believed.
    if stated != CHECKSUM.checksum(covered).to_le_bytes() {
        return Err(ConfigurationError::Checksum(part));
    }
    if [number, zero] != [part as u8, 0] {
        return Err(ConfigurationError::NoBlock(part));
    }
    if u16::from_le_bytes([layout_low, layout_high]) != layout() {
        return Err(ConfigurationError::Layout(part));
    }
    if u16::from_le_bytes([board_low, board_high]) != board_number(board) {
        return Err(ConfigurationError::Board(part));
    }
    let mut values = Reader {
        left: covered.get(HEADER_LEN..).unwrap_or(&[]),
        is_valid: true,
    };
    pass(part, scenario, &mut values);
    if !values.left.is_empty() {
        return Err(ConfigurationError::Length(part));
    }
    if !values.is_valid {
        return Err(ConfigurationError::Choice(part));
    }
    Ok(())
}

/// The scenario of a board's flash, checked as a whole.
///
/// # Errors
/// The first reason why it is refused.
pub fn load(
    bytes: &[u8],
    board: &str,
    timer_clock_hz: u32,
) -> Result<Scenario<f32>, ConfigurationError> {
    let scenario = decode(bytes, board)?;
    if scenario.servo.timer_clock_hz != timer_clock_hz as f32 {
        let found_hz = scenario.servo.timer_clock_hz;
        return Err(ConfigurationError::TimerClock(found_hz));
    }
    scenario.validate().map_err(ConfigurationError::Invalid)?;
    Ok(scenario)
}
