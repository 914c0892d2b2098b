//! Plausibility of the measured signals.

use super::{Fault, Faults, Limits};
use crate::Real;
use crate::signal::Measurement;

/// The limits that the check uses: each number of the state is compared in every control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SensorLimits<T> {
    wheel_speed_sensor_rpm: T,
    wheel_acceleration_rpm_per_s: T,
    yaw_rate_rad_per_s: T,
    yaw_acceleration_rad_per_s2: T,
    steering_angle_rad: T,
    steering_angle_change_rad_per_s: T,
    steering_rate_rad_per_s: T,
    steering_acceleration_rad_per_s2: T,
    current_request_a: T,
    lateral_acceleration_m_per_s2: T,
    steering_contradiction_rad: T,
    steering_memory_s: T,
    stuck_steering_rad: T,
    stuck_wheel_speed_rpm: T,
    dither_above_rpm: T,
}

impl<T: Real> SensorLimits<T> {
    fn of(limits: &Limits<T>) -> Self {
        Self {
            wheel_speed_sensor_rpm: limits.wheel_speed_sensor_rpm,
            wheel_acceleration_rpm_per_s: limits.wheel_acceleration_rpm_per_s,
            yaw_rate_rad_per_s: limits.yaw_rate_rad_per_s,
            yaw_acceleration_rad_per_s2: limits.yaw_acceleration_rad_per_s2,
            steering_angle_rad: limits.steering_angle_rad,
            steering_angle_change_rad_per_s: limits.steering_angle_change_rad_per_s,
            steering_rate_rad_per_s: limits.steering_rate_rad_per_s,
            steering_acceleration_rad_per_s2: limits.steering_acceleration_rad_per_s2,
            current_request_a: limits.current_request_a,
            lateral_acceleration_m_per_s2: limits.lateral_acceleration_m_per_s2,
            steering_contradiction_rad: limits.steering_contradiction_rad,
            steering_memory_s: limits.steering_memory_s,
            stuck_steering_rad: limits.stuck_steering_rad,
            stuck_wheel_speed_rpm: limits.stuck_wheel_speed_rpm,
            dither_above_rpm: limits.dither_above_rpm,
        }
    }
}

/// The plausibility check of the measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plausibility<T> {
    limits: SensorLimits<T>,
    control_period_s: T,
    /// Speed at a wheel speed of 1 rpm, m/s.
    speed_per_rpm: T,
    last: Option<Measurement<T>>,
    /// Control ticks since `last`.
    ticks: T,
    /// Steering angle's change less the integral of the steering rate, forgotten exponentially,
    /// rad.
    contradiction_rad: T,
    /// Movement of the steering since the yaw rate last changed, rad.
    unanswered_steering_rad: T,
}

impl<T: Real> Plausibility<T> {
    /// No measurement yet.
    pub fn new(limits: &Limits<T>, control_period_s: T, speed_per_rpm: T) -> Self {
        Self {
            limits: SensorLimits::of(limits),
            control_period_s,
            speed_per_rpm,
            last: None,
            ticks: T::zero(),
            contradiction_rad: T::zero(),
            unanswered_steering_rad: T::zero(),
        }
    }

    /// Whether the dither must be present at the last wheel speed; not before the first measurement.
    pub fn is_dither_needed(&self) -> bool {
        let above_rpm = self.limits.dither_above_rpm;
        self.last
            .is_some_and(|last| last.wheel_speed_rpm > above_rpm)
    }

    /// A control tick; `measurement` is new, or `None` if there was none. Returns the faults found.
    pub fn check(&mut self, measurement: Option<&Measurement<T>>) -> Faults {
        self.ticks += T::one();
        let Some(now) = measurement else {
            return Faults::NONE;
        };
        // No further check applies to a signal that is not a number.
        if !signals(now).into_iter().all(is_a_number) {
            return Fault::SensorNotANumber.into();
        }
        let mut faults = Faults::NONE;
        faults.add_if(!self.is_in_range(now), Fault::SensorRange);
        let acceleration = now.wheel_speed_rpm * self.speed_per_rpm * now.yaw_rate_rad_per_s;
        let bound = self.limits.lateral_acceleration_m_per_s2;
        faults.add_if(!is_within(acceleration, bound), Fault::LateralAcceleration);
        if let Some(last) = self.last {
            faults |= self.compare(&last, now);
        }
        self.last = Some(*now);
        self.ticks = T::zero();
        faults
    }

    fn is_in_range(&self, now: &Measurement<T>) -> bool {
        let limits = &self.limits;
        now.wheel_speed_rpm >= T::zero()
            && now.wheel_speed_rpm <= limits.wheel_speed_sensor_rpm
            && is_within(now.yaw_rate_rad_per_s, limits.yaw_rate_rad_per_s)
            && is_within(now.steering_angle_rad, limits.steering_angle_rad)
            && is_within(now.steering_rate_rad_per_s, limits.steering_rate_rad_per_s)
            && is_within(now.current_request_a, limits.current_request_a)
    }

    fn compare(&mut self, last: &Measurement<T>, now: &Measurement<T>) -> Faults {
        let limits = self.limits;
        let time_s = self.ticks * self.control_period_s;
        let is_slow = |last: T, now: T, rate: T| is_within(now - last, rate * time_s);
        let all_slow = is_slow(
            last.wheel_speed_rpm,
            now.wheel_speed_rpm,
            limits.wheel_acceleration_rpm_per_s,
        ) && is_slow(
            last.yaw_rate_rad_per_s,
            now.yaw_rate_rad_per_s,
            limits.yaw_acceleration_rad_per_s2,
        ) && is_slow(
            last.steering_angle_rad,
            now.steering_angle_rad,
            limits.steering_angle_change_rad_per_s,
        ) && is_slow(
            last.steering_rate_rad_per_s,
            now.steering_rate_rad_per_s,
            limits.steering_acceleration_rad_per_s2,
        );
        let moved_rad = now.steering_angle_rad - last.steering_angle_rad;
        let mean_rate =
            T::from_f64(0.5) * (now.steering_rate_rad_per_s + last.steering_rate_rad_per_s);
        let memory_s = limits.steering_memory_s;
        let kept = memory_s / (memory_s + time_s);
        self.contradiction_rad = self.contradiction_rad * kept + moved_rad - mean_rate * time_s;
        let is_answered = now.yaw_rate_rad_per_s != last.yaw_rate_rad_per_s;
        let can_answer = now.wheel_speed_rpm > limits.stuck_wheel_speed_rpm;
        self.unanswered_steering_rad = if is_answered || !can_answer {
            T::zero()
        } else {
            self.unanswered_steering_rad + moved_rad
        };

        let mut faults = Faults::NONE;
        faults.add_if(!all_slow, Fault::SensorRate);
        faults.add_if(
            !is_within(self.contradiction_rad, limits.steering_contradiction_rad),
            Fault::SteeringInconsistent,
        );
        faults.add_if(
            !is_within(self.unanswered_steering_rad, limits.stuck_steering_rad),
            Fault::SensorStuck,
        );
        faults
    }
}

fn signals<T: Real>(measurement: &Measurement<T>) -> [T; 5] {
    [
        measurement.wheel_speed_rpm,
        measurement.yaw_rate_rad_per_s,
        measurement.steering_angle_rad,
        measurement.steering_rate_rad_per_s,
        measurement.current_request_a,
    ]
}

/// Zero, or of a size that a sensor can have: neither subnormal nor infinite in a frame's f32.
/// False for NaN.
fn is_a_number<T: Real>(value: T) -> bool {
    let least = T::from_f64(f64::from(f32::MIN_POSITIVE));
    let most = T::from_f64(f64::from(f32::MAX));
    let size = value.abs();
    size <= most && (size >= least || size == T::zero())
}

/// Magnitude at most `bound`; false for NaN.
fn is_within<T: Real>(value: T, bound: T) -> bool {
    value.abs() <= bound
}
