//! The gate's limits.

use crate::Real;
use crate::parameter::{Field, ParameterSet};

/// What the gate lets through. The defaults hold every motion of the preset from 1200 to 1950 rpm, chaos included, with a
/// margin of 1.8 or more; `docs/design.md` has the measured extremes beside them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Limits<T> {
    /// Greatest magnitude of the motor's share of the servo voltage, V.
    pub motor_voltage_v: T,
    /// Greatest change of that share, V/s.
    pub motor_slew_v_per_s: T,
    /// Greatest amplitude of a square dither, V.
    pub square_amplitude_v: T,
    /// Greatest amplitude of a sine dither, V.
    pub sine_amplitude_v: T,
    /// Slowest dither, rad/s.
    pub dither_frequency_min_rad_per_s: T,
    /// Fastest dither, rad/s.
    pub dither_frequency_max_rad_per_s: T,
    /// Time in which the safe state takes the dither away, s.
    pub ramp_out_s: T,
    /// Wheel speed that the safe state demands, rpm.
    pub safe_wheel_speed_rpm: T,
    /// Greatest wheel speed, rpm; the least is zero.
    pub wheel_speed_rpm: T,
    /// Greatest change of the wheel speed, rpm/s. As all changes, between two measurements, with their noise.
    pub wheel_acceleration_rpm_per_s: T,
    /// Greatest magnitude of the yaw rate, rad/s.
    pub yaw_rate_rad_per_s: T,
    /// Greatest change of the yaw rate, rad/s^2.
    pub yaw_acceleration_rad_per_s2: T,
    /// Greatest magnitude of the steering angle, rad.
    pub steering_angle_rad: T,
    /// Greatest change of the steering angle, rad/s.
    pub steering_angle_change_rad_per_s: T,
    /// Greatest magnitude of the steering rate, rad/s.
    pub steering_rate_rad_per_s: T,
    /// Greatest change of the steering rate, rad/s^2.
    pub steering_acceleration_rad_per_s2: T,
    /// Greatest magnitude of the driver's current request, A. It may step.
    pub current_request_a: T,
    /// Greatest lateral acceleration v gamma, m/s^2.
    pub lateral_acceleration_m_per_s2: T,
    /// Greatest contradiction between steering angle and integrated steering rate, rad.
    pub steering_contradiction_rad: T,
    /// Time over which that contradiction is forgotten, s.
    pub steering_memory_s: T,
    /// Greatest movement of the steering, rad, during which the yaw rate may keep its exact value.
    pub stuck_steering_rad: T,
    /// Wheel speed up to which the steering may move without any yaw rate, rpm.
    pub stuck_wheel_speed_rpm: T,
    /// Greatest age of the last valid sensor frame, s.
    pub frame_age_s: T,
    /// Greatest deviation of the time between two control ticks, as a share of their period.
    pub tick_tolerance: T,
}

impl<T: Real> Limits<T> {
    /// Limits for the preset `reconstruction`.
    pub fn reconstruction() -> Self {
        let number = T::from_f64;
        Self {
            motor_voltage_v: number(4.5),
            motor_slew_v_per_s: number(4.0),
            square_amplitude_v: number(0.2),
            sine_amplitude_v: number(1.3),
            dither_frequency_min_rad_per_s: number(1500.0),
            dither_frequency_max_rad_per_s: number(5000.0),
            ramp_out_s: number(0.1),
            safe_wheel_speed_rpm: number(1100.0),
            wheel_speed_rpm: number(2500.0),
            wheel_acceleration_rpm_per_s: number(20_000.0),
            yaw_rate_rad_per_s: number(4.0),
            yaw_acceleration_rad_per_s2: number(200.0),
            steering_angle_rad: number(1.1),
            steering_angle_change_rad_per_s: number(20.0),
            steering_rate_rad_per_s: number(4.0),
            steering_acceleration_rad_per_s2: number(200.0),
            current_request_a: number(20.0),
            lateral_acceleration_m_per_s2: number(250.0),
            steering_contradiction_rad: number(0.05),
            steering_memory_s: number(0.2),
            stuck_steering_rad: number(0.2),
            stuck_wheel_speed_rpm: number(100.0),
            frame_age_s: number(0.01),
            tick_tolerance: number(0.2),
        }
    }

    /// The same limits in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> Limits<U> {
        Limits {
            motor_voltage_v: f(self.motor_voltage_v),
            motor_slew_v_per_s: f(self.motor_slew_v_per_s),
            square_amplitude_v: f(self.square_amplitude_v),
            sine_amplitude_v: f(self.sine_amplitude_v),
            dither_frequency_min_rad_per_s: f(self.dither_frequency_min_rad_per_s),
            dither_frequency_max_rad_per_s: f(self.dither_frequency_max_rad_per_s),
            ramp_out_s: f(self.ramp_out_s),
            safe_wheel_speed_rpm: f(self.safe_wheel_speed_rpm),
            wheel_speed_rpm: f(self.wheel_speed_rpm),
            wheel_acceleration_rpm_per_s: f(self.wheel_acceleration_rpm_per_s),
            yaw_rate_rad_per_s: f(self.yaw_rate_rad_per_s),
            yaw_acceleration_rad_per_s2: f(self.yaw_acceleration_rad_per_s2),
            steering_angle_rad: f(self.steering_angle_rad),
            steering_angle_change_rad_per_s: f(self.steering_angle_change_rad_per_s),
            steering_rate_rad_per_s: f(self.steering_rate_rad_per_s),
            steering_acceleration_rad_per_s2: f(self.steering_acceleration_rad_per_s2),
            current_request_a: f(self.current_request_a),
            lateral_acceleration_m_per_s2: f(self.lateral_acceleration_m_per_s2),
            steering_contradiction_rad: f(self.steering_contradiction_rad),
            steering_memory_s: f(self.steering_memory_s),
            stuck_steering_rad: f(self.stuck_steering_rad),
            stuck_wheel_speed_rpm: f(self.stuck_wheel_speed_rpm),
            frame_age_s: f(self.frame_age_s),
            tick_tolerance: f(self.tick_tolerance),
        }
    }
}

impl<T: Real> ParameterSet<T> for Limits<T> {
    const SECTION: &'static str = "gate";
    const FIELDS: &'static [Field<Self, T>] = &[
        Field {
            name: "motor_voltage_v",
            min: 0.0,
            max: 1000.0,
            place: |p| &mut p.motor_voltage_v,
        },
        Field {
            name: "motor_slew_v_per_s",
            min: 1e-3,
            max: 1e6,
            place: |p| &mut p.motor_slew_v_per_s,
        },
        Field {
            name: "square_amplitude_v",
            min: 0.0,
            max: 1000.0,
            place: |p| &mut p.square_amplitude_v,
        },
        Field {
            name: "sine_amplitude_v",
            min: 0.0,
            max: 1000.0,
            place: |p| &mut p.sine_amplitude_v,
        },
        Field {
            name: "dither_frequency_min_rad_per_s",
            min: 1.0,
            max: 1e6,
            place: |p| &mut p.dither_frequency_min_rad_per_s,
        },
        Field {
            name: "dither_frequency_max_rad_per_s",
            min: 1.0,
            max: 1e6,
            place: |p| &mut p.dither_frequency_max_rad_per_s,
        },
        Field {
            name: "ramp_out_s",
            min: 1e-3,
            max: 10.0,
            place: |p| &mut p.ramp_out_s,
        },
        Field {
            name: "safe_wheel_speed_rpm",
            min: 0.0,
            max: 1e5,
            place: |p| &mut p.safe_wheel_speed_rpm,
        },
        Field {
            name: "wheel_speed_rpm",
            min: 1.0,
            max: 1e5,
            place: |p| &mut p.wheel_speed_rpm,
        },
        Field {
            name: "wheel_acceleration_rpm_per_s",
            min: 1.0,
            max: 1e6,
            place: |p| &mut p.wheel_acceleration_rpm_per_s,
        },
        Field {
            name: "yaw_rate_rad_per_s",
            min: 1e-3,
            max: 100.0,
            place: |p| &mut p.yaw_rate_rad_per_s,
        },
        Field {
            name: "yaw_acceleration_rad_per_s2",
            min: 1e-3,
            max: 1e5,
            place: |p| &mut p.yaw_acceleration_rad_per_s2,
        },
        Field {
            name: "steering_angle_rad",
            min: 1e-3,
            max: 10.0,
            place: |p| &mut p.steering_angle_rad,
        },
        Field {
            name: "steering_angle_change_rad_per_s",
            min: 1e-3,
            max: 1e5,
            place: |p| &mut p.steering_angle_change_rad_per_s,
        },
        Field {
            name: "steering_rate_rad_per_s",
            min: 1e-3,
            max: 1000.0,
            place: |p| &mut p.steering_rate_rad_per_s,
        },
        Field {
            name: "steering_acceleration_rad_per_s2",
            min: 1e-3,
            max: 1e6,
            place: |p| &mut p.steering_acceleration_rad_per_s2,
        },
        Field {
            name: "current_request_a",
            min: 0.0,
            max: 1000.0,
            place: |p| &mut p.current_request_a,
        },
        Field {
            name: "lateral_acceleration_m_per_s2",
            min: 0.1,
            max: 1000.0,
            place: |p| &mut p.lateral_acceleration_m_per_s2,
        },
        Field {
            name: "steering_contradiction_rad",
            min: 1e-4,
            max: 10.0,
            place: |p| &mut p.steering_contradiction_rad,
        },
        Field {
            name: "steering_memory_s",
            min: 1e-2,
            max: 10.0,
            place: |p| &mut p.steering_memory_s,
        },
        Field {
            name: "stuck_steering_rad",
            min: 1e-3,
            max: 10.0,
            place: |p| &mut p.stuck_steering_rad,
        },
        Field {
            name: "stuck_wheel_speed_rpm",
            min: 0.0,
            max: 1e5,
            place: |p| &mut p.stuck_wheel_speed_rpm,
        },
        Field {
            name: "frame_age_s",
            min: 1e-3,
            max: 1.0,
            place: |p| &mut p.frame_age_s,
        },
        Field {
            name: "tick_tolerance",
            min: 0.01,
            max: 1.0,
            place: |p| &mut p.tick_tolerance,
        },
    ];
}
