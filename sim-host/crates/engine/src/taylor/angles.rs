//! Series of the slip angles.

use super::chassis::{Chassis, Loads};
use super::lanes::Lanes;
use super::series::{Atan, ORDER, Series, SinCos, product};
use pulp::Simd;
use shared_model::vehicle::{SIDESLIP, STEERING_ANGLE, YAW_RATE};

/// Coefficient `n` of small slip angles, front and rear: second lines of (4) and (5). They are
/// linear, so a state's and a tangent vector's are alike.
#[inline(always)]
pub(super) fn small_angles<S: Simd, const V: usize>(
    n: usize,
    chassis: &Chassis<Lanes<S, V>>,
    x: &[Series<S, V>; 4],
) -> [Lanes<S, V>; 2] {
    let (beta, gamma, delta) = (x[SIDESLIP][n], x[YAW_RATE][n], x[STEERING_ANGLE][n]);
    let front = chassis.front_lever_s.mul_add(gamma, beta - delta);
    [front, chassis.rear_lever_s.mul_add(gamma, beta)]
}

/// Exact slip angles, first lines of (4) and (5), and the cosine that (3) puts to the yaw
/// acceleration.
pub(super) struct ExactAngles<S: Simd, const V: usize, const K: usize> {
    sideslip: SinCos<S, V>,
    /// gamma cos(beta), and gamma sin(beta).
    along: Series<S, V>,
    across: Series<S, V>,
    front: Atan<S, V>,
    rear: Atan<S, V>,
    /// Yaw acceleration but for the cosine, and times the sine.
    yaw: Series<S, V>,
    yaw_across: Series<S, V>,
    /// Changes of `along` and `yaw` along the tangent vectors.
    along_tangents: [Series<S, V>; K],
    yaw_tangents: [Series<S, V>; K],
}

impl<S: Simd, const V: usize, const K: usize> ExactAngles<S, V, K> {
    /// Room for them.
    pub fn new(simd: S) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        Self {
            sideslip: SinCos::new(simd),
            along: zero,
            across: zero,
            front: Atan::new(simd),
            rear: Atan::new(simd),
            yaw: zero,
            yaw_across: zero,
            along_tangents: [zero; K],
            yaw_tangents: [zero; K],
        }
    }

    /// Coefficient `n` of the slip angles, front and rear, given the state's up to `n`.
    #[inline(always)]
    pub fn angles(
        &mut self,
        n: usize,
        chassis: &Chassis<Lanes<S, V>>,
        x: &[Series<S, V>; 4],
    ) -> [Lanes<S, V>; 2] {
        self.sideslip.push(n, x[SIDESLIP][n]);
        let along = product(&x[YAW_RATE], &self.sideslip.cos, n);
        self.along[n] = along;
        self.front.push(n, chassis.front_lever_s * along);
        self.rear.push(n, chassis.rear_lever_s * along);
        if K > 0 {
            self.across[n] = product(&x[YAW_RATE], &self.sideslip.sin, n);
        }
        let (beta, delta) = (x[SIDESLIP][n], x[STEERING_ANGLE][n]);
        let front = beta + self.front.value[n] - delta;
        [front, beta + self.rear.value[n]]
    }

    /// The same of their change along tangent vector `k`. After that of the state.
    #[inline(always)]
    pub(crate) fn tangent_angles(
        &mut self,
        n: usize,
        k: usize,
        chassis: &Chassis<Lanes<S, V>>,
        tangent: &[Series<S, V>; 4],
    ) -> [Lanes<S, V>; 2] {
        let (beta, delta) = (&tangent[SIDESLIP], tangent[STEERING_ANGLE][n]);
        let turned = product(&self.across, beta, n);
        let along = &mut self.along_tangents[k];
        along[n] = product(&tangent[YAW_RATE], &self.sideslip.cos, n) - turned;
        let front = product(&self.front.slope, along, n);
        let rear = product(&self.rear.slope, along, n);
        let front = chassis.front_lever_s.mul_add(front, beta[n] - delta);
        [front, chassis.rear_lever_s.mul_add(rear, beta[n])]
    }

    /// Puts the cosine to coefficient `n` of the yaw acceleration.
    #[inline(always)]
    pub fn turn(&mut self, n: usize, mut loads: Loads<Lanes<S, V>>) -> Loads<Lanes<S, V>> {
        self.yaw[n] = loads.yaw;
        loads.yaw = product(&self.yaw, &self.sideslip.cos, n);
        if K > 0 {
            self.yaw_across[n] = product(&self.yaw, &self.sideslip.sin, n);
        }
        loads
    }

    /// The same along tangent vector `k`.
    #[inline(always)]
    pub(crate) fn turn_tangent(
        &mut self,
        n: usize,
        k: usize,
        tangent: &[Series<S, V>; 4],
        mut loads: Loads<Lanes<S, V>>,
    ) -> Loads<Lanes<S, V>> {
        let yaw = &mut self.yaw_tangents[k];
        yaw[n] = loads.yaw;
        let turned = product(&self.yaw_across, &tangent[SIDESLIP], n);
        loads.yaw = product(yaw, &self.sideslip.cos, n) - turned;
        loads
    }
}
