//! Signals between vehicle and ECU: measurements in, the actuation's state out.

use crate::Real;
use crate::listed;

/// Measurements of the sensors, once per control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement<T> {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: T,
    /// Yaw rate gamma, rad/s.
    pub yaw_rate_rad_per_s: T,
    /// Front steering angle delta_f, rad.
    pub steering_angle_rad: T,
    /// Steering rate, rad/s.
    pub steering_rate_rad_per_s: T,
    /// Motor current that the driver requests, A.
    pub current_request_a: T,
}

impl<T: Real> Measurement<T> {
    /// No signal is infinite or NaN.
    pub fn is_finite(&self) -> bool {
        self.wheel_speed_rpm.is_finite()
            && self.yaw_rate_rad_per_s.is_finite()
            && self.steering_angle_rad.is_finite()
            && self.steering_rate_rad_per_s.is_finite()
            && self.current_request_a.is_finite()
    }

    /// The same measurement in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> Measurement<U> {
        Measurement {
            wheel_speed_rpm: f(self.wheel_speed_rpm),
            yaw_rate_rad_per_s: f(self.yaw_rate_rad_per_s),
            steering_angle_rad: f(self.steering_angle_rad),
            steering_rate_rad_per_s: f(self.steering_rate_rad_per_s),
            current_request_a: f(self.current_request_a),
        }
    }
}

listed! {
    /// Operating mode of the ECU.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Mode {
        /// No valid sensor frame yet; the servo is neutral.
        Starting = 0,
        /// Following the driver's request, with dither where the policy has it.
        Active = 1,
        /// A fault was found: dither ramped out, servo neutral, until restart.
        Safe = 2,
    }
}

impl Mode {
    /// The mode of that number in a frame.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as u8 == code)
    }
}

/// The ECU's report to the vehicle, once per control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuation<T> {
    /// Operating mode of the ECU.
    pub mode: Mode,
    /// Faults that put the ECU into its safe state, one bit each; see `gate::Fault`.
    pub faults: u32,
    /// Motor's share of the servo voltage, V.
    pub motor_voltage_v: T,
    /// Amplitude of the dither on the servo voltage, V.
    pub dither_amplitude_v: T,
    /// Wheel speed that the vehicle must not exceed, rpm: lowered in the safe state, where nothing
    /// suppresses the chaos.
    pub wheel_speed_limit_rpm: T,
    /// Events that were detected and tolerated since the last frame, one bit each.
    pub warnings: u16,
    /// Counter of the last sensor frame that was used; 255 before the first.
    pub sensor_counter: u8,
    /// Whether the servo's bridge is on; see `ecu::PwmPeriod`.
    pub bridge_on: bool,
    /// Challenge that the vehicle returns in its sensor frames; see `freshness`.
    pub challenge: u8,
}

impl<T: Real> Actuation<T> {
    /// The same actuation in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> Actuation<U> {
        Actuation {
            mode: self.mode,
            faults: self.faults,
            motor_voltage_v: f(self.motor_voltage_v),
            dither_amplitude_v: f(self.dither_amplitude_v),
            wheel_speed_limit_rpm: f(self.wheel_speed_limit_rpm),
            warnings: self.warnings,
            sensor_counter: self.sensor_counter,
            bridge_on: self.bridge_on,
            challenge: self.challenge,
        }
    }
}
