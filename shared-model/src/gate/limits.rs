//! The gate's limits.

use crate::Real;
use crate::freshness::Challenger;
use crate::parameter::parameters;

parameters! {
    section "gate";
    /// Limits of the gate. The defaults include every motion of the preset from 1200 to 1950 rpm, chaos included, with a
    /// margin of 1.8 or more; `docs/design.md` has the measured extremes beside them.
    ///
    /// The range of each limit is compiled in and is its hard bound: about twice its default, or half of it where a
    /// smaller value is less strict. No setting can widen a limit beyond that.
    pub struct Limits {
        /// Greatest magnitude of the motor's share of the servo voltage, V.
        motor_voltage_v: 0.0..=9.0,
        /// Greatest change of that share, V/s.
        motor_slew_v_per_s: 1e-3..=8.0,
        /// Greatest magnitude of the delayed feedback's share, V. Both shares together have the limit of the motor's.
        feedback_voltage_v: 0.0..=3.0,
        /// Greatest change of that share, V/s.
        feedback_slew_v_per_s: 1e-3..=50.0,
        /// Greatest amplitude of a square dither, V.
        square_amplitude_v: 0.0..=0.4,
        /// Greatest amplitude of a sine dither, V.
        sine_amplitude_v: 0.0..=2.6,
        /// Wheel speed above which the dither must be present, rpm.
        dither_above_rpm: 0.0..=2000.0,
        /// Least amplitude of a square dither above that speed, V.
        square_least_amplitude_v: 0.05..=0.4,
        /// Least amplitude of a sine dither above that speed, V.
        sine_least_amplitude_v: 0.45..=2.6,
        /// Amplitude of a square dither in the safe state, V: it suppresses the chaos at any wheel speed.
        square_safe_amplitude_v: 0.063..=0.25,
        /// Amplitude of a sine dither in the safe state, V.
        sine_safe_amplitude_v: 0.55..=2.2,
        /// Longest time for which the amplitude may be less there, s: it is ramped in.
        weak_dither_s: 1e-3..=1.4,
        /// Slowest dither, rad/s.
        dither_frequency_min_rad_per_s: 750.0..=1e4,
        /// Fastest dither, rad/s.
        dither_frequency_max_rad_per_s: 750.0..=1e4,
        /// Time in which the safe state ramps the greatest dither in or out, s.
        ramp_out_s: 1e-3..=0.2,
        /// Wheel speed that the safe state demands, rpm.
        safe_wheel_speed_rpm: 0.0..=1500.0,
        /// Greatest wheel speed of the vehicle, rpm. The ECU reports it to the vehicle; a higher one is a warning.
        wheel_speed_rpm: 1.0..=5000.0,
        /// Greatest wheel speed that the sensor measures, rpm; the least is zero. A reading beyond it is a fault.
        wheel_speed_sensor_rpm: 1.0..=8000.0,
        /// Greatest change of the wheel speed, rpm/s. As all changes, between two measurements, with their noise.
        wheel_acceleration_rpm_per_s: 1.0..=4e4,
        /// Greatest magnitude of the yaw rate, rad/s.
        yaw_rate_rad_per_s: 1e-3..=8.0,
        /// Greatest change of the yaw rate, rad/s^2.
        yaw_acceleration_rad_per_s2: 1e-3..=400.0,
        /// Greatest magnitude of the steering angle, rad.
        steering_angle_rad: 1e-3..=2.2,
        /// Greatest change of the steering angle, rad/s.
        steering_angle_change_rad_per_s: 1e-3..=40.0,
        /// Greatest magnitude of the steering rate, rad/s.
        steering_rate_rad_per_s: 1e-3..=8.0,
        /// Greatest change of the steering rate, rad/s^2.
        steering_acceleration_rad_per_s2: 1e-3..=400.0,
        /// Greatest magnitude of the driver's current request, A. It may step.
        current_request_a: 0.0..=40.0,
        /// Greatest lateral acceleration v gamma, m/s^2.
        lateral_acceleration_m_per_s2: 0.1..=500.0,
        /// Greatest contradiction between steering angle and integrated steering rate, rad.
        steering_contradiction_rad: 1e-4..=0.1,
        /// Time over which that contradiction is forgotten, s.
        steering_memory_s: 1e-2..=0.4,
        /// Greatest movement of the steering, rad, during which the yaw rate may keep its exact value.
        stuck_steering_rad: 1e-3..=0.4,
        /// Wheel speed up to which the steering may move without any yaw rate, rpm.
        stuck_wheel_speed_rpm: 0.0..=200.0,
        /// Greatest age of the sensor data in use, s, from the actuator frame that the vehicle had received when it sent
        /// them. In control ticks it is rounded and cut to 3 to 15: less than three leaves no room for a lost frame, and a
        /// challenge of four bits distinguishes no more. At a control rate above 1.5 kHz the limit is therefore less
        /// than the default, below 300 Hz more.
        frame_age_s: 1e-3..=0.02,
        /// Greatest deviation of the time between two control ticks, as a share of their period.
        tick_tolerance: 0.01..=0.4,
    }
}

/// Least and greatest limit of the age of a frame, control ticks.
const FRAME_AGE_TICKS: (u32, u32) = (3, Challenger::MAX_AGE_TICKS);

impl<T: Real> Limits<T> {
    /// Greatest age of the sensor data in use at that control rate, control ticks.
    ///
    /// ```
    /// use shared_model::gate::Limits;
    /// let limits = Limits::<f32>::reconstruction();
    /// assert_eq!([10.0, 500.0, 1e3, 1e6].map(|rate_hz| limits.frame_age_ticks(rate_hz)), [3, 5, 10, 15]);
    /// ```
    pub fn frame_age_ticks(&self, control_rate_hz: T) -> u32 {
        let (least, greatest) = FRAME_AGE_TICKS;
        let ticks = (self.frame_age_s * control_rate_hz + T::from_f64(0.5)).to_u32();
        ticks.max(least).min(greatest)
    }

    /// Limits for the preset `reconstruction`.
    pub fn reconstruction() -> Self {
        let number = T::from_f64;
        Self {
            motor_voltage_v: number(4.5),
            motor_slew_v_per_s: number(4.0),
            feedback_voltage_v: number(1.5),
            feedback_slew_v_per_s: number(25.0),
            square_amplitude_v: number(0.2),
            sine_amplitude_v: number(1.3),
            dither_above_rpm: number(1575.0),
            square_least_amplitude_v: number(0.1),
            sine_least_amplitude_v: number(0.9),
            square_safe_amplitude_v: number(0.125),
            sine_safe_amplitude_v: number(1.1),
            weak_dither_s: number(0.7),
            dither_frequency_min_rad_per_s: number(1500.0),
            dither_frequency_max_rad_per_s: number(5000.0),
            ramp_out_s: number(0.1),
            safe_wheel_speed_rpm: number(1100.0),
            wheel_speed_rpm: number(2500.0),
            wheel_speed_sensor_rpm: number(4000.0),
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
}
