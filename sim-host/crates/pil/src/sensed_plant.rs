//! The vehicle with its sensors: a duty in once per PWM period, a measurement out once per control
//! tick.
//!
//! An ECU starts with a neutral servo and slews to the driver's request. During this lead-in the
//! vehicle is held in its initial state with its sensors on, so that the slew is complete when the
//! manoeuvre begins.

use super::manoeuvre::Manoeuvre;
use super::plant::{InvalidPlant, Plant};
use super::sensor::Sensors;
use shared_model::Scenario;
use shared_model::frame::SENSOR_STATE_MACHINE;
use shared_model::servo::Duty;
use shared_model::signal::Measurement;

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

/// PWM periods of the lead-in.
pub fn lead_in_periods(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> u32 {
    let ticks = lead_in_ticks(scenario, manoeuvre);
    scenario.periods_per_tick().saturating_mul(ticks)
}

/// Those ticks in which the ECU is active.
pub(crate) fn active_lead_in_ticks(scenario: &Scenario<f64>, manoeuvre: &Manoeuvre) -> u32 {
    lead_in_ticks(scenario, manoeuvre).saturating_sub(START_TICKS)
}

/// The vehicle and its sensors.
#[derive(Debug, Clone)]
pub struct SensedPlant {
    plant: Plant,
    sensors: Sensors,
    period_counts: u16,
    periods_per_tick: u32,
    /// PWM periods from the ECU's start.
    periods: u32,
    lead_in_periods: u32,
}

impl SensedPlant {
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
            periods_per_tick,
            periods: 0,
            lead_in_periods: lead_in_periods(scenario, manoeuvre),
        })
    }

    /// One PWM period under a duty code of the servo, whose bridge is on or off. A code above the
    /// period counts as the period. Returns the measurement if a control tick ends with it.
    pub fn period(&mut self, duty_code: u16, bridge_on: bool) -> Option<Measurement<f32>> {
        let is_tick = self.is_tick_next();
        self.periods += 1;
        // Without the bridge no voltage is applied, whatever the pin shows.
        let duty = if bridge_on {
            Duty::new(duty_code.min(self.period_counts), self.period_counts)
                .expect("the code is at most the period")
        } else {
            self.plant.pwm().neutral()
        };
        if self.has_begun() {
            self.plant.step(duty);
        }
        is_tick.then(|| self.sensors.sample(&self.plant.truth()))
    }

    /// Whether a control tick ends with the next period.
    pub(crate) fn is_tick_next(&self) -> bool {
        (self.periods + 1).is_multiple_of(self.periods_per_tick)
    }

    /// As [`Plant::set_driver`].
    pub fn set_driver(&mut self, wheel_speed_rpm: f64, current_request_a: f64) {
        self.plant.set_driver(wheel_speed_rpm, current_request_a);
    }

    /// As [`Plant::set_wheel_speed_limit_rpm`].
    pub fn set_wheel_speed_limit_rpm(&mut self, limit_rpm: f64) {
        self.plant.set_wheel_speed_limit_rpm(limit_rpm);
    }

    /// Greatest duty code: the counts of a PWM period.
    pub fn period_counts(&self) -> u16 {
        self.period_counts
    }

    /// PWM periods from the ECU's start to the manoeuvre's end.
    pub fn total_periods(&self) -> u32 {
        self.lead_in_periods + self.plant.total_periods()
    }

    /// Whether the lead-in is over.
    pub fn has_begun(&self) -> bool {
        self.periods > self.lead_in_periods
    }

    /// PWM periods from the ECU's start.
    pub fn periods(&self) -> u32 {
        self.periods
    }

    /// The vehicle.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }
}
