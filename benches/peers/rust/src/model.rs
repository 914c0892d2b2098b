//! The model's right-hand side as the peers integrate it, and what every job starts from.

use crate::export::Coefficients;

/// State at the start: rad, rad/s, rad, rad/s.
pub const START: [f64; 4] = [0.01, 0.01, 0.001, 0.0];
/// Tangent vector at the start.
pub const TANGENT_START: [f64; 4] = [0.005; 4];
/// Length of the tangent vector after a renormalisation: the state's size, so that a step-size
/// control heeds both.
pub const TANGENT_NORM: f64 = 0.01;
/// Time between two renormalisations of the tangent vector. In it the vector grows 9-fold in the
/// median, at most 1.1e5-fold; the greatest growth comes in bursts and is 9e4-fold in half the time
/// as well.
pub const RENORMALISATION_S: f64 = 10.0;

/// First step after a change of friction's mode, where a peer looks for events by signs at the ends
/// of steps: a mode that begins and ends within one step would be missed. The shortest in the first
/// 10 s lasts 0.4 ms.
pub const STEP_AFTER_EVENT_S: f64 = 1e-4;

impl Coefficients {
    fn slip_angles_rad(&self, x: &[f64; 4]) -> (f64, f64) {
        (
            x[0] + self.front_lever_s * x[1] - x[2],
            x[0] - self.rear_lever_s * x[1],
        )
    }

    fn front_force_n(&self, slip_rad: f64) -> f64 {
        slip_rad
            * (self.front_linear_n_per_rad - self.front_cubic_n_per_rad3 * (slip_rad * slip_rad))
    }

    /// Time derivative of the state; `free` is 1 as long as the steering moves and 0 in stick.
    #[inline(always)]
    pub fn rates(&self, x: &[f64; 4], friction_nm: f64, free: f64) -> [f64; 4] {
        let (front_rad, rear_rad) = self.slip_angles_rad(x);
        let front_n = self.front_force_n(front_rad);
        let rear_n = rear_rad
            * (self.rear_linear_n_per_rad - self.rear_cubic_n_per_rad3 * (rear_rad * rear_rad));
        let torque_nm = self.motor_torque_nm
            - self.trail_m * front_n
            - self.damping_nm_s_per_rad * x[3]
            - friction_nm;
        [
            (front_n + rear_n) * self.lateral_gain - x[1],
            self.front_yaw_gain * front_n - self.rear_yaw_gain * rear_n,
            x[3],
            free * (torque_nm * self.inverse_inertia_per_kg_m2),
        ]
    }

    /// Time derivative of a tangent vector, the steering moving.
    #[inline(always)]
    pub fn tangent_rates(&self, x: &[f64; 4], tangent: &[f64; 4]) -> [f64; 4] {
        let (front_rad, rear_rad) = self.slip_angles_rad(x);
        let (d_front_rad, d_rear_rad) = self.slip_angles_rad(tangent);
        let d_front_n = d_front_rad
            * (self.front_linear_n_per_rad
                - 3.0 * self.front_cubic_n_per_rad3 * (front_rad * front_rad));
        let d_rear_n = d_rear_rad
            * (self.rear_linear_n_per_rad
                - 3.0 * self.rear_cubic_n_per_rad3 * (rear_rad * rear_rad));
        [
            (d_front_n + d_rear_n) * self.lateral_gain - tangent[1],
            self.front_yaw_gain * d_front_n - self.rear_yaw_gain * d_rear_n,
            tangent[3],
            (-self.trail_m * d_front_n - self.damping_nm_s_per_rad * tangent[3])
                * self.inverse_inertia_per_kg_m2,
        ]
    }

    /// Time derivative of a state of 4 numbers, or of 8 with the tangent vector behind.
    #[inline(always)]
    pub fn write_rates<const N: usize>(&self, x: &[f64], out: &mut [f64]) {
        let four = |i: usize| -> [f64; 4] { *x[i..i + 4].as_array().expect("4 numbers") };
        out[..4].copy_from_slice(&self.rates(&four(0), 0.0, 1.0));
        if N == 8 {
            out[4..].copy_from_slice(&self.tangent_rates(&four(0), &four(4)));
        }
    }

    /// Torque on the steering at rest from motor and tyres, N m.
    pub fn driving_torque_nm(&self, x: &[f64; 4]) -> f64 {
        self.motor_torque_nm - self.trail_m * self.front_force_n(self.slip_angles_rad(x).0)
    }
}

/// Mode of dry friction.
#[derive(Clone, Copy, PartialEq)]
pub enum Mode {
    /// The steering rests.
    Stick,
    /// It moves, or is about to, to this side: 1 or -1.
    Slip(f64),
}

impl Mode {
    /// The mode behind a stop, or at the start.
    pub fn at_rest(c: &Coefficients, x: &[f64; 4]) -> Self {
        let torque_nm = c.driving_torque_nm(x);
        if torque_nm.abs() <= c.friction_limit_nm {
            Self::Stick
        } else {
            Self::Slip(torque_nm.signum())
        }
    }

    /// The mode behind this one's end.
    pub fn next(self, c: &Coefficients, x: &[f64; 4]) -> Self {
        match self {
            Self::Stick => Self::Slip(c.driving_torque_nm(x).signum()),
            Self::Slip(_) => Self::at_rest(c, x),
        }
    }

    /// What is positive as long as the mode lasts.
    pub fn event(self, c: &Coefficients, x: &[f64; 4]) -> f64 {
        match self {
            Self::Stick => c.friction_limit_nm - c.driving_torque_nm(x).abs(),
            Self::Slip(side) => side * x[3],
        }
    }

    /// Time derivative of the state in this mode.
    pub fn rates(self, c: &Coefficients, x: &[f64; 4]) -> [f64; 4] {
        match self {
            Self::Stick => c.rates(x, 0.0, 0.0),
            Self::Slip(side) => c.rates(x, side * c.friction_limit_nm, 1.0),
        }
    }
}
