//! The controller's delayed feedback of the yaw rate, by wheel speed.

use super::limit::within;
use crate::Real;
use crate::delayed_feedback::table::{DITHERED, POINTS, UNDITHERED};
use crate::delayed_feedback::{DelayedFeedback, LINE_LEN, Law, OrbitSchedule, spacing_ticks};
use crate::dither::Waveform;
use crate::scenario::Scenario;
use crate::signal::Measurement;

/// Holds the orbit of one cycle at the measured wheel speed by a share of the servo voltage, which vanishes on
/// the orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OrbitFeedback<T> {
    feedback: DelayedFeedback<T, LINE_LEN>,
    schedule: OrbitSchedule<T, POINTS>,
    rate_hz: T,
    hysteresis_rpm: T,
    ticks_to_start: u32,
    is_on: bool,
    volts_per_nm: T,
    /// Greatest change in a control tick, V.
    step_v: T,
    voltage_v: T,
}

impl<T: Real> OrbitFeedback<T> {
    /// The feedback of a scenario, off for that many ticks.
    pub fn new(scenario: &Scenario<T>, ticks_to_start: u32) -> Self {
        let (policy, rate_hz) = (&scenario.controller, scenario.run.control_rate_hz);
        let volts_per_nm = scenario.motor_v_per_nm();
        let schedule = match scenario.suppressing_waveform() {
            Waveform::None => UNDITHERED,
            Waveform::Square | Waveform::Sine => DITHERED,
        };
        let law = Law {
            gain: T::zero(),
            delay_ticks: T::one(),
            memory: T::zero(),
            limit_nm: policy.feedback_torque_nm,
            adaptation: policy.feedback_adaptation_s3_per_rad2 * rate_hz,
        };
        Self {
            feedback: DelayedFeedback::new(law, spacing_ticks(rate_hz.to_u32())),
            schedule: schedule.map(&|value| T::from_f64(value.into())),
            rate_hz,
            hysteresis_rpm: policy.hysteresis_rpm,
            ticks_to_start,
            is_on: false,
            volts_per_nm,
            step_v: policy.feedback_slew_nm_per_s * volts_per_nm / rate_hz,
            voltage_v: T::zero(),
        }
    }

    /// A control tick: the feedback's share of the servo voltage, V, within `room_v`, which includes 0. While
    /// there is no new measurement it stays, and the line takes the last one.
    pub fn run(&mut self, measurement: &Measurement<T>, is_new: bool, room_v: (T, T)) -> T {
        let yaw_rate = measurement.yaw_rate_rad_per_s;
        self.switch(measurement.wheel_speed_rpm);
        let tuning = self.schedule.at(measurement.wheel_speed_rpm);
        let wanted_v = match tuning.filter(|_| self.is_on) {
            Some(tuning) if is_new => {
                self.feedback
                    .tune(tuning.gain, tuning.period_s * self.rate_hz);
                self.feedback.run(yaw_rate) * self.volts_per_nm
            }
            Some(_) => {
                self.feedback.observe(yaw_rate);
                self.voltage_v
            }
            None => {
                self.feedback.observe(yaw_rate);
                T::zero()
            }
        };
        let wanted_v = within(wanted_v, room_v);
        let (least_v, most_v) = (self.voltage_v - self.step_v, self.voltage_v + self.step_v);
        self.voltage_v = within(wanted_v, (least_v, most_v));
        self.voltage_v
    }

    fn switch(&mut self, speed_rpm: T) {
        if self.ticks_to_start > 0 {
            self.ticks_to_start -= 1;
            return;
        }
        let (first_rpm, last_rpm) = (self.schedule.first_rpm, self.schedule.last_rpm());
        let margin_rpm = self.hysteresis_rpm;
        if speed_rpm < first_rpm || speed_rpm > last_rpm {
            self.is_on = false;
        } else if !self.is_on
            && speed_rpm >= first_rpm + margin_rpm
            && speed_rpm <= last_rpm - margin_rpm
        {
            self.is_on = true;
            // What it has adapted to before is not the period at this speed.
            self.feedback.restart();
        }
    }
}
