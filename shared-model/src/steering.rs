//! Steering actuator: motor, gear and front wheels about the steering axis.

use crate::Real;
use crate::parameter::{Field, ParameterSet};

/// Parameters of the steering system, Table 2.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Steering<T> {
    /// Total moment of inertia J_w, kg m^2 (the paper writes N m s^2/rad).
    pub inertia_kg_m2: T,
    /// Viscous damping b_w, N m s/rad.
    pub damping_nm_s_per_rad: T,
    /// Steering ratio r_s.
    pub ratio: T,
    /// Motor constant k_M, N m/A.
    pub motor_constant_nm_per_a: T,
    /// Motor current i_M, A.
    pub motor_current_a: T,
    /// Efficiency eta of the gear.
    pub efficiency: T,
    /// Pneumatic trail t_p, m.
    pub pneumatic_trail_m: T,
    /// Mechanical trail t_m, m.
    pub mechanical_trail_m: T,
}

impl<T: Real> Steering<T> {
    /// Torque of the motor about the steering axis, r_s tau_M with tau_M = k_M i_M eta, N m, equations (10) and (11).
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

    /// The same parameters in another arithmetic.
    pub fn map<U>(&self, f: &impl Fn(T) -> U) -> Steering<U> {
        Steering {
            inertia_kg_m2: f(self.inertia_kg_m2),
            damping_nm_s_per_rad: f(self.damping_nm_s_per_rad),
            ratio: f(self.ratio),
            motor_constant_nm_per_a: f(self.motor_constant_nm_per_a),
            motor_current_a: f(self.motor_current_a),
            efficiency: f(self.efficiency),
            pneumatic_trail_m: f(self.pneumatic_trail_m),
            mechanical_trail_m: f(self.mechanical_trail_m),
        }
    }
}

impl<T: Real> ParameterSet<T> for Steering<T> {
    const SECTION: &'static str = "steering";
    const FIELDS: &'static [Field<Self, T>] = &[
        Field {
            name: "inertia_kg_m2",
            min: 1e-3,
            max: 1e5,
            place: |p| &mut p.inertia_kg_m2,
        },
        Field {
            name: "damping_nm_s_per_rad",
            min: 0.0,
            max: 1e6,
            place: |p| &mut p.damping_nm_s_per_rad,
        },
        Field {
            name: "ratio",
            min: 0.1,
            max: 1000.0,
            place: |p| &mut p.ratio,
        },
        Field {
            name: "motor_constant_nm_per_a",
            min: 0.0,
            max: 100.0,
            place: |p| &mut p.motor_constant_nm_per_a,
        },
        Field {
            name: "motor_current_a",
            min: -1000.0,
            max: 1000.0,
            place: |p| &mut p.motor_current_a,
        },
        Field {
            name: "efficiency",
            min: 0.0,
            max: 1.0,
            place: |p| &mut p.efficiency,
        },
        Field {
            name: "pneumatic_trail_m",
            min: 0.0,
            max: 1.0,
            place: |p| &mut p.pneumatic_trail_m,
        },
        Field {
            name: "mechanical_trail_m",
            min: 0.0,
            max: 1.0,
            place: |p| &mut p.mechanical_trail_m,
        },
    ];
}
