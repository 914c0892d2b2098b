//! The controller's delayed feedback of the yaw rate, by wheel speed.

use crate::Real;
use crate::delayed_feedback::table::{DITHERED, POINTS, UNDITHERED};
use crate::delayed_feedback::{
    DelayedFeedback, LINE_LEN, Law, OrbitSchedule, Tuning, spacing_ticks,
};
use crate::dither::Waveform;
use crate::limit::within;
use crate::scenario::Scenario;
use crate::signal::Measurement;

/// Greatest distance of the driver's request from the current that the schedule is made for, A, for switching on and
/// for staying on. Farther off the orbit is another one, and the torque stays at its limit and can make the motion
/// greater.
const ON_WITHIN_A: f64 = 0.3;
const OFF_BEYOND_A: f64 = 0.5;

/// Holds the orbit of one cycle at the measured wheel speed by a share of the servo voltage, which vanishes on
/// the orbit.
///
/// Two are equal if all bits of their numbers are, those of the line apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct OrbitFeedback<T: Real> {
    feedback: DelayedFeedback<T, LINE_LEN>,
    schedule: &'static OrbitSchedule<f32, POINTS>,
    rate_hz: T,
    hysteresis_rpm: T,
    ticks_to_start: u32,
    is_on: bool,
    volts_per_nm: T,
    /// Greatest magnitude of both shares of the voltage together, V.
    limit_v: T,
    /// Greatest change in a control tick, V.
    step_v: T,
    voltage_v: T,
}

/// Without a branch per number: the channels of the ECU are compared in every control tick.
impl<T: Real> PartialEq for OrbitFeedback<T> {
    // Out of line: the paper's dither goes without it.
    #[inline(never)]
    fn eq(&self, other: &Self) -> bool {
        let numbers = self.rate_hz.differing_bits(other.rate_hz)
            | self.hysteresis_rpm.differing_bits(other.hysteresis_rpm)
            | self.volts_per_nm.differing_bits(other.volts_per_nm)
            | self.limit_v.differing_bits(other.limit_v)
            | self.step_v.differing_bits(other.step_v)
            | self.voltage_v.differing_bits(other.voltage_v);
        let counts = (self.ticks_to_start ^ other.ticks_to_start)
            | u32::from(self.is_on ^ other.is_on)
            | u32::from(!core::ptr::eq(self.schedule, other.schedule));
        numbers | u64::from(counts) == 0 && self.feedback == other.feedback
    }
}

impl<T: Real> OrbitFeedback<T> {
    /// The feedback of a scenario, off for that many ticks.
    pub fn new(scenario: &Scenario<T>, ticks_to_start: u32) -> Self {
        let (policy, rate_hz) = (&scenario.controller, scenario.run.control_rate_hz);
        let volts_per_nm = scenario.motor_v_per_nm();
        let law = Law {
            memory: T::zero(),
            limit_nm: policy.feedback_torque_nm,
            adaptation: policy.feedback_adaptation_s3_per_rad2 * rate_hz,
        };
        Self {
            feedback: DelayedFeedback::new(law, spacing_ticks(rate_hz.to_u32())),
            schedule: match scenario.suppressing_waveform() {
                Waveform::None => &UNDITHERED,
                Waveform::Square | Waveform::Sine => &DITHERED,
            },
            rate_hz,
            hysteresis_rpm: policy.hysteresis_rpm,
            ticks_to_start,
            is_on: false,
            volts_per_nm,
            limit_v: policy.motor_current_a * scenario.servo.winding_resistance_ohm,
            step_v: policy.feedback_slew_nm_per_s * volts_per_nm / rate_hz,
            voltage_v: T::zero(),
        }
    }

    /// A control tick: the feedback's share of the servo voltage beside the driver's, V. While there is no new
    /// measurement it stays, and the line takes the last one.
    // Out of line: the paper's dither goes without it.
    #[inline(never)]
    pub fn run(&mut self, measurement: &Measurement<T>, is_new: bool, motor_v: T) -> T {
        let yaw_rate = measurement.yaw_rate_rad_per_s;
        let tuning = if self.ticks_to_start > 0 {
            self.ticks_to_start -= 1;
            None
        } else {
            self.tuning(measurement)
        };
        if tuning.is_some() && !self.is_on {
            // What it has adapted to before is not the period at this speed.
            self.feedback.restart();
        }
        self.is_on = tuning.is_some();
        let wanted_v = match tuning {
            Some(tuning) if is_new => {
                let [gain, period_s] =
                    [tuning.gain, tuning.period_s].map(|number| T::from_f64(number.into()));
                let delay_ticks = period_s * self.rate_hz;
                self.feedback.run(yaw_rate, gain, delay_ticks) * self.volts_per_nm
            }
            Some(_) => {
                self.feedback.observe(yaw_rate);
                self.voltage_v
            }
            None => {
                self.feedback.observe(yaw_rate);
                // There is nothing left to limit.
                if self.voltage_v == T::zero() {
                    return T::zero();
                }
                T::zero()
            }
        };
        let wanted_v = within(wanted_v, (-self.limit_v - motor_v, self.limit_v - motor_v));
        let reach_v = (self.voltage_v - self.step_v, self.voltage_v + self.step_v);
        self.voltage_v = within(wanted_v, reach_v);
        self.voltage_v
    }

    /// The tuning at the wheel speed, if the feedback is to be on.
    fn tuning(&self, measurement: &Measurement<T>) -> Option<Tuning<f32>> {
        let schedule = self.schedule;
        let current_a = T::from_f64(schedule.motor_current_a.into());
        let most_a = if self.is_on {
            OFF_BEYOND_A
        } else {
            ON_WITHIN_A
        };
        if (measurement.current_request_a - current_a).abs() > T::from_f64(most_a) {
            return None;
        }
        let speed_rpm = measurement.wheel_speed_rpm.to_f64() as f32;
        let tuning = schedule.at(speed_rpm)?;
        if self.is_on {
            return Some(tuning);
        }
        let margin_rpm = self.hysteresis_rpm.to_f64() as f32;
        let range_rpm = schedule.first_rpm + margin_rpm..=schedule.last_rpm() - margin_rpm;
        range_rpm.contains(&speed_rpm).then_some(tuning)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flip(number: &mut f32) {
        *number = f32::from_bits(number.to_bits() ^ 1);
    }

    /// Also where the same bit of two of them differs.
    #[test]
    fn two_are_equal_if_their_numbers_are() {
        let one = OrbitFeedback::<f32>::new(&Scenario::reconstruction(), 3);
        assert_eq!(one, one);
        let changes: [fn(&mut OrbitFeedback<f32>); 9] = [
            |other| other.schedule = &DITHERED,
            |other| flip(&mut other.rate_hz),
            |other| flip(&mut other.hysteresis_rpm),
            |other| other.ticks_to_start ^= 1,
            |other| other.is_on ^= true,
            |other| flip(&mut other.volts_per_nm),
            |other| flip(&mut other.limit_v),
            |other| flip(&mut other.step_v),
            |other| flip(&mut other.voltage_v),
        ];
        for (place, change) in changes.iter().enumerate() {
            let mut other = one;
            change(&mut other);
            assert_ne!(one, other, "{place}");
            for (next, second) in changes.iter().enumerate().skip(place + 1) {
                let mut both = other;
                second(&mut both);
                assert_ne!(one, both, "{place} and {next}");
            }
        }
    }

    /// After these speeds (rpm) and requests (A), a tick each.
    fn is_on_after(ticks: &[(f32, f32)]) -> bool {
        let mut feedback = OrbitFeedback::new(&Scenario::<f32>::reconstruction(), 0);
        for &(wheel_speed_rpm, current_request_a) in ticks {
            let measurement = Measurement {
                wheel_speed_rpm,
                yaw_rate_rad_per_s: 0.0,
                steering_angle_rad: 0.0,
                steering_rate_rad_per_s: 0.0,
                current_request_a,
            };
            feedback.run(&measurement, true, 0.0);
        }
        feedback.is_on
    }

    /// On a margin within the table, off outside it, and no change at its ends themselves.
    #[test]
    fn switching_has_a_hysteresis_at_both_ends_of_the_table() {
        let margin_rpm = Scenario::<f32>::reconstruction().controller.hysteresis_rpm;
        let (first_rpm, last_rpm) = (UNDITHERED.first_rpm, UNDITHERED.last_rpm());
        let middle_rpm = 0.5 * (first_rpm + last_rpm);
        for (speeds_rpm, is_on) in [
            (&[middle_rpm][..], true),
            (&[first_rpm], false),
            (&[last_rpm], false),
            (&[first_rpm + margin_rpm], true),
            (&[last_rpm - margin_rpm], true),
            (&[first_rpm + 0.5 * margin_rpm], false),
            (&[last_rpm - 0.5 * margin_rpm], false),
            (&[middle_rpm, first_rpm], true),
            (&[middle_rpm, last_rpm], true),
            (&[middle_rpm, first_rpm - 0.1], false),
            (&[middle_rpm, last_rpm + 0.1], false),
            (&[middle_rpm, first_rpm - 0.1, first_rpm], false),
            (&[middle_rpm, last_rpm + 0.1, last_rpm], false),
        ] {
            let ticks: std::vec::Vec<_> = speeds_rpm.iter().map(|rpm| (*rpm, 10.0)).collect();
            assert_eq!(is_on_after(&ticks), is_on, "{speeds_rpm:?}");
        }
    }

    /// The orbit is that of one torque of the motor.
    #[test]
    fn a_request_far_from_the_tables_switches_off() {
        // Numbers that are exact: 0.5 and the f32 next to 0.3.
        let within_a = ON_WITHIN_A as f32;
        for (requests_a, is_on) in [
            (&[10.0][..], true),
            (&[10.25], true),
            (&[9.75], true),
            (&[10.0 + 1.01 * within_a], false),
            (&[10.0 - 1.01 * within_a], false),
            (&[-10.0], false),
            (&[10.0, 10.5], true),
            (&[10.0, 9.5], true),
            (&[10.0, 10.51], false),
            (&[10.0, 9.49], false),
            (&[10.0, 12.0, 10.4], false),
            (&[10.0, 12.0, 10.2], true),
        ] {
            let ticks: std::vec::Vec<_> = requests_a.iter().map(|a| (1750.0, *a)).collect();
            assert_eq!(is_on_after(&ticks), is_on, "{requests_a:?}");
        }
    }
}
