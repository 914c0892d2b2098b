//! The ECU's program as a node of signals: measurements in, duty and actuation out. It takes the
//! place of the bus: sensor and actuator frames with counter, checksum, challenge and echo are as
//! between ECU and vehicle, and the duty on the servo's pin is the ECU's own.

use super::ecu::{CLOCK_HZ, counts_per_tick};
use shared_model::e2e::Sender;
use shared_model::ecu::{Begun, Ecu};
use shared_model::exchange::{FrameBytes, Packet};
use shared_model::frame::{SENSOR_DATA_ID, decode_actuation, encode_measurement};
use shared_model::signal::{Actuation, Measurement};
use shared_model::{InvalidScenario, Scenario};

/// The output in a PWM period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EcuOutput {
    /// Duty code of the period.
    pub duty_code: u16,
    /// Whether the servo's bridge is on.
    pub bridge_on: bool,
    /// Content of the last actuator frame; `None` before the first.
    pub actuation: Option<Actuation<f32>>,
}

/// The ECU's program, with ideal clock, bus and servo.
#[derive(Debug, Clone)]
pub struct EcuNode {
    ecu: Ecu<f32>,
    sender: Sender,
    begun: Begun,
    actuation: Option<Actuation<f32>>,
    counts_per_tick: u32,
}

impl EcuNode {
    /// The program of a scenario, its first PWM period begun.
    ///
    /// # Errors
    /// If the scenario is invalid.
    pub fn new(scenario: &Scenario<f32>) -> Result<Self, InvalidScenario> {
        let mut ecu = Ecu::new(scenario, CLOCK_HZ)?;
        let begun = ecu.begin();
        Ok(Self {
            ecu,
            sender: Sender::new(SENSOR_DATA_ID),
            actuation: content(begun.packet.frame),
            begun,
            counts_per_tick: counts_per_tick(scenario),
        })
    }

    /// Ends the PWM period, and begins the next one. At a control tick the ECU reads the measurement
    /// of this time.
    pub fn period(&mut self, measurement: &Measurement<f32>) {
        let challenge = self.actuation.map_or(0, |actuation| actuation.challenge);
        let frame = self
            .begun
            .control_due
            .then(|| encode_measurement(measurement, challenge, &mut self.sender));
        let reply = Packet {
            frame,
            ..self.begun.packet
        };
        self.ecu.end(&self.begun, &reply, || self.counts_per_tick);
        self.begun = self.ecu.begin();
        self.actuation = content(self.begun.packet.frame).or(self.actuation);
    }

    /// The output in the present period.
    pub fn output(&self) -> EcuOutput {
        self.output_of(&self.begun)
    }

    /// The output in the next period, which the measurement at its start does not change. (With a
    /// control tick in every period, the actuation is that of the period before.)
    pub fn next_output(&self) -> EcuOutput {
        self.output_of(&self.ecu.ahead())
    }

    fn output_of(&self, begun: &Begun) -> EcuOutput {
        EcuOutput {
            duty_code: begun.packet.duty_code,
            bridge_on: begun.packet.bridge_on,
            actuation: content(begun.packet.frame).or(self.actuation),
        }
    }
}

/// Content of a frame of this ECU, whose mode is known.
fn content(frame: Option<FrameBytes>) -> Option<Actuation<f32>> {
    decode_actuation(&frame?).ok()
}
