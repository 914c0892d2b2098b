//! Taylor coefficients of the motion, many motions side by side.
//!
//! With the cubic tyre the right-hand side (14) is a polynomial, so each coefficient follows from those before it by sums of
//! products (A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99). The dither's means leave the tyres cubic, and dry
//! friction is a constant torque as long as its mode lasts. `tests` hold the recurrences against the shared model's derivative.

use super::lanes::Lanes;
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::friction::FrictionMode;
use shared_model::tire::Tire;
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, STEERING_RATE, SlipForm, YAW_RATE};

/// Order of the expansion.
pub const ORDER: usize = 12;

/// Coefficients 0 to `ORDER` of one quantity.
pub(super) type Series<S, const V: usize> = [Lanes<S, V>; ORDER + 1];

/// The numbers of the right-hand side.
#[derive(Debug, Clone, Copy)]
pub(super) struct System<L> {
    front_lever_s: L,
    rear_lever_s: L,
    lateral_gain: L,
    front_yaw_gain: L,
    rear_yaw_gain: L,
    front_linear: L,
    front_cubic: L,
    rear_linear: L,
    rear_cubic: L,
    /// Angular acceleration of the steering by motor and dry friction, by force of the front tyres, and by rate; all 0 where it
    /// sticks.
    acceleration: L,
    acceleration_per_force: L,
    acceleration_per_rate: L,
}

impl System<f64> {
    /// Of a lane without a motion.
    pub const STILL: Self = Self {
        front_lever_s: 0.0,
        rear_lever_s: 0.0,
        lateral_gain: 0.0,
        front_yaw_gain: 0.0,
        rear_yaw_gain: 0.0,
        front_linear: 0.0,
        front_cubic: 0.0,
        rear_linear: 0.0,
        rear_cubic: 0.0,
        acceleration: 0.0,
        acceleration_per_force: 0.0,
        acceleration_per_rate: 0.0,
    };

    /// The numbers of a model in a friction mode; `None` if its right-hand side is no polynomial: exact slip angles, the Magic
    /// Formula, friction under the mean of a sine.
    pub fn new(model: &Model<f64>, injection: Injection<f64>, mode: FrictionMode) -> Option<Self> {
        let constants = model.constants();
        let (Tire::Cubic(front), Tire::Cubic(rear)) = model.tires() else {
            return None;
        };
        let (front, rear) = (front.averaged(injection), rear.averaged(injection));
        let smooth = matches!(
            model.friction_sign(injection),
            shared_model::friction::Sign::Smooth { .. }
        );
        if constants.slip_form == SlipForm::Exact || smooth {
            return None;
        }
        let friction_nm = match mode {
            FrictionMode::Positive => model.friction_limit_nm(),
            FrictionMode::Negative => -model.friction_limit_nm(),
            FrictionMode::Neutral | FrictionMode::Sticking => 0.0,
        };
        let per_inertia = match mode {
            FrictionMode::Sticking => 0.0,
            _ => constants.inverse_steering_inertia,
        };
        Some(Self {
            front_lever_s: constants.front_lever_s,
            rear_lever_s: -constants.rear_lever_s,
            lateral_gain: constants.lateral_gain,
            front_yaw_gain: constants.front_yaw_gain,
            rear_yaw_gain: -constants.rear_yaw_gain,
            front_linear: front.linear_n_per_rad,
            front_cubic: -front.cubic_n_per_rad3,
            rear_linear: rear.linear_n_per_rad,
            rear_cubic: -rear.cubic_n_per_rad3,
            acceleration: (constants.motor_torque_nm - friction_nm) * per_inertia,
            acceleration_per_force: -constants.trail_m * per_inertia,
            acceleration_per_rate: -constants.damping_nm_s_per_rad * per_inertia,
        })
    }
}

impl<L> System<L> {
    fn numbers(&mut self) -> [&mut L; 12] {
        [
            &mut self.front_lever_s,
            &mut self.rear_lever_s,
            &mut self.lateral_gain,
            &mut self.front_yaw_gain,
            &mut self.rear_yaw_gain,
            &mut self.front_linear,
            &mut self.front_cubic,
            &mut self.rear_linear,
            &mut self.rear_cubic,
            &mut self.acceleration,
            &mut self.acceleration_per_force,
            &mut self.acceleration_per_rate,
        ]
    }
}

impl<S: Simd, const V: usize> System<Lanes<S, V>> {
    /// No motion in any lane.
    pub fn still(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self {
            front_lever_s: zero,
            rear_lever_s: zero,
            lateral_gain: zero,
            front_yaw_gain: zero,
            rear_yaw_gain: zero,
            front_linear: zero,
            front_cubic: zero,
            rear_linear: zero,
            rear_cubic: zero,
            acceleration: zero,
            acceleration_per_force: zero,
            acceleration_per_rate: zero,
        }
    }

    /// Puts a motion's numbers into its lane.
    pub fn set_lane(&mut self, lane: usize, mut system: System<f64>) {
        for (lanes, number) in self.numbers().into_iter().zip(system.numbers()) {
            lanes.as_mut_slice()[lane] = *number;
        }
    }
}

/// Series of one axle: its slip angle, the tyre's force, and its rate of change with the angle.
#[derive(Debug, Clone, Copy)]
struct Axle<S: Simd, const V: usize> {
    slip_angle: Series<S, V>,
    /// Force over slip angle.
    secant: Series<S, V>,
    force: Series<S, V>,
    slope: Series<S, V>,
}

impl<S: Simd, const V: usize> Axle<S, V> {
    /// Coefficient `n` of force and slope: F = alpha (k1 - k2 alpha^2), dF/dalpha = k1 - 3 k2 alpha^2.
    ///
    /// What the slip angle's newest coefficient adds to the force is one product with the slope: the next order waits for no more.
    #[inline(always)]
    fn load(&mut self, n: usize, linear: Lanes<S, V>, cubic: Lanes<S, V>, with_slope: bool) {
        let angle = &self.slip_angle;
        if n == 0 {
            let softening = cubic * (angle[0] * angle[0]);
            self.secant[0] = linear + softening;
            self.slope[0] = linear + softening.scale(3.0);
            self.force[0] = self.secant[0] * angle[0];
            return;
        }
        let inner = inner_square(angle, n);
        let known = inner.mul_add(cubic * angle[0], inner_product(&self.secant, angle, n));
        self.force[n] = self.slope[0].mul_add(angle[n], known);
        let softening = cubic * (angle[0] + angle[0]).mul_add(angle[n], inner);
        self.secant[n] = softening;
        if with_slope {
            self.slope[n] = softening.scale(3.0);
        }
    }
}

/// Coefficient `n` of the product of two series. The terms that were known last are added last: the processor has added the
/// others by then.
#[inline(always)]
fn product<S: Simd, const V: usize>(a: &Series<S, V>, b: &Series<S, V>, n: usize) -> Lanes<S, V> {
    if n == 0 {
        return a[0] * b[0];
    }
    a[n].mul_add(b[0], a[0].mul_add(b[n], inner_product(a, b, n)))
}

/// The same without the terms that have a coefficient of order `n`.
#[inline(always)]
fn inner_product<S: Simd, const V: usize>(
    a: &Series<S, V>,
    b: &Series<S, V>,
    n: usize,
) -> Lanes<S, V> {
    let mut sum = a[0].zero();
    for j in 1..n {
        sum = a[j].mul_add(b[n - j], sum);
    }
    sum
}

/// Coefficient `n` of the square of a series, without the term that has its coefficient of order `n`.
#[inline(always)]
fn inner_square<S: Simd, const V: usize>(a: &Series<S, V>, n: usize) -> Lanes<S, V> {
    let mut sum = a[0].zero();
    for j in 1..n.div_ceil(2) {
        sum = a[j].mul_add(a[n - j], sum);
    }
    sum = sum + sum;
    if n.is_multiple_of(2) {
        sum = a[n / 2].mul_add(a[n / 2], sum);
    }
    sum
}

/// Value at `t` of a series.
#[inline(always)]
pub(super) fn value<S: Simd, const V: usize>(series: &Series<S, V>, t: Lanes<S, V>) -> Lanes<S, V> {
    let mut sum = series[ORDER];
    for k in (0..ORDER).rev() {
        sum = sum.mul_add(t, series[k]);
    }
    sum
}

/// The expansion of a tangent vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tangent<S: Simd, const V: usize> {
    /// The vector.
    pub x: [Series<S, V>; 4],
    front_slip_angle: Series<S, V>,
    rear_slip_angle: Series<S, V>,
}

/// The expansion of the motion about a state, with `K` tangent vectors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expansion<S: Simd, const V: usize, const K: usize> {
    /// The state.
    pub x: [Series<S, V>; 4],
    /// The tangent vectors.
    pub tangents: [Tangent<S, V>; K],
    front: Axle<S, V>,
    rear: Axle<S, V>,
}

impl<S: Simd, const V: usize, const K: usize> Expansion<S, V, K> {
    /// Room for an expansion.
    pub fn new(simd: S) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        let axle = Axle {
            slip_angle: zero,
            secant: zero,
            force: zero,
            slope: zero,
        };
        let tangent = Tangent {
            x: [zero; 4],
            front_slip_angle: zero,
            rear_slip_angle: zero,
        };
        Self {
            x: [zero; 4],
            tangents: [tangent; K],
            front: axle,
            rear: axle,
        }
    }

    /// Series of the front tyres' force, up to the coefficient before the last.
    pub fn front_force(&self) -> &Series<S, V> {
        &self.front.force
    }

    /// Works out all coefficients from those of order 0, which are the state and the tangent vectors.
    #[inline(always)]
    pub fn expand(&mut self, system: &System<Lanes<S, V>>) {
        // One by one: with the order a constant all loops are unrolled, which takes a third off the time.
        self.advance::<0>(system);
        self.advance::<1>(system);
        self.advance::<2>(system);
        self.advance::<3>(system);
        self.advance::<4>(system);
        self.advance::<5>(system);
        self.advance::<6>(system);
        self.advance::<7>(system);
        self.advance::<8>(system);
        self.advance::<9>(system);
        self.advance::<10>(system);
        self.advance::<11>(system);
        const { assert!(ORDER == 12) };
    }

    /// Coefficients `N + 1` from those up to `N`.
    #[inline(always)]
    fn advance<const N: usize>(&mut self, system: &System<Lanes<S, V>>) {
        let (front, rear) = (&mut self.front, &mut self.rear);
        let (front_angle, rear_angle) = slip_angles(system, &self.x, N);
        front.slip_angle[N] = front_angle;
        rear.slip_angle[N] = rear_angle;
        front.load(N, system.front_linear, system.front_cubic, K > 0);
        rear.load(N, system.rear_linear, system.rear_cubic, K > 0);
        advance(system, &mut self.x, N, front.force[N], rear.force[N]);
        if N == 0 {
            let series = &mut self.x[STEERING_RATE];
            series[1] = series[1] + system.acceleration;
        }
        for k in 0..K {
            let tangent = &mut self.tangents[k];
            let (front_angle, rear_angle) = slip_angles(system, &tangent.x, N);
            tangent.front_slip_angle[N] = front_angle;
            tangent.rear_slip_angle[N] = rear_angle;
            let front_force = product(&tangent.front_slip_angle, &front.slope, N);
            let rear_force = product(&tangent.rear_slip_angle, &rear.slope, N);
            advance(system, &mut tangent.x, N, front_force, rear_force);
        }
    }
}

/// Coefficient `n` of the slip angles, front and rear: second lines of (4) and (5).
#[inline(always)]
fn slip_angles<S: Simd, const V: usize>(
    system: &System<Lanes<S, V>>,
    x: &[Series<S, V>; 4],
    n: usize,
) -> (Lanes<S, V>, Lanes<S, V>) {
    let (beta, gamma, delta) = (x[SIDESLIP][n], x[YAW_RATE][n], x[STEERING_ANGLE][n]);
    let front = system.front_lever_s.mul_add(gamma, beta - delta);
    let rear = system.rear_lever_s.mul_add(gamma, beta);
    (front, rear)
}

/// Coefficient `n + 1` of a vector by the right-hand side (14), but for its constant.
#[inline(always)]
fn advance<S: Simd, const V: usize>(
    system: &System<Lanes<S, V>>,
    x: &mut [Series<S, V>; 4],
    n: usize,
    front: Lanes<S, V>,
    rear: Lanes<S, V>,
) {
    let (gamma, rate) = (x[YAW_RATE][n], x[STEERING_RATE][n]);
    let inverse = 1.0 / (n + 1) as f64;
    let lateral = (front + rear).mul_add(system.lateral_gain, -gamma);
    let yaw = front.mul_add(system.front_yaw_gain, rear * system.rear_yaw_gain);
    let braking = rate * system.acceleration_per_rate;
    let steering = front.mul_add(system.acceleration_per_force, braking);
    x[SIDESLIP][n + 1] = lateral.scale(inverse);
    x[YAW_RATE][n + 1] = yaw.scale(inverse);
    x[STEERING_ANGLE][n + 1] = rate.scale(inverse);
    x[STEERING_RATE][n + 1] = steering.scale(inverse);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;
    use proptest::prelude::*;
    use pulp::Scalar;
    use shared_model::Scenario;
    use shared_model::dither::Waveform;
    use shared_model::friction::FrictionLaw;
    use shared_model::vehicle::State;

    const MODES: [FrictionMode; 4] = [
        FrictionMode::Sticking,
        FrictionMode::Negative,
        FrictionMode::Neutral,
        FrictionMode::Positive,
    ];

    /// Scenarios over the whole ranges that the analyses meet.
    fn scenario() -> impl Strategy<Value = Scenario<f64>> {
        let laws = [
            FrictionLaw::None,
            FrictionLaw::CoulombRate,
            FrictionLaw::PrintedAngle,
        ];
        let waveforms = [Waveform::None, Waveform::Square, Waveform::Sine];
        let choice = (0..laws.len(), 0..waveforms.len());
        let numbers = (
            300.0..3000.0,
            0.0..2.0,
            -3.0..3.0,
            0.5..2.0,
            0.5..2.0,
            0.0..5.0,
        );
        (choice, numbers).prop_map(move |((law, waveform), n)| {
            let mut scenario = Scenario::reconstruction();
            scenario.friction.law = laws[law];
            scenario.dither.waveform = waveforms[waveform];
            scenario.run.wheel_speed_rpm = n.0;
            scenario.dither.amplitude_v = 0.2 * n.1;
            scenario.steering.motor_current_a = n.2;
            scenario.vehicle.mass_kg *= n.3;
            scenario.tires.front.peak_n *= n.4;
            scenario.friction.coefficient *= n.5;
            scenario
        })
    }

    fn state() -> impl Strategy<Value = Vector4<f64>> {
        (-1.0..1.0, -3.0..3.0, -1.0..1.0, -8.0..8.0)
            .prop_map(|(beta, gamma, delta, rate)| Vector4::new(beta, gamma, delta, rate))
    }

    fn model(scenario: &Scenario<f64>) -> (Model<f64>, Injection<f64>) {
        (Model::new(scenario), scenario.dither.injection(0.0))
    }

    /// The expansion with one tangent vector.
    fn expansion(
        (model, injection): &(Model<f64>, Injection<f64>),
        mode: FrictionMode,
        x: &Vector4<f64>,
        tangent: &Vector4<f64>,
    ) -> Expansion<Scalar, 1, 1> {
        let simd = Scalar::new();
        let mut system = System::still(simd);
        let numbers = System::new(model, *injection, mode).expect("cubic, small angles");
        system.set_lane(0, numbers);
        let mut expansion = Expansion::new(simd);
        for i in 0..4 {
            expansion.x[i][0] = Lanes::splat(simd, x[i]);
            expansion.tangents[0].x[i][0] = Lanes::splat(simd, tangent[i]);
        }
        expansion.expand(&system);
        expansion
    }

    fn coefficient(series: &[Series<Scalar, 1>; 4], n: usize) -> Vector4<f64> {
        Vector4::from_fn(|i, _| series[i][n].as_slice()[0])
    }

    fn at(series: &[Series<Scalar, 1>; 4], t: f64) -> Vector4<f64> {
        let powers = |n: usize| coefficient(series, n) * t.powi(n as i32);
        (0..=ORDER).rev().map(powers).sum()
    }

    fn rate_at(series: &[Series<Scalar, 1>; 4], t: f64) -> Vector4<f64> {
        let powers = |n: usize| coefficient(series, n) * (n as f64 * t.powi(n as i32 - 1));
        (1..=ORDER).rev().map(powers).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// The first coefficient is the shared model's derivative, to the rounding of its terms.
        #[test]
        fn the_right_hand_side_is_the_models(
            scenario in scenario(),
            x in state(),
            mode in 0..MODES.len(),
        ) {
            let parts = model(&scenario);
            let mode = MODES[mode];
            let expansion = expansion(&parts, mode, &x, &Vector4::zeros());
            let found = coefficient(&expansion.x, 1);
            let wanted = parts.0.derivative(&x, parts.1, mode);
            // Sizes of the terms, which cancel.
            let constants = parts.0.constants();
            let (Tire::Cubic(front), Tire::Cubic(rear)) = parts.0.tires() else {
                unreachable!("the scenarios have cubic tyres")
            };
            let size = |tire: &shared_model::tire::CubicTire<f64>, angle: f64| {
                let tire = tire.averaged(parts.1);
                angle * (tire.linear_n_per_rad.abs() + tire.cubic_n_per_rad3.abs() * angle * angle)
            };
            let (beta, gamma) = (x[0].abs(), x[1].abs());
            let front = size(front, beta + constants.front_lever_s * gamma + x[2].abs());
            let rear = size(rear, beta + constants.rear_lever_s * gamma);
            let torque = constants.motor_torque_nm.abs()
                + constants.trail_m * front
                + constants.damping_nm_s_per_rad * x[3].abs()
                + parts.0.friction_limit_nm();
            let sizes = [
                (front + rear) * constants.lateral_gain + x[1].abs(),
                front * constants.front_yaw_gain + rear * constants.rear_yaw_gain,
                x[3].abs(),
                torque * constants.inverse_steering_inertia,
            ];
            for i in 0..4 {
                let ulps = (found[i] - wanted[i]).abs() / (f64::EPSILON * sizes[i].max(1e-3));
                prop_assert!(ulps < 8.0, "component {i}: {ulps} ulps: {} {}", found[i], wanted[i]);
            }
        }

        /// All other coefficients: a short step on, the polynomial's rate is the model's derivative where the polynomial is.
        #[test]
        fn the_polynomial_satisfies_the_equation(
            scenario in scenario(),
            x in state(),
            mode in 0..MODES.len(),
        ) {
            let parts = model(&scenario);
            let mut x = x;
            let mode = MODES[mode];
            if mode == FrictionMode::Sticking {
                x[3] = 0.0;
            }
            let expansion = expansion(&parts, mode, &x, &Vector4::zeros());
            let last = coefficient(&expansion.x, ORDER).amax();
            // The term left out is of the size of the last one.
            let step_s = (1e-13 / last.max(1e-10)).powf(1.0 / ORDER as f64);
            let on = at(&expansion.x, step_s);
            let found = rate_at(&expansion.x, step_s);
            let wanted = parts.0.derivative(&on, parts.1, mode);
            let size = wanted.amax().max(found.amax()).max(1.0);
            let error = (found - wanted).amax() / size;
            prop_assert!(error < 1e-9, "{error} at {step_s} s");
        }

        /// The tangent's series is the derivative of the state's by its start.
        #[test]
        fn the_tangent_is_the_difference_of_neighbours(
            scenario in scenario(),
            x in state(),
            tangent in state(),
        ) {
            let parts = model(&scenario);
            let mode = FrictionMode::Positive;
            let small = 1e-5;
            let here = expansion(&parts, mode, &x, &tangent);
            let ahead = expansion(&parts, mode, &(x + tangent * small), &tangent);
            let behind = expansion(&parts, mode, &(x - tangent * small), &tangent);
            for n in 0..=ORDER {
                let found = coefficient(&here.tangents[0].x, n);
                let wanted =
                    (coefficient(&ahead.x, n) - coefficient(&behind.x, n)) / (2.0 * small);
                let size = wanted.amax().max(coefficient(&here.x, n).amax()).max(1.0);
                prop_assert!((found - wanted).amax() < 1e-4 * size, "order {n}");
            }
        }
    }

    #[test]
    fn what_is_no_polynomial_is_refused() {
        let mut exact = Scenario::reconstruction();
        exact.vehicle.slip_form = SlipForm::Exact;
        let (model, injection) = model(&exact);
        assert!(System::new(&model, injection, FrictionMode::Neutral).is_none());
        let state: State<f64> = model.initial_state(&exact);
        assert_eq!(state.x[0], exact.run.sideslip_rad);
    }
}
