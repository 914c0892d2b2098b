//! The link to the host that stands in for servo and sensors: one exchange a PWM period.

use crate::board::{Board, Current};
use crate::host_file::HostFile;
use shared_model::exchange::{TO_ECU_LEN, ToEcu, ToHost};
use shared_model::serial::{self, Deframer};

/// Named pipes of the host, in its working directory.
const TO_HOST: &str = "to-host";
const TO_ECU: &str = "to-ecu";
/// Polls of an empty UART after which the host counts as gone: some seconds of an emulator.
const PATIENCE_POLLS: u32 = 400_000_000;

/// A link, open.
pub enum Link {
    /// The emulator's files: the fast one. The core stands still while the host answers.
    Files {
        /// To the host.
        to_host: HostFile,
        /// From the host.
        to_ecu: HostFile,
    },
    /// A UART: framed bytes, each with the time that the emulator takes for it.
    Uart(Deframer),
}

/// The host does not answer, or not as it should.
#[derive(Debug, Clone, Copy)]
pub struct LinkLost;

impl Link {
    /// Opens the link of that name, `files` or `uart`.
    ///
    /// # Errors
    /// If there is none of that name, or the host has not opened its end.
    pub fn open(name: &str) -> Result<Self, LinkLost> {
        match name {
            "files" => Ok(Self::Files {
                to_host: HostFile::create(TO_HOST).map_err(|_| LinkLost)?,
                to_ecu: HostFile::open(TO_ECU).map_err(|_| LinkLost)?,
            }),
            "uart" => {
                Current::open_uart();
                Ok(Self::Uart(Deframer::new()))
            }
            _ => Err(LinkLost),
        }
    }

    /// Sends and waits for the answer. No time passes for the ECU meanwhile: its clock, its watchdog and its PWM interrupt
    /// wait with it.
    ///
    /// # Errors
    /// If no answer comes, or a damaged one.
    pub fn exchange(&mut self, sent: &ToHost) -> Result<ToEcu, LinkLost> {
        let mut answer = [0; TO_ECU_LEN];
        match self {
            Self::Files { to_host, to_ecu } => {
                to_host.write(&sent.encode()).map_err(|_| LinkLost)?;
                to_ecu.read(&mut answer).map_err(|_| LinkLost)?;
            }
            Self::Uart(deframer) => {
                Current::pause_time();
                serial::frame(&sent.encode(), Current::uart_send);
                let received = receive(deframer, &mut answer);
                Current::resume_time();
                received?;
            }
        }
        Ok(ToEcu::decode(&answer))
    }
}

fn receive(deframer: &mut Deframer, answer: &mut [u8; TO_ECU_LEN]) -> Result<(), LinkLost> {
    let mut polls = 0;
    while polls < PATIENCE_POLLS {
        let Some(byte) = Current::uart_receive() else {
            polls += 1;
            continue;
        };
        match deframer.push(byte) {
            serial::Received::Nothing => {}
            serial::Received::Damaged => return Err(LinkLost),
            serial::Received::Body(body) => {
                answer.copy_from_slice(body.get(..TO_ECU_LEN).ok_or(LinkLost)?);
                return Ok(());
            }
        }
    }
    Err(LinkLost)
}
