//! The link to the host in place of servo and sensors: one exchange per PWM period or per control
//! tick.

use super::counters;
use super::host_file::HostFile;
use super::pace::Pace;
use shared_model::exchange::{Packet, TO_ECU_LEN, ToEcu, ToHost};
use shared_model::tick_exchange::{TICK_TO_ECU_LEN, TickToEcu, TickToHost};

/// Named pipes of the host, in its working directory.
const TO_HOST: &str = "to-host";
const TO_ECU: &str = "to-ecu";

/// Name of the link without measurements of the PWM interrupt.
const TICKS: &str = "ticks";

/// A link, open. The core stands still while the host answers.
pub struct Link {
    to_host: HostFile,
    to_ecu: HostFile,
    /// The message of the control tick; `None` with an exchange per PWM period. In its own place:
    /// it is far larger than the program that gathers it.
    tick: Option<&'static mut TickToHost>,
    /// The source of the PWM periods' timing.
    pub pace: Pace,
}

/// The host does not answer, or not as it should.
#[derive(Debug, Clone, Copy)]
pub struct LinkLost;

impl Link {
    /// Opens the link of that name: `ticks` (the emulator's files, an exchange per control tick, at
    /// the host's pace), `ticks-measured` (the same, with the cost of the PWM interrupt), `files` (an
    /// exchange per PWM period) or `timed` (the same at the timer's
    /// pace).
    ///
    /// # Errors
    /// If there is none of that name, or the host has not opened its end.
    pub fn open(name: &str) -> Result<Self, LinkLost> {
        let (pace, tick) = match name {
            TICKS | "ticks-measured" => {
                if name == TICKS {
                    counters::leave_pwm_unmeasured();
                }
                let tick = cortex_m::singleton!(: TickToHost = TickToHost::new());
                (Pace::Host, Some(tick.ok_or(LinkLost)?))
            }
            "files" => (Pace::Host, None),
            "timed" => (Pace::Timer, None),
            _ => return Err(LinkLost),
        };
        Ok(Self {
            to_host: HostFile::create(TO_HOST).map_err(|_| LinkLost)?,
            to_ecu: HostFile::open(TO_ECU).map_err(|_| LinkLost)?,
            tick,
            pace,
        })
    }

    /// Sends and waits for the answer. With an exchange per control tick, a period that is not the
    /// tick's last is only gathered. The captured duty is then the pin's own.
    ///
    /// # Errors
    /// If no answer comes.
    pub fn exchange(&mut self, sent: &ToHost, control_due: bool) -> Result<ToEcu, LinkLost> {
        let Some(tick) = &mut self.tick else {
            let mut answer = [0; TO_ECU_LEN];
            self.to_host.write(&sent.encode()).map_err(|_| LinkLost)?;
            self.to_ecu.read(&mut answer).map_err(|_| LinkLost)?;
            return Ok(ToEcu::decode(&answer));
        };
        let mut received = TickToEcu {
            frame: None,
            stop: false,
        };
        if control_due {
            let mut answer = [0; TICK_TO_ECU_LEN];
            self.to_host
                .write(tick.finish(sent))
                .map_err(|_| LinkLost)?;
            self.to_ecu.read(&mut answer).map_err(|_| LinkLost)?;
            received = TickToEcu::decode(&answer);
        } else {
            tick.push(&sent.packet);
        }
        Ok(ToEcu {
            packet: Packet {
                frame: received.frame,
                ..sent.packet
            },
            stop: received.stop,
        })
    }
}
