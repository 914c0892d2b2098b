//! The chassis: its parameters and the form of its slip angles.

use crate::parameter::parameters;
use crate::{Real, listed};

listed! {
    /// Form of the slip angles and of the yaw moment.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    #[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
    pub enum SlipForm {
        /// Second lines of (4) and (5); yaw moment without cos(beta), as in (14).
        SmallAngle => "small_angle",
        /// First lines of (4) and (5); yaw moment with cos(beta), as in (3).
        Exact => "exact",
    }
}

parameters! {
    section "vehicle";
    /// Parameters of the chassis, Table 2.
    pub struct Vehicle {
        choices {
            /// Form of the slip angles.
            slip_form: SlipForm,
        }
        /// Mass m, kg.
        mass_kg: 1.0..=1e5,
        /// Yaw moment of inertia I_z, kg m^2.
        yaw_inertia_kg_m2: 1.0..=1e6,
        /// Distance l_f from the centre of gravity to the front axle, m.
        front_axle_distance_m: 0.01..=20.0,
        /// Distance l_r from the centre of gravity to the rear axle, m.
        rear_axle_distance_m: 0.01..=20.0,
        /// Wheel radius R, m (the paper's is in cm).
        wheel_radius_m: 0.01..=5.0,
    }
}

impl<T: Real> Vehicle<T> {
    /// Speed v = 2 pi R N/60, m/s, at the wheel speed N, equation (2).
    ///
    /// ```
    /// let vehicle = shared_model::Scenario::reconstruction().vehicle;
    /// assert!((vehicle.speed_m_per_s(1750.0) - 54.977_871_437_f64).abs() < 1e-9);
    /// ```
    pub fn speed_m_per_s(&self, wheel_speed_rpm: T) -> T {
        T::from_f64(core::f64::consts::TAU / 60.0) * self.wheel_radius_m * wheel_speed_rpm
    }
}
