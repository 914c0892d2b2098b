//! The right-hand side with cubic tyres at small slip angles: a polynomial.

use super::expansion::{Chassis, Equation, Forces, Loads};
use super::flight::{self, Flight};
use super::lanes::Lanes;
use super::motion::Span;
use super::queue::Queue;
use super::series::{ORDER, Series, product};
use super::tires::{Axle, CubicTires};
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::tire::Tire;
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, YAW_RATE};

/// Cubic tyres at small slip angles.
pub(super) struct Polynomial;

impl Equation for Polynomial {
    type Forces<S: Simd, const V: usize, const K: usize> = PolynomialForces<S, V, K>;

    // Two vectors: enough to hide the latency of a multiplication.
    #[inline(always)]
    fn fly<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<flight::Result<K>> {
        Flight::<S, 2, K, Self>::new(simd, queue, span, most).run()
    }
}

/// Series of the forces.
#[derive(Debug, Clone)]
pub(super) struct PolynomialForces<S: Simd, const V: usize, const K: usize> {
    front: Axle<S, V>,
    rear: Axle<S, V>,
    front_tires: CubicTires<S, V>,
    rear_tires: CubicTires<S, V>,
    /// Slip angles of the tangent vectors.
    tangents: [TangentAngles<S, V>; K],
}

#[derive(Debug, Clone, Copy)]
struct TangentAngles<S: Simd, const V: usize> {
    front: Series<S, V>,
    rear: Series<S, V>,
}

impl<S: Simd, const V: usize, const K: usize> Forces<S, V, K> for PolynomialForces<S, V, K> {
    // It takes a third off the time.
    const UNROLLED: bool = true;

    fn new(simd: S, _: &Model<f64>, _: Injection<f64>) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        let angles = TangentAngles {
            front: zero,
            rear: zero,
        };
        Self {
            front: Axle::new(simd),
            rear: Axle::new(simd),
            front_tires: CubicTires::new(simd),
            rear_tires: CubicTires::new(simd),
            tangents: [angles; K],
        }
    }

    fn set_lane(&mut self, lane: usize, model: &Model<f64>, injection: Injection<f64>) {
        if let (Tire::Cubic(front), Tire::Cubic(rear)) = model.tires() {
            self.front_tires.set_lane(lane, front, injection);
            self.rear_tires.set_lane(lane, rear, injection);
        }
    }

    fn free_lane(&mut self, lane: usize) {
        self.front_tires.free_lane(lane);
        self.rear_tires.free_lane(lane);
    }

    #[inline(always)]
    fn load(
        &mut self,
        n: usize,
        chassis: &Chassis<Lanes<S, V>>,
        x: &[Series<S, V>; 4],
    ) -> Loads<Lanes<S, V>> {
        let (front, rear) = slip_angles(chassis, x, n);
        self.front.slip_angle[n] = front;
        self.rear.slip_angle[n] = rear;
        self.front_tires.load(n, &mut self.front, K > 0);
        self.rear_tires.load(n, &mut self.rear, K > 0);
        Loads::straight(chassis, self.front.force[n], self.rear.force[n])
    }

    #[inline(always)]
    fn load_tangent(
        &mut self,
        n: usize,
        k: usize,
        chassis: &Chassis<Lanes<S, V>>,
        tangent: &[Series<S, V>; 4],
    ) -> Loads<Lanes<S, V>> {
        let (front, rear) = slip_angles(chassis, tangent, n);
        let angles = &mut self.tangents[k];
        angles.front[n] = front;
        angles.rear[n] = rear;
        let front = product(&angles.front, &self.front.slope, n);
        let rear = product(&angles.rear, &self.rear.slope, n);
        Loads::straight(chassis, front, rear)
    }

    #[inline(always)]
    fn front_force(&self) -> &Series<S, V> {
        &self.front.force
    }
}

/// Coefficient `n` of the slip angles, front and rear: second lines of (4) and (5).
#[inline(always)]
pub(super) fn slip_angles<S: Simd, const V: usize>(
    chassis: &Chassis<Lanes<S, V>>,
    x: &[Series<S, V>; 4],
    n: usize,
) -> (Lanes<S, V>, Lanes<S, V>) {
    let (beta, gamma, delta) = (x[SIDESLIP][n], x[YAW_RATE][n], x[STEERING_ANGLE][n]);
    let front = chassis.front_lever_s.mul_add(gamma, beta - delta);
    let rear = chassis.rear_lever_s.mul_add(gamma, beta);
    (front, rear)
}
