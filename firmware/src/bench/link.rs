//! The link to the host in place of servo and sensors: one exchange per PWM period.

use super::host_file::HostFile;
use shared_model::exchange::{TO_ECU_LEN, ToEcu, ToHost};

/// Named pipes of the host, in its working directory.
const TO_HOST: &str = "to-host";
const TO_ECU: &str = "to-ecu";

/// A link, open. The core stands still while the host answers.
pub struct Link {
    to_host: HostFile,
    to_ecu: HostFile,
    /// The source of the PWM periods' timing.
    pub pace: Pace,
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
    /// Opens the link of that name: `files` (the emulator's files, at the host's pace) or `timed`
    /// (the same at the timer's).
    ///
    /// # Errors
    /// If there is none of that name, or the host has not opened its end.
    pub fn open(name: &str) -> Result<Self, LinkLost> {
        let pace = match name {
            "files" => Pace::Host,
            "timed" => Pace::Timer,
            _ => return Err(LinkLost),
        };
        Ok(Self {
            to_host: HostFile::create(TO_HOST).map_err(|_| LinkLost)?,
            to_ecu: HostFile::open(TO_ECU).map_err(|_| LinkLost)?,
            pace,
        })
    }

    /// Sends and waits for the answer.
    ///
    /// # Errors
    /// If no answer comes.
    pub fn exchange(&mut self, sent: &ToHost) -> Result<ToEcu, LinkLost> {
        let mut answer = [0; TO_ECU_LEN];
        self.to_host.write(&sent.encode()).map_err(|_| LinkLost)?;
        self.to_ecu.read(&mut answer).map_err(|_| LinkLost)?;
        Ok(ToEcu::decode(&answer))
    }
}
