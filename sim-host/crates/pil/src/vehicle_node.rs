//! The vehicle as the node that answers the ECU once per PWM period: plant, sensors and frames.
//!
//! An ECU starts with a neutral servo and slews to the driver's request. During this lead-in the
//! vehicle is held in its initial state with its sensors on, so that the slew is complete when the
//! manoeuvre begins.

use super::disturbance::{Disturbance, Undisturbed};
use super::manoeuvre::Manoeuvre;
use super::plant::{InvalidPlant, Plant};
use super::record::Record;
use super::sensor::Sensors;
use shared_model::Scenario;
use shared_model::e2e::{Receiver, Sender, Status};
use shared_model::exchange::{FrameBytes, Packet};
use shared_model::frame::{
    ACTUATOR_DATA_ID, MAX_DELTA_COUNTER, SENSOR_DATA_ID, SENSOR_STATE_MACHINE, decode_actuation,
    encode_measurement,
};
use shared_model::servo::Duty;
use shared_model::signal::Actuation;

/// Control ticks of the lead-in beside the slew: until the ECU is active, and spare.
const SPARE_TICKS: f64 = 20.0;
/// The first of them, before the ECU uses a frame: one without an answer to its first frame, one that
/// begins the communication, and all but the last of the good frames that it requires.
const START_TICKS: u32 = 1 + SENSOR_STATE_MACHINE.min_ok_init as u32;

/// Control ticks of the lead-in.
fn lead_in_ticks(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> u32 {
    let request_a = manoeuvre.current_request_at(0.0).abs();
    let slewing_s = request_a / scenario.controller.motor_slew_a_per_s;
    (slewing_s * scenario.run.control_rate_hz + SPARE_TICKS).ceil() as u32
}

/// The ECU's scenario: its dither starts later by the lead-in from the ECU's activation on.
pub fn ecu_scenario(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Scenario<f32> {
    let mut own = *scenario;
    let active_ticks = lead_in_ticks(scenario, manoeuvre).saturating_sub(START_TICKS);
    own.dither.start_time_s += f64::from(active_ticks) / scenario.run.control_rate_hz;
    own.map(&|value| value as f32)
}

/// The vehicle's node on the link.
#[derive(Debug, Clone)]
pub struct VehicleNode {
    plant: Plant,
    sensors: Sensors,
    sender: Sender,
    receiver: Receiver,
    period_counts: u16,
    periods_per_tick: u32,
    /// PWM periods from the ECU's start.
    periods: u32,
    lead_in_periods: u32,
    actuation: Option<Actuation<f32>>,
    frame_status: Status,
}

impl VehicleNode {
    /// At the start of a manoeuvre.
    ///
    /// # Errors
    /// If the scenario or the manoeuvre is invalid.
    pub fn new(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> Result<Self, InvalidPlant> {
        let plant = Plant::new(scenario, manoeuvre)?;
        let periods_per_tick = scenario.periods_per_tick();
        Ok(Self {
            period_counts: plant.pwm().neutral().period(),
            plant,
            sensors: Sensors::new(&manoeuvre.sensors),
            sender: Sender::new(SENSOR_DATA_ID),
            receiver: Receiver::new(ACTUATOR_DATA_ID, MAX_DELTA_COUNTER),
            periods_per_tick,
            periods: 0,
            lead_in_periods: periods_per_tick * lead_in_ticks(scenario, manoeuvre),
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
        self.periods += 1;
        let is_tick = self.periods.is_multiple_of(self.periods_per_tick);
        let frame = disturbance.actuator_frame(from_ecu.frame);
        if is_tick || frame.is_some() {
            self.take(frame.as_ref());
        }
        let codes = disturbance.duty(from_ecu.duty_code);
        // The duty of the servo's driver cannot exceed its period.
        let [driven, captured] =
            [codes.driven, codes.captured].map(|code| code.min(self.period_counts));
        // Without the bridge no voltage is applied, whatever the pin shows.
        let duty = if from_ecu.bridge_on {
            Duty::new(driven, self.period_counts).expect("clamped to the period above")
        } else {
            self.plant.pwm().neutral()
        };
        if self.has_begun() {
            self.plant.step(duty);
        }
        let frame = is_tick.then(|| {
            let measured = self.sensors.sample(&self.plant.truth());
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
            self.plant.set_wheel_speed_limit_rpm(limit_rpm);
            self.actuation = Some(actuation);
        }
    }

    /// PWM periods from the ECU's start to the manoeuvre's end.
    pub fn total_periods(&self) -> u32 {
        self.lead_in_periods + self.plant.total_periods()
    }

    /// Whether the lead-in is over.
    pub(crate) fn has_begun(&self) -> bool {
        self.periods > self.lead_in_periods
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
        self.periods
    }

    /// The vehicle.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The present state, for recording.
    pub fn record(&self) -> Record {
        self.plant.record()
    }
}
