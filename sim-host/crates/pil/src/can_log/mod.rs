//! The frames of a drive as logs of a CAN FD bus, in the formats of SocketCAN's `candump -l` and
//! of Vector's ASC. `docs/dithersteer.dbc` names their signals.

mod read;
mod replay;

pub use read::{LogError, Reader};
pub use replay::{ReplayError, Row, Summary, replay};

use crate::closed_loop::Exchange;
use shared_model::bus::Message;
use std::io::Write;
use std::path::Path;

/// CAN database that names the signals of the frames.
pub const DATABASE: &str = include_str!("../../dithersteer.dbc");

/// A frame of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Time since an origin of the log's own, s.
    pub time_s: f64,
    /// Identifier, of 11 or 29 bits.
    pub identifier: u32,
    /// Payload, at most 64 bytes.
    pub data: Vec<u8>,
}

/// Format of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// SocketCAN's `candump -l`.
    Candump,
    /// Vector's ASC.
    Asc,
}

impl Format {
    /// By the file's name: ASC for `.asc`, else that of candump.
    pub fn of(path: &Path) -> Self {
        match path.extension() {
            Some(extension) if extension.eq_ignore_ascii_case("asc") => Self::Asc,
            _ => Self::Candump,
        }
    }
}

/// Writes the frames of a run from its start on: the ECU's at the start of a PWM period, the
/// vehicle's at its end. The bit rate is switched.
///
/// # Errors
/// If the writer fails.
pub fn write(
    exchanges: &[Exchange],
    pwm_rate_hz: f64,
    format: Format,
    to: &mut dyn Write,
) -> std::io::Result<()> {
    if format == Format::Asc {
        writeln!(to, "date Thu Jan 1 12:00:00.000 am 1970")?;
        writeln!(to, "base hex  timestamps absolute")?;
        writeln!(to, "internal events logged")?;
    }
    for (period, exchange) in exchanges.iter().enumerate() {
        let start_s = period as f64 / pwm_rate_hz;
        let end_s = (period + 1) as f64 / pwm_rate_hz;
        let frames = [
            (start_s, Message::Actuator, exchange.from_ecu.frame),
            (end_s, Message::Sensor, exchange.to_ecu.frame),
        ];
        for (time_s, message, frame) in frames {
            let Some(frame) = frame else { continue };
            let identifier = message.can_identifier();
            match format {
                Format::Candump => {
                    write!(to, "({time_s:017.6}) can0 {identifier:03X}##1")?;
                    frame.iter().try_for_each(|byte| write!(to, "{byte:02X}"))?;
                }
                Format::Asc => {
                    let direction = "Rx";
                    write!(to, "{time_s:.6} CANFD   1 {direction}   {identifier:>8x}  ")?;
                    // No name; the bit rate is switched, no error; 24 bytes are code c.
                    write!(to, "{:>32} 1 0 c {}", "", frame.len())?;
                    frame
                        .iter()
                        .try_for_each(|byte| write!(to, " {byte:02x}"))?;
                    // Duration, length and flags (FD, bit rate switched); checksum and bit timing
                    // are not known.
                    write!(to, " {:>8} {:>4} {:>8X} 0 0 0 0 0", 0, 0, 0x3000)?;
                }
            }
            writeln!(to)?;
        }
    }
    Ok(())
}
