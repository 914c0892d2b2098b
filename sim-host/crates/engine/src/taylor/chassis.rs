//! Constants of the chassis, and the tyres' loads on it.

use super::lanes::Lanes;
use pulp::Simd;
use shared_model::vehicle::Model;

/// Numbers of the chassis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chassis<L> {
    pub front_lever_s: L,
    /// Negative: behind the centre of gravity.
    pub rear_lever_s: L,
    pub lateral_gain: L,
    pub front_yaw_gain: L,
    /// Negative.
    pub rear_yaw_gain: L,
}

impl<S: Simd, const V: usize> Chassis<Lanes<S, V>> {
    pub fn still(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self {
            front_lever_s: zero,
            rear_lever_s: zero,
            lateral_gain: zero,
            front_yaw_gain: zero,
            rear_yaw_gain: zero,
        }
    }

    pub(crate) fn set_lane(&mut self, lane: usize, model: &Model<f64>) {
        let constants = model.constants();
        self.front_lever_s.as_mut_slice()[lane] = constants.front_lever_s;
        self.rear_lever_s.as_mut_slice()[lane] = -constants.rear_lever_s;
        self.lateral_gain.as_mut_slice()[lane] = constants.lateral_gain;
        self.front_yaw_gain.as_mut_slice()[lane] = constants.front_yaw_gain;
        self.rear_yaw_gain.as_mut_slice()[lane] = -constants.rear_yaw_gain;
    }
}

/// Coefficients of what the tyres do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Loads<L> {
    /// Cornering forces, N.
    pub front: L,
    pub rear: L,
    /// Yaw acceleration, rad/s^2.
    pub yaw: L,
}

impl<S: Simd, const V: usize> Loads<Lanes<S, V>> {
    /// Of forces at a right angle to the chassis.
    #[inline(always)]
    pub fn straight(chassis: &Chassis<Lanes<S, V>>, front: Lanes<S, V>, rear: Lanes<S, V>) -> Self {
        let yaw = front.mul_add(chassis.front_yaw_gain, rear * chassis.rear_yaw_gain);
        Self { front, rear, yaw }
    }
}
