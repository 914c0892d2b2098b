//! Steering actuator: motor, gear and front wheels about the steering axis.

use crate::Real;
use crate::parameter::parameters;

parameters! {
    section "steering";
    /// Parameters of the steering system, Table 2.
    pub struct Steering {
        /// Total moment of inertia J_w, kg m^2 (the paper writes N m s^2/rad).
        inertia_kg_m2: 1e-3..=1e5,
        /// Viscous damping b_w, N m s/rad.
        damping_nm_s_per_rad: 0.0..=1e6,
        /// Steering ratio r_s.
        ratio: 0.1..=1000.0,
        /// Motor constant k_M, N m/A.
        motor_constant_nm_per_a: 0.0..=100.0,
        /// Motor current i_M, A.
        motor_current_a: -1000.0..=1000.0,
        /// Efficiency eta of the gear.
        efficiency: 0.0..=1.0,
        /// Pneumatic trail t_p, m.
        pneumatic_trail_m: 0.0..=1.0,
        /// Mechanical trail t_m, m.
        mechanical_trail_m: 0.0..=1.0,
    }
}

impl<T: Real> Steering<T> {
    /// Torque of the motor about the steering axis, r_s tau_M with tau_M = k_M i_M eta, N m,
    /// equations (10) and (11).
    ///
    /// ```
    /// let steering = shared_model::Scenario::<f64>::reconstruction().steering;
    /// assert!((steering.motor_torque_nm() - 16.38_f64).abs() < 1e-12);
    /// ```
    pub fn motor_torque_nm(&self) -> T {
        self.ratio * self.motor_constant_nm_per_a * self.motor_current_a * self.efficiency
    }

    /// Lever arm t_p + t_m of the self-aligning torque, m, equation (12).
    pub fn trail_m(&self) -> T {
        self.pneumatic_trail_m + self.mechanical_trail_m
    }
}
