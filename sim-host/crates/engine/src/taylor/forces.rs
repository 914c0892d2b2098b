//! Series of the tyres' forces, in which the right-hand side is not linear.

use super::angles::{ExactAngles, small_angles};
use super::chassis::{Chassis, Loads};
use super::equation::Equation;
use super::lanes::Lanes;
use super::series::{ORDER, Series, product};
use super::tires::{Axle, Tires};
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::vehicle::{Model, SlipForm};

/// Series of the forces.
pub(super) struct Forces<S: Simd, const V: usize, const K: usize, E: Equation> {
    /// With exact slip angles only.
    exact: Option<ExactAngles<S, V, K>>,
    front: Axle<S, V>,
    rear: Axle<S, V>,
    front_tires: E::Tires<S, V>,
    rear_tires: E::Tires<S, V>,
    /// Slip angles of the tangent vectors, front and rear.
    tangents: [[Series<S, V>; 2]; K],
}

impl<S: Simd, const V: usize, const K: usize, E: Equation> Forces<S, V, K, E> {
    /// Room for those of motions like this one; no motion in any lane.
    pub fn new(simd: S, model: &Model<f64>, injection: Injection<f64>) -> Self {
        let (front, rear) = model.tires();
        let exact = model.constants().slip_form == SlipForm::Exact;
        Self {
            exact: exact.then(|| ExactAngles::new(simd)),
            front: Axle::new(simd),
            rear: Axle::new(simd),
            front_tires: Tires::new(simd, front, injection),
            rear_tires: Tires::new(simd, rear, injection),
            tangents: [[[Lanes::splat(simd, 0.0); ORDER + 1]; 2]; K],
        }
    }

    /// Puts a motion's tyres into its lane.
    pub(crate) fn set_lane(&mut self, lane: usize, model: &Model<f64>, injection: Injection<f64>) {
        let (front, rear) = model.tires();
        self.front_tires.set_lane(lane, front, injection);
        self.rear_tires.set_lane(lane, rear, injection);
    }

    /// No forces in a lane.
    pub(crate) fn free_lane(&mut self, lane: usize) {
        self.front_tires.free_lane(lane);
        self.rear_tires.free_lane(lane);
    }

    /// Exact slip angles, if the equation may have them: where not, their code is not there either.
    #[inline(always)]
    fn exact(&mut self) -> Option<&mut ExactAngles<S, V, K>> {
        if E::SMALL_ANGLES {
            return None;
        }
        self.exact.as_mut()
    }

    /// Coefficient `n`, given the state's up to `n`.
    #[inline(always)]
    pub fn load(
        &mut self,
        n: usize,
        chassis: &Chassis<Lanes<S, V>>,
        x: &[Series<S, V>; 4],
    ) -> Loads<Lanes<S, V>> {
        let [front, rear] = match self.exact() {
            Some(exact) => exact.angles(n, chassis, x),
            None => small_angles(n, chassis, x),
        };
        self.front.slip_angle[n] = front;
        self.rear.slip_angle[n] = rear;
        self.front_tires.load(n, &mut self.front, K > 0);
        self.rear_tires.load(n, &mut self.rear, K > 0);
        let loads = Loads::straight(chassis, self.front.force[n], self.rear.force[n]);
        match self.exact() {
            Some(exact) => exact.turn(n, loads),
            None => loads,
        }
    }

    /// Coefficient `n` of its change along tangent vector `k`, given the vector's up to `n`. After
    /// that of the state.
    #[inline(always)]
    pub(crate) fn load_tangent(
        &mut self,
        n: usize,
        k: usize,
        chassis: &Chassis<Lanes<S, V>>,
        tangent: &[Series<S, V>; 4],
    ) -> Loads<Lanes<S, V>> {
        let [front, rear] = match self.exact() {
            Some(exact) => exact.tangent_angles(n, k, chassis, tangent),
            None => small_angles(n, chassis, tangent),
        };
        let angles = &mut self.tangents[k];
        angles[0][n] = front;
        angles[1][n] = rear;
        let front = product(&angles[0], &self.front.slope, n);
        let rear = product(&angles[1], &self.rear.slope, n);
        let loads = Loads::straight(chassis, front, rear);
        match self.exact() {
            Some(exact) => exact.turn_tangent(n, k, tangent, loads),
            None => loads,
        }
    }

    /// Series of the front tyres' force, up to the coefficient before the last.
    #[inline(always)]
    pub(crate) fn front_force(&self) -> &Series<S, V> {
        &self.front.force
    }
}
