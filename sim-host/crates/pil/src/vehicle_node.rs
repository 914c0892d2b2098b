//! The vehicle as the node that answers the ECU once per PWM period: plant, sensors and frames.

use super::disturbance::{Disturbance, Undisturbed};
use super::manoeuvre::Manoeuvre;
use super::plant::{InvalidPlant, Plant};
use super::record::Record;
use super::sensed_plant::{SensedPlant, active_lead_in_ticks};
use shared_model::Scenario;
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::exchange::{FrameBytes, Packet};
use shared_model::frame::{
    ACTUATOR_DATA_ID, MAX_DELTA_COUNTER, SENSOR_DATA_ID, decode_actuation, encode_measurement,
};
use shared_model::signal::Actuation;

/// The ECU's scenario: its dither starts later by the lead-in from the ECU's activation on.
pub fn ecu_scenario(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Scenario<f32> {
    let mut own = *scenario;
    let active_ticks = active_lead_in_ticks(scenario, manoeuvre);
    own.dither.start_time_s += f64::from(active_ticks) / scenario.run.control_rate_hz;
    own.map(&|value| value as f32)
}

/// The vehicle's node on the link.
#[derive(Debug, Clone)]
pub struct VehicleNode {
    vehicle: SensedPlant,
    sender: Sender,
    receiver: Receiver,
    actuation: Option<Actuation<f32>>,
    frame_status: Status,
}

impl VehicleNode {
    /// At the start of a manoeuvre.
    ///
    /// # Errors
    /// If the scenario or the manoeuvre is invalid.
    pub fn new(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Result<Self, InvalidPlant> {
        Ok(Self {
            vehicle: SensedPlant::new(scenario, manoeuvre)?,
            sender: Sender::new(SENSOR_DATA_ID),
            receiver: Receiver::new(ACTUATOR_DATA_ID, MAX_DELTA_COUNTER),
            actuation: None,
            frame_status: Status::NoNewData,
        })
    }

    /// Takes the ECU's packet for a period and integrates the plant over it. Answers with the duty
    /// on the servo's pin and, at a control tick, a sensor frame.
    pub fn answer(&mut self, from_ecu: &Packet) -> Packet {
        self.answer_through(&mut Undisturbed, from_ecu)
    }

    /// The same, with a disturbance between vehicle and ECU.
    pub fn answer_through(
        &mut self,
        disturbance: &mut dyn Disturbance,
        from_ecu: &Packet,
    ) -> Packet {
        let frame = disturbance.actuator_frame(from_ecu.frame);
        if self.vehicle.is_tick_next() || frame.is_some() {
            self.take(frame.as_ref());
        }
        let codes = disturbance.duty(from_ecu.duty_code);
        // The duty of the servo's driver cannot exceed its period.
        let captured = codes.captured.min(self.vehicle.period_counts());
        let measured = self.vehicle.period(codes.driven, from_ecu.bridge_on);
        let frame = measured.map(|measured| {
            // The frame is sent now, however old its measurement is.
            let challenge = self.actuation.map_or(0, |actuation| actuation.challenge);
            let measurement = disturbance.measurement(measured);
            encode_measurement(&measurement, challenge, &mut self.sender)
        });
        Packet {
            duty_code: captured,
            bridge_on: from_ecu.bridge_on,
            frame: disturbance.sensor_frame(frame),
        }
    }

    fn take(&mut self, frame: Option<&FrameBytes>) {
        self.frame_status = self.receiver.check(frame);
        let Some(frame) = frame.filter(|_| self.frame_status.is_ok()) else {
            return;
        };
        if let Ok(actuation) = decode_actuation(frame) {
            let limit_rpm = f64::from(actuation.wheel_speed_limit_rpm);
            self.vehicle.set_wheel_speed_limit_rpm(limit_rpm);
            self.actuation = Some(actuation);
        }
    }

    /// PWM periods from the ECU's start to the manoeuvre's end.
    pub fn total_periods(&self) -> u32 {
        self.vehicle.total_periods()
    }

    /// Whether the lead-in is over.
    pub(crate) fn has_begun(&self) -> bool {
        self.vehicle.has_begun()
    }

    /// Content of the ECU's last valid frame.
    pub fn actuation(&self) -> Option<&Actuation<f32>> {
        self.actuation.as_ref()
    }

    /// Status of the last check of an actuator frame; one is due at every control tick.
    pub(crate) fn frame_status(&self) -> Status {
        self.frame_status
    }

    /// PWM periods from the ECU's start.
    pub fn periods(&self) -> u32 {
        self.vehicle.periods()
    }

    /// The vehicle.
    pub fn plant(&self) -> &Plant {
        self.vehicle.plant()
    }

    /// The present state, for recording.
    pub fn record(&self) -> Record {
        self.vehicle.plant().record()
    }
}
