//! A recorded run: the scenario and all packets between ECU and vehicle, for replay without an
//! emulator.
//!
//! The file contains a magic number, the length of the ECU's scenario as TOML, the scenario, the
//! number of PWM periods, two packets per period, and a CRC-32 of all preceding bytes. Numbers are
//! little-endian.

use super::closed_loop::Exchange;
use super::ecu::{Ecu, Software};
use shared_model::Scenario;
use shared_model::exchange::{PACKET_LEN, Packet, PacketBytes};
use std::io::Write;

/// First bytes of a recording.
pub const MAGIC: &[u8; 8] = b"DSLOOP2\n";
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
const CHECKSUM_LEN: usize = 4;

/// A recorded run.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The ECU's scenario.
    pub scenario: Scenario<f32>,
    /// One exchange per PWM period.
    pub exchanges: Vec<Exchange>,
}

/// An error of reading a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The magic number is missing.
    #[error("is not a recording of the loop; create one with `sim-host pil --record FILE`")]
    NoRecording,
    /// The file is damaged or truncated.
    #[error("is damaged or truncated: its checksum is wrong; record it again")]
    Damaged,
    /// The scenario in it cannot be read.
    #[error("has a scenario that this version cannot read: {0}")]
    Scenario(String),
    /// The scenario in it is invalid.
    #[error("has a scenario that cannot be run: {0}")]
    Invalid(#[from] shared_model::InvalidScenario),
}

impl Recording {
    /// Writes the recording.
    ///
    /// # Errors
    /// If `writer` fails.
    pub fn write(&self, writer: &mut dyn Write) -> std::io::Result<()> {
        let text = toml::to_string(&self.scenario).map_err(std::io::Error::other)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.extend((self.exchanges.len() as u32).to_le_bytes());
        for exchange in &self.exchanges {
            bytes.extend(exchange.from_ecu.encode());
            bytes.extend(exchange.to_ecu.encode());
        }
        bytes.extend(CHECKSUM.checksum(&bytes).to_le_bytes());
        writer.write_all(&bytes)
    }

    /// Reads a recording.
    ///
    /// # Errors
    /// If the bytes are not a recording or are damaged, or the scenario is invalid.
    pub fn read(bytes: &[u8]) -> Result<Self, RecordingError> {
        use RecordingError::{Damaged, NoRecording};
        let body = bytes.strip_prefix(MAGIC).ok_or(NoRecording)?;
        let (covered, stored) = bytes.split_last_chunk::<CHECKSUM_LEN>().ok_or(Damaged)?;
        if CHECKSUM.checksum(covered) != u32::from_le_bytes(*stored) {
            return Err(Damaged);
        }
        let (text, body) = take_sized(body).ok_or(Damaged)?;
        let text = std::str::from_utf8(text).map_err(|_| Damaged)?;
        let (count, body) = take_length(body).ok_or(Damaged)?;
        let (periods, rest) = body.as_chunks::<{ 2 * PACKET_LEN }>();
        if periods.len() != count || rest.len() != CHECKSUM_LEN {
            return Err(Damaged);
        }
        let scenario = dynamics::config::from_toml(text);
        let scenario = scenario.map_err(|error| RecordingError::Scenario(error.to_string()))?;
        let scenario = scenario.map(&|value| value as f32);
        scenario.validate()?;
        Ok(Self {
            scenario,
            exchanges: periods.iter().map(exchange).collect(),
        })
    }

    /// Runs the ECU's program on this host with the recorded inputs.
    ///
    /// # Errors
    /// If the scenario is invalid.
    pub fn replay(&self) -> Result<Vec<Exchange>, RecordingError> {
        let mut ecu = Software::new(&self.scenario)?;
        let mut replayed = Vec::with_capacity(self.exchanges.len());
        for recorded in &self.exchanges {
            let answer = &mut |from_ecu: &Packet| {
                replayed.push(Exchange {
                    from_ecu: *from_ecu,
                    to_ecu: recorded.to_ecu,
                });
                recorded.to_ecu
            };
            ecu.period(answer)
                .expect("a program on the host is always reached");
        }
        Ok(replayed)
    }
}

fn take_length(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    Some((u32::from_le_bytes(*length) as usize, rest))
}

fn take_sized(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = take_length(bytes)?;
    rest.split_at_checked(length)
}

fn exchange(bytes: &[u8; 2 * PACKET_LEN]) -> Exchange {
    let packet = |half: &[u8]| {
        let bytes: PacketBytes = half.try_into().expect("half of two packets");
        Packet::decode(&bytes)
    };
    let (from_ecu, to_ecu) = bytes.split_at(PACKET_LEN);
    Exchange {
        from_ecu: packet(from_ecu),
        to_ecu: packet(to_ecu),
    }
}
