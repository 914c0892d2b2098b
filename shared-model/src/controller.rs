//! The controller: the driver's request becomes the motor's share of the servo voltage, the wheel
//! speed the dither's amplitude, and the yaw rate a feedback's share, by what is to suppress the
//! chaos. The gate that guards it shares no code with it.

mod feedback;

use crate::Real;
use crate::ecu_schedule::Table;
use crate::limit::within;
use crate::scenario::Scenario;
use crate::signal::Measurement;
use feedback::OrbitFeedback;

/// Command of the controller until the next control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command<T> {
    /// Motor's share of the servo voltage, V.
    pub motor_v: T,
    /// The delayed feedback's share, V.
    pub feedback_v: T,
    /// Amplitude of the dither, V.
    pub dither_amplitude_v: T,
}

impl<T: Real> Command<T> {
    /// No voltage, no dither.
    pub fn neutral() -> Self {
        Self {
            motor_v: T::zero(),
            feedback_v: T::zero(),
            dither_amplitude_v: T::zero(),
        }
    }
}

/// The controller, run once per control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controller<T: Real> {
    schedule: Table<T>,
    /// Wheel speeds below which the dither is switched off, and from which on it is switched on, rpm.
    off_below_rpm: T,
    on_from_rpm: T,
    ticks_to_dither: u32,
    dither_on: bool,
    amplitude_v: T,
    /// Greatest change of the amplitude in a control tick, V.
    amplitude_step_v: T,
    motor_current_a: T,
    /// Greatest magnitude of the motor current, and its greatest change in a control tick, A.
    current_limit_a: T,
    current_step_a: T,
    winding_resistance_ohm: T,
    feedback: Option<OrbitFeedback<T>>,
}

impl<T: Real> Controller<T> {
    /// The controller of a scenario.
    pub fn new(scenario: &Scenario<T>) -> Self {
        let (policy, rate_hz) = (&scenario.controller, scenario.run.control_rate_hz);
        let schedule = Table::of(scenario.suppressing_waveform());
        let ticks_to_start = (scenario.dither.start_time_s * rate_hz + T::from_f64(0.5)).to_u32();
        let period_s = T::one() / rate_hz;
        Self {
            schedule,
            off_below_rpm: policy.dither_off_below_rpm,
            on_from_rpm: policy.dither_off_below_rpm + policy.hysteresis_rpm,
            ticks_to_dither: ticks_to_start,
            dither_on: false,
            amplitude_v: T::zero(),
            amplitude_step_v: schedule.peak_v() / (policy.dither_ramp_s * rate_hz),
            motor_current_a: T::zero(),
            current_limit_a: policy.motor_current_a,
            current_step_a: policy.motor_slew_a_per_s * period_s,
            winding_resistance_ohm: scenario.servo.winding_resistance_ohm,
            feedback: policy
                .suppression
                .has_feedback()
                .then(|| OrbitFeedback::new(scenario, ticks_to_start)),
        }
    }

    /// A control tick with the latest valid measurement, which may be that of an earlier tick.
    pub fn run(&mut self, measurement: &Measurement<T>, is_new: bool) -> Command<T> {
        let speed_rpm = measurement.wheel_speed_rpm;
        self.switch_dither(speed_rpm);
        let wanted_v = if self.dither_on {
            self.schedule.amplitude_v(speed_rpm)
        } else {
            T::zero()
        };
        self.amplitude_v = towards(self.amplitude_v, wanted_v, self.amplitude_step_v);

        let limit_a = self.current_limit_a;
        let request_a = within(measurement.current_request_a, (-limit_a, limit_a));
        self.motor_current_a = towards(self.motor_current_a, request_a, self.current_step_a);
        let motor_v = self.motor_current_a * self.winding_resistance_ohm;
        let feedback_v = match &mut self.feedback {
            Some(feedback) => feedback.run(measurement, is_new, motor_v),
            None => T::zero(),
        };
        Command {
            motor_v,
            feedback_v,
            dither_amplitude_v: self.amplitude_v,
        }
    }

    /// The controller with another schedule.
    #[cfg(test)]
    pub(crate) fn with_schedule(mut self, schedule: Table<T>) -> Self {
        self.schedule = schedule;
        self
    }

    fn switch_dither(&mut self, speed_rpm: T) {
        if self.ticks_to_dither > 0 {
            self.ticks_to_dither -= 1;
            return;
        }
        if speed_rpm < self.off_below_rpm {
            self.dither_on = false;
        } else if speed_rpm >= self.on_from_rpm {
            self.dither_on = true;
        }
    }
}

/// `value` moved to `target` by at most `step`.
fn towards<T: Real>(value: T, target: T, step: T) -> T {
    within(target, (value - step, value + step))
}
