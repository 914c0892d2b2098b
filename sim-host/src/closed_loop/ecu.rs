//! The ECU that a drive has at its other end, wherever it runs.

use crate::pil::qemu::RunError;
use crate::pil::session::Session;
use shared_model::exchange::{Packet, ToEcu};
use shared_model::{InvalidScenario, Scenario, ecu};

/// An ECU in the loop.
pub trait Ecu {
    /// One PWM period: `answer` takes what the ECU put out and gives what its pins brought by the period's end.
    ///
    /// # Errors
    /// If the ECU cannot be reached.
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError>;
}

/// Software in the loop: the ECU's program on the host, in the target's arithmetic.
pub struct Software {
    ecu: ecu::Ecu<f32>,
    /// Counts of an ideal clock in a control tick.
    counts_a_tick: u32,
}

/// Counts a second of the ideal clock.
const CLOCK_HZ: u32 = 25_000_000;

impl Software {
    /// The program of a scenario.
    ///
    /// # Errors
    /// If the scenario is not valid.
    pub fn new(scenario: &Scenario<f32>) -> Result<Self, InvalidScenario> {
        Ok(Self {
            ecu: ecu::Ecu::new(scenario, CLOCK_HZ)?,
            counts_a_tick: (CLOCK_HZ as f32 / scenario.run.control_rate_hz) as u32,
        })
    }
}

impl Ecu for Software {
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError> {
        self.ecu.period(answer, || self.counts_a_tick);
        Ok(())
    }
}

/// Processor in the loop: the firmware in the emulator.
pub struct Processor(pub Session);

impl Ecu for Processor {
    fn period(&mut self, answer: &mut dyn FnMut(&Packet) -> Packet) -> Result<(), RunError> {
        let received = self.0.receive()?;
        let packet = answer(&received.packet);
        self.0.send(&ToEcu {
            packet,
            stop: false,
        })
    }
}
