//! The right-hand side with exact slip angles or the Magic Formula: no polynomial, but sines and arctangents have recurrences too.

use super::expansion::{Chassis, Equation, Forces, Loads};
use super::flight::{self, Flight};
use super::lanes::Lanes;
use super::motion::Span;
use super::polynomial::slip_angles;
use super::queue::Queue;
use super::series::{Atan, ORDER, Series, SinCos, product};
use super::tires::{Axle, CubicTires, MagicTires, offsets};
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::tire::Tire;
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, SlipForm, YAW_RATE};

/// Exact slip angles, the Magic Formula, or both; alike for all motions of a flight.
pub(super) struct Analytic;

impl Equation for Analytic {
    type Forces<S: Simd, const V: usize, const K: usize> = AnalyticForces<S, V, K>;

    // One vector: the recurrences are long enough to hide their latencies.
    #[inline(always)]
    fn fly<'a, S: Simd, const K: usize>(
        simd: S,
        queue: &'a Queue<'a, K>,
        span: &'a Span,
        most: usize,
    ) -> Vec<flight::Result<K>> {
        Flight::<S, 1, K, Self>::new(simd, queue, span, most).run()
    }
}

/// Series of the forces.
pub(super) struct AnalyticForces<S: Simd, const V: usize, const K: usize> {
    /// With exact slip angles only.
    slip: Option<Slip<S, V, K>>,
    front: Axle<S, V>,
    rear: Axle<S, V>,
    front_tires: Tires<S, V>,
    rear_tires: Tires<S, V>,
    /// Slip angles of the tangent vectors, front and rear.
    tangents: [[Series<S, V>; 2]; K],
}

enum Tires<S: Simd, const V: usize> {
    Cubic(CubicTires<S, V>),
    Magic(MagicTires<S, V>),
}

/// Series of what exact slip angles need: first lines of (4) and (5), and the cosine in (3).
struct Slip<S: Simd, const V: usize, const K: usize> {
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

impl<S: Simd, const V: usize> Tires<S, V> {
    fn new(simd: S, tire: &Tire<f64>, injection: Injection<f64>) -> Self {
        match tire {
            Tire::Cubic(_) => Self::Cubic(CubicTires::new(simd)),
            Tire::MagicFormula(..) => {
                Self::Magic(MagicTires::new(simd, offsets(tire, injection).len()))
            }
        }
    }

    fn set_lane(&mut self, lane: usize, tire: &Tire<f64>, injection: Injection<f64>) {
        match (self, tire) {
            (Self::Cubic(tires), Tire::Cubic(cubic)) => tires.set_lane(lane, cubic, injection),
            (Self::Magic(tires), Tire::MagicFormula(magic, _)) => {
                tires.set_lane(lane, magic, &offsets(tire, injection));
            }
            _ => unreachable!("tyres are alike in a flight"),
        }
    }

    fn free_lane(&mut self, lane: usize) {
        match self {
            Self::Cubic(tires) => tires.free_lane(lane),
            Self::Magic(tires) => tires.free_lane(lane),
        }
    }

    #[inline(always)]
    fn load(&mut self, n: usize, axle: &mut Axle<S, V>, with_slope: bool) {
        match self {
            Self::Cubic(tires) => tires.load(n, axle, with_slope),
            Self::Magic(tires) => tires.load(n, axle, with_slope),
        }
    }
}

impl<S: Simd, const V: usize, const K: usize> Slip<S, V, K> {
    fn new(simd: S) -> Self {
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

    /// Coefficient `n` of the slip angles.
    #[inline(always)]
    fn angles(
        &mut self,
        n: usize,
        chassis: &Chassis<Lanes<S, V>>,
        x: &[Series<S, V>; 4],
    ) -> (Lanes<S, V>, Lanes<S, V>) {
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
        (front, beta + self.rear.value[n])
    }

    /// The same along tangent vector `k`.
    #[inline(always)]
    fn tangent_angles(
        &mut self,
        n: usize,
        k: usize,
        chassis: &Chassis<Lanes<S, V>>,
        tangent: &[Series<S, V>; 4],
    ) -> (Lanes<S, V>, Lanes<S, V>) {
        let (beta, delta) = (&tangent[SIDESLIP], tangent[STEERING_ANGLE][n]);
        let turned = product(&self.across, beta, n);
        let along = &mut self.along_tangents[k];
        along[n] = product(&tangent[YAW_RATE], &self.sideslip.cos, n) - turned;
        let front = product(&self.front.slope, along, n);
        let rear = product(&self.rear.slope, along, n);
        let front = chassis.front_lever_s.mul_add(front, beta[n] - delta);
        (front, chassis.rear_lever_s.mul_add(rear, beta[n]))
    }

    /// Puts the cosine to the yaw acceleration.
    #[inline(always)]
    fn turn(&mut self, n: usize, mut loads: Loads<Lanes<S, V>>) -> Loads<Lanes<S, V>> {
        self.yaw[n] = loads.yaw;
        loads.yaw = product(&self.yaw, &self.sideslip.cos, n);
        if K > 0 {
            self.yaw_across[n] = product(&self.yaw, &self.sideslip.sin, n);
        }
        loads
    }

    /// The same along tangent vector `k`.
    #[inline(always)]
    fn turn_tangent(
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

impl<S: Simd, const V: usize, const K: usize> Forces<S, V, K> for AnalyticForces<S, V, K> {
    const UNROLLED: bool = false;

    fn new(simd: S, model: &Model<f64>, injection: Injection<f64>) -> Self {
        let (front, rear) = model.tires();
        let exact = model.constants().slip_form == SlipForm::Exact;
        Self {
            slip: exact.then(|| Slip::new(simd)),
            front: Axle::new(simd),
            rear: Axle::new(simd),
            front_tires: Tires::new(simd, front, injection),
            rear_tires: Tires::new(simd, rear, injection),
            tangents: [[[Lanes::splat(simd, 0.0); ORDER + 1]; 2]; K],
        }
    }

    fn set_lane(&mut self, lane: usize, model: &Model<f64>, injection: Injection<f64>) {
        let (front, rear) = model.tires();
        self.front_tires.set_lane(lane, front, injection);
        self.rear_tires.set_lane(lane, rear, injection);
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
        let (front, rear) = match &mut self.slip {
            Some(slip) => slip.angles(n, chassis, x),
            None => slip_angles(chassis, x, n),
        };
        self.front.slip_angle[n] = front;
        self.rear.slip_angle[n] = rear;
        self.front_tires.load(n, &mut self.front, K > 0);
        self.rear_tires.load(n, &mut self.rear, K > 0);
        let loads = Loads::straight(chassis, self.front.force[n], self.rear.force[n]);
        match &mut self.slip {
            Some(slip) => slip.turn(n, loads),
            None => loads,
        }
    }

    #[inline(always)]
    fn load_tangent(
        &mut self,
        n: usize,
        k: usize,
        chassis: &Chassis<Lanes<S, V>>,
        tangent: &[Series<S, V>; 4],
    ) -> Loads<Lanes<S, V>> {
        let (front, rear) = match &mut self.slip {
            Some(slip) => slip.tangent_angles(n, k, chassis, tangent),
            None => slip_angles(chassis, tangent, n),
        };
        let angles = &mut self.tangents[k];
        angles[0][n] = front;
        angles[1][n] = rear;
        let front = product(&angles[0], &self.front.slope, n);
        let rear = product(&angles[1], &self.rear.slope, n);
        let loads = Loads::straight(chassis, front, rear);
        match &mut self.slip {
            Some(slip) => slip.turn_tangent(n, k, tangent, loads),
            None => loads,
        }
    }

    #[inline(always)]
    fn front_force(&self) -> &Series<S, V> {
        &self.front.force
    }
}
