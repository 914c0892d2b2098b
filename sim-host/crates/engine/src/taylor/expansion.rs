//! Taylor coefficients of the motion, many motions side by side.
//!
//! Each coefficient follows from those before it by sums of products (A. Jorba, M. Zou,
//! Experimental Mathematics 14 (2005) 99). What is linear in the right-hand side (14) is here; the
//! tyres' forces are in `forces`. Dry friction is a constant torque as long as its mode lasts.
//! `tests` hold the recurrences against the shared model's derivative.

use super::chassis::{Chassis, Loads};
use super::equation::Equation;
use super::forces::Forces;
use super::lanes::Lanes;
use super::series::{ORDER, Series};
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, STEERING_RATE, YAW_RATE};

/// Numbers of the steering in a friction mode: its angular acceleration by motor and dry friction,
/// by force of the front tyres, and by rate. All are 0 where it sticks.
#[derive(Debug, Clone, Copy)]
struct Steering<L> {
    acceleration: L,
    per_force: L,
    per_rate: L,
}

impl<S: Simd, const V: usize> Steering<Lanes<S, V>> {
    fn still(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self {
            acceleration: zero,
            per_force: zero,
            per_rate: zero,
        }
    }

    fn set_lane(&mut self, lane: usize, model: &Model<f64>, mode: FrictionMode) {
        let constants = model.constants();
        let friction_nm = match mode {
            FrictionMode::Positive => model.friction_limit_nm(),
            FrictionMode::Negative => -model.friction_limit_nm(),
            FrictionMode::Neutral | FrictionMode::Sticking => 0.0,
        };
        let per_inertia = match mode {
            FrictionMode::Sticking => 0.0,
            _ => constants.inverse_steering_inertia,
        };
        let torque_nm = constants.motor_torque_nm - friction_nm;
        self.acceleration.as_mut_slice()[lane] = torque_nm * per_inertia;
        self.per_force.as_mut_slice()[lane] = -constants.trail_m * per_inertia;
        self.per_rate.as_mut_slice()[lane] = -constants.damping_nm_s_per_rad * per_inertia;
    }
}

/// The expansion of the motion about a state, with `K` tangent vectors.
pub(super) struct Expansion<S: Simd, const V: usize, const K: usize, E: Equation> {
    /// The state.
    pub x: [Series<S, V>; 4],
    /// The tangent vectors.
    pub tangents: [[Series<S, V>; 4]; K],
    chassis: Chassis<Lanes<S, V>>,
    steering: Steering<Lanes<S, V>>,
    pub forces: Forces<S, V, K, E>,
}

impl<S: Simd, const V: usize, const K: usize, E: Equation> Expansion<S, V, K, E> {
    /// Room for expansions of motions like this one; no motion in any lane.
    pub fn new(simd: S, model: &Model<f64>, injection: Injection<f64>) -> Self {
        let zero = [Lanes::splat(simd, 0.0); ORDER + 1];
        Self {
            x: [zero; 4],
            tangents: [[zero; 4]; K],
            chassis: Chassis::still(simd),
            steering: Steering::still(simd),
            forces: Forces::new(simd, model, injection),
        }
    }

    /// Puts a motion's numbers into its lane.
    pub(crate) fn set_lane(&mut self, lane: usize, model: &Model<f64>, injection: Injection<f64>) {
        self.chassis.set_lane(lane, model);
        self.forces.set_lane(lane, model, injection);
    }

    /// Puts those of its friction mode into its lane.
    pub(crate) fn set_mode(&mut self, lane: usize, model: &Model<f64>, mode: FrictionMode) {
        self.steering.set_lane(lane, model, mode);
    }

    /// Nothing acts in a lane; its motion, if it has one, is to be at rest.
    pub(crate) fn free_lane(&mut self, lane: usize) {
        self.forces.free_lane(lane);
        self.steering.acceleration.as_mut_slice()[lane] = 0.0;
    }

    /// Works out all coefficients from those of order 0, which are the state and the tangent
    /// vectors.
    #[inline(always)]
    pub fn expand(&mut self) {
        // One number at a time gains little by it, and costs the compiler as much.
        if !E::UNROLLED || S::F64_LANES == 1 {
            for n in 0..ORDER {
                self.advance(n);
            }
            return;
        }
        self.advance(0);
        self.advance(1);
        self.advance(2);
        self.advance(3);
        self.advance(4);
        self.advance(5);
        self.advance(6);
        self.advance(7);
        self.advance(8);
        self.advance(9);
        self.advance(10);
        self.advance(11);
        const { assert!(ORDER == 12) };
    }

    /// Coefficients `n + 1` from those up to `n`.
    #[inline(always)]
    fn advance(&mut self, n: usize) {
        let loads = self.forces.load(n, &self.chassis, &self.x);
        advance(&self.chassis, &self.steering, &mut self.x, n, loads);
        if n == 0 {
            let series = &mut self.x[STEERING_RATE];
            series[1] = series[1] + self.steering.acceleration;
        }
        for k in 0..K {
            let tangent = &mut self.tangents[k];
            let loads = self.forces.load_tangent(n, k, &self.chassis, tangent);
            advance(&self.chassis, &self.steering, tangent, n, loads);
        }
    }
}

/// Coefficient `n + 1` of a vector by the right-hand side (14), but for its constant.
#[inline(always)]
fn advance<S: Simd, const V: usize>(
    chassis: &Chassis<Lanes<S, V>>,
    steering: &Steering<Lanes<S, V>>,
    x: &mut [Series<S, V>; 4],
    n: usize,
    loads: Loads<Lanes<S, V>>,
) {
    let (gamma, rate) = (x[YAW_RATE][n], x[STEERING_RATE][n]);
    let inverse = 1.0 / (n + 1) as f64;
    let lateral = (loads.front + loads.rear).mul_add(chassis.lateral_gain, -gamma);
    let braking = rate * steering.per_rate;
    let acceleration = loads.front.mul_add(steering.per_force, braking);
    x[SIDESLIP][n + 1] = lateral.scale(inverse);
    x[YAW_RATE][n + 1] = loads.yaw.scale(inverse);
    x[STEERING_ANGLE][n + 1] = rate.scale(inverse);
    x[STEERING_RATE][n + 1] = acceleration.scale(inverse);
}

#[cfg(test)]
mod tests {
    use super::super::equation::{Analytic, Polynomial};
    use super::*;
    use nalgebra::Vector4;
    use proptest::prelude::*;
    use pulp::Scalar;
    use shared_model::Scenario;
    use shared_model::dither::Waveform;
    use shared_model::friction::FrictionLaw;
    use shared_model::tire::{Tire, TireModel};
    use shared_model::vehicle::SlipForm;

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
        let forms = [SlipForm::SmallAngle, SlipForm::Exact];
        let tires = [TireModel::Cubic, TireModel::MagicFormula];
        let choice = (0..laws.len(), 0..waveforms.len(), 0..4_usize);
        let numbers = (
            300.0..3000.0,
            0.0..2.0,
            -3.0..3.0,
            0.5..2.0,
            0.5..2.0,
            0.0..5.0,
        );
        (choice, numbers).prop_map(move |((law, waveform, form), n)| {
            let mut scenario = Scenario::reconstruction();
            scenario.friction.law = laws[law];
            scenario.dither.waveform = waveforms[waveform];
            scenario.vehicle.slip_form = forms[form / 2];
            scenario.tires.model = tires[form % 2];
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

    type Parts = (Model<f64>, Injection<f64>);

    fn model(scenario: &Scenario<f64>) -> Parts {
        (Model::new(scenario), scenario.dither.injection(0.0))
    }

    fn is_polynomial((model, _): &Parts) -> bool {
        let small = model.constants().slip_form == SlipForm::SmallAngle;
        small && matches!(model.tires().0, Tire::Cubic(_))
    }

    /// Coefficients of a vector.
    struct Coefficients([Vector4<f64>; ORDER + 1]);

    impl Coefficients {
        fn of(series: &[Series<Scalar, 1>; 4]) -> Self {
            let component = |i: usize, n: usize| series[i][n].as_slice()[0];
            Self(std::array::from_fn(|n| {
                Vector4::from_fn(|i, _| component(i, n))
            }))
        }

        fn at(&self, t: f64) -> Vector4<f64> {
            let term = |n: usize| self.0[n] * t.powi(n as i32);
            (0..=ORDER).rev().map(term).sum()
        }

        fn rate_at(&self, t: f64) -> Vector4<f64> {
            let term = |n: usize| self.0[n] * (n as f64 * t.powi(n as i32 - 1));
            (1..=ORDER).rev().map(term).sum()
        }
    }

    /// The expansions of state and one tangent vector.
    fn expand<E: Equation>(
        (model, injection): &Parts,
        mode: FrictionMode,
        x: &Vector4<f64>,
        tangent: &Vector4<f64>,
    ) -> [Coefficients; 2] {
        let simd = Scalar::new();
        let mut expansion = Expansion::<Scalar, 1, 1, E>::new(simd, model, *injection);
        expansion.set_lane(0, model, *injection);
        expansion.set_mode(0, model, mode);
        for i in 0..4 {
            expansion.x[i][0] = Lanes::splat(simd, x[i]);
            expansion.tangents[0][i][0] = Lanes::splat(simd, tangent[i]);
        }
        expansion.expand();
        [&expansion.x, &expansion.tangents[0]].map(Coefficients::of)
    }

    fn expansion(
        parts: &Parts,
        mode: FrictionMode,
        x: &Vector4<f64>,
        tangent: &Vector4<f64>,
    ) -> [Coefficients; 2] {
        if is_polynomial(parts) {
            expand::<Polynomial>(parts, mode, x, tangent)
        } else {
            expand::<Analytic>(parts, mode, x, tangent)
        }
    }

    /// Sizes of the terms that add up to the derivative, and cancel.
    fn sizes((model, injection): &Parts, x: &Vector4<f64>) -> Vector4<f64> {
        let constants = model.constants();
        let size = |tire: &Tire<f64>, angle: f64| match tire {
            Tire::Cubic(tire) => {
                let tire = tire.averaged(*injection);
                angle * (tire.linear_n_per_rad.abs() + tire.cubic_n_per_rad3.abs() * angle * angle)
            }
            Tire::MagicFormula(tire, _) => tire.peak_n.abs(),
        };
        let (beta, gamma) = (x[0].abs(), x[1].abs());
        let (front, rear) = model.tires();
        let front = size(front, beta + constants.front_lever_s * gamma + x[2].abs());
        let rear = size(rear, beta + constants.rear_lever_s * gamma);
        let torque = constants.motor_torque_nm.abs()
            + constants.trail_m * front
            + constants.damping_nm_s_per_rad * x[3].abs()
            + model.friction_limit_nm();
        Vector4::new(
            (front + rear) * constants.lateral_gain + gamma,
            front * constants.front_yaw_gain + rear * constants.rear_yaw_gain,
            x[3].abs(),
            torque * constants.inverse_steering_inertia,
        )
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
            let [series, _] = expansion(&parts, mode, &x, &Vector4::zeros());
            let found = series.0[1];
            let wanted = parts.0.derivative(&x, parts.1, mode);
            let sizes = sizes(&parts, &x);
            for i in 0..4 {
                let ulps = (found[i] - wanted[i]).abs() / (f64::EPSILON * sizes[i].max(1e-3));
                prop_assert!(ulps < 8.0, "component {i}: {ulps} ulps: {} {}", found[i], wanted[i]);
            }
        }

        /// All other coefficients: a short step on, the polynomial's rate is the model's derivative where the polynomial is.
        #[test]
        fn the_series_satisfies_the_equation(
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
            let [series, _] = expansion(&parts, mode, &x, &Vector4::zeros());
            // The terms left out are of the size of the last ones, of which one alone may be near zero.
            let small_at = |n: usize| (1e-13 / series.0[n].amax().max(1e-10)).powf(1.0 / n as f64);
            let step_s = small_at(ORDER).min(small_at(ORDER - 1));
            let found = series.rate_at(step_s);
            let wanted = parts.0.derivative(&series.at(step_s), parts.1, mode);
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
            let small = 1e-6;
            let [here, found] = expansion(&parts, mode, &x, &tangent);
            let [ahead, _] = expansion(&parts, mode, &(x + tangent * small), &tangent);
            let [behind, _] = expansion(&parts, mode, &(x - tangent * small), &tangent);
            for n in 0..=ORDER {
                let wanted = (ahead.0[n] - behind.0[n]) / (2.0 * small);
                let size = wanted.amax().max(here.0[n].amax()).max(1.0);
                prop_assert!((found.0[n] - wanted).amax() < 1e-4 * size, "order {n}");
            }
        }
    }
}
