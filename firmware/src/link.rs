//! The link to the host in place of servo and sensors: one exchange per PWM period.

use crate::board::{Board, Current};
use crate::host_file::HostFile;
use shared_model::exchange::{TO_ECU_LEN, ToEcu, ToHost};
use shared_model::serial::{self, Deframer};

/// Named pipes of the host, in its working directory.
const TO_HOST: &str = "to-host";
const TO_ECU: &str = "to-ecu";
/// Polls of an empty UART after which the host counts as gone: some seconds of an emulator.
const PATIENCE_POLLS: u32 = 10_000_000;
/// Clocks between two polls: without them an emulator spends its time on the polls and not on the
/// bytes.
const POLL_CLOCKS: u32 = 1000;

/// A link, open.
pub struct Link {
    transport: Transport,
    /// The source of the PWM periods' timing.
    pub pace: Pace,
}

enum Transport {
    /// The emulator's files. The core stands still while the host answers.
    Files { to_host: HostFile, to_ecu: HostFile },
    /// A UART: framed bytes.
    Uart(Deframer),
}

/// The source of the PWM periods' timing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// The host: a period begins when the last one is answered, and each takes its nominal time.
    /// The emulator then has no time to pass.
    Host,
    /// The board's timer, by whose clock the gate measures the control ticks.
    Timer,
}

/// The host does not answer, or not as it should.
#[derive(Debug, Clone, Copy)]
pub struct LinkLost;

impl Link {
    /// Opens the link of that name: `files` (the emulator's files, at the host's pace), `timed`
    /// (the same at the timer's), or `uart` (at the host's).
    ///
    /// # Errors
    /// If there is none of that name, or the host has not opened its end.
    pub fn open(name: &str) -> Result<Self, LinkLost> {
        let (transport, pace) = match name {
            "files" => (Transport::files()?, Pace::Host),
            "timed" => (Transport::files()?, Pace::Timer),
            "uart" => (Transport::uart(), Pace::Host),
            _ => return Err(LinkLost),
        };
        Ok(Self { transport, pace })
    }

    /// Sends and waits for the answer.
    ///
    /// # Errors
    /// If no answer comes, or a damaged one.
    pub fn exchange(&mut self, sent: &ToHost) -> Result<ToEcu, LinkLost> {
        let mut answer = [0; TO_ECU_LEN];
        match &mut self.transport {
            Transport::Files { to_host, to_ecu } => {
                to_host.write(&sent.encode()).map_err(|_| LinkLost)?;
                to_ecu.read(&mut answer).map_err(|_| LinkLost)?;
            }
            Transport::Uart(deframer) => {
                serial::frame(&sent.encode(), Current::uart_send);
                receive(deframer, &mut answer)?;
            }
        }
        Ok(ToEcu::decode(&answer))
    }
}

impl Transport {
    fn files() -> Result<Self, LinkLost> {
        Ok(Self::Files {
            to_host: HostFile::create(TO_HOST).map_err(|_| LinkLost)?,
            to_ecu: HostFile::open(TO_ECU).map_err(|_| LinkLost)?,
        })
    }

    fn uart() -> Self {
        Current::open_uart();
        Self::Uart(Deframer::new())
    }
}

fn receive(deframer: &mut Deframer, answer: &mut [u8; TO_ECU_LEN]) -> Result<(), LinkLost> {
    let mut polls = 0;
    while polls < PATIENCE_POLLS {
        let Some(byte) = Current::uart_receive() else {
            polls += 1;
            cortex_m::asm::delay(POLL_CLOCKS);
            // Not late: the host is the clock.
            Current::feed_watchdog();
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
