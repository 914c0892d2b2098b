//! Tyres: symmetry, the cubic tyre against the Magic Formula, Table 1, and the effective tyre
//! against brute force.

use proptest::prelude::*;
use shared_model::Real;
use shared_model::dither::{Injection, SineMean};
use shared_model::tire::{
    HIGH_FRICTION_ROAD, LOW_FRICTION_ROAD, MagicFormula, Road, Tire, TireModel,
};
use std::f64::consts::TAU;

const AXLES: [MagicFormula<f64>; 4] = [
    LOW_FRICTION_ROAD.0,
    LOW_FRICTION_ROAD.1,
    HIGH_FRICTION_ROAD.0,
    HIGH_FRICTION_ROAD.1,
];

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn axle() -> impl Strategy<Value = MagicFormula<f64>> {
    prop::sample::select(&AXLES[..])
}

fn model() -> impl Strategy<Value = TireModel> {
    prop::sample::select(vec![TireModel::Cubic, TireModel::MagicFormula])
}

/// Sum of the magnitudes that a cubic tyre's force is made of, N: what its rounding error is
/// relative to.
fn cubic_magnitude(tire: &MagicFormula<f64>, slip: f64) -> f64 {
    let cubic = tire.cubic();
    cubic.linear_n_per_rad.abs() * slip + cubic.cubic_n_per_rad3.abs() * slip * slip * slip
}

/// Mean over a sine by brute force: the midpoint rule over a period, which for a smooth periodic
/// function converges faster than any power of the number of points.
fn sine_mean(f: impl Fn(f64) -> f64, y: f64, amplitude: f64) -> f64 {
    const POINTS: u32 = 4096;
    let at = |k: u32| f(y + amplitude * libm::sin((f64::from(k) + 0.5) / f64::from(POINTS) * TAU));
    (0..POINTS).map(at).sum::<f64>() / f64::from(POINTS)
}

/// Mean over a square wave by brute force: as many samples of each half.
fn square_mean(f: impl Fn(f64) -> f64, y: f64, amplitude: f64) -> f64 {
    const POINTS: u32 = 1000;
    let at = |k: u32| {
        f(if k < POINTS / 2 {
            y + amplitude
        } else {
            y - amplitude
        })
    };
    (0..POINTS).map(at).sum::<f64>() / f64::from(POINTS)
}

/// A tyre is symmetric. Without dither and under a square wave this holds to the bit, in every
/// arithmetic; under a sine the quadrature adds in another order.
fn odd<T: Real>(tire: &Tire<T>, alpha: T, amplitude: T) -> Result<(), TestCaseError> {
    for injection in [Injection::Off, Injection::SquareMean { amplitude }] {
        let (left, right) = (tire.force(-alpha, injection), tire.force(alpha, injection));
        prop_assert!(
            left == -right,
            "{left:?} against {right:?} under {injection:?}"
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(256))]

    #[test]
    fn forces_are_odd(
        axle in axle(), model in model(), alpha in -1.0..1.0_f64, amplitude in 0.0..0.5_f64,
    ) {
        odd(&Tire::new(model, &axle), alpha, amplitude)?;
        odd(&Tire::new(model, &axle.map(&|v| v as f32)), alpha as f32, amplitude as f32)?;
        let tire = Tire::new(model, &axle);
        let injection = Injection::SineMean { amplitude };
        let sum = tire.force(alpha, injection) + tire.force(-alpha, injection);
        let magnitude = axle.peak_n + cubic_magnitude(&axle, alpha.abs() + amplitude);
        prop_assert!(sum.abs() <= 1e-14 * magnitude, "odd to rounding, not to {sum} N");
    }

    /// The sign is the paper's: the force pushes with the slip angle, up to the zero of the cubic force, which is at
    /// 0.142 rad for the rear tyre of set A and farther out for the others.
    #[test]
    fn force_has_the_sign_of_the_slip(axle in axle(), model in model(), alpha in 1e-6..0.142_f64) {
        prop_assert!(Tire::new(model, &axle).force(alpha, Injection::Off) > 0.0);
    }

    /// Closed forms of the cubic tyre's mean, (21) and (23), hold to rounding for any slip and amplitude.
    #[test]
    fn effective_cubic_tire(axle in axle(), alpha in -1.0..1.0_f64, amplitude in 0.0..1.0_f64) {
        let tire = Tire::new(TireModel::Cubic, &axle);
        let plain = |a| tire.force(a, Injection::Off);
        let tolerance = 1e-12 * cubic_magnitude(&axle, alpha.abs() + amplitude);
        let square = tire.force(alpha, Injection::SquareMean { amplitude });
        let sine = tire.force(alpha, Injection::SineMean { amplitude });
        prop_assert!((square - square_mean(plain, alpha, amplitude)).abs() <= tolerance);
        prop_assert!((sine - sine_mean(plain, alpha, amplitude)).abs() <= tolerance);
    }

    /// The Magic Formula's mean over a square wave is exact, over a sine a quadrature: to 1e-6 of the peak force as long
    /// as the amplitude stays below 0.09 rad.
    #[test]
    fn effective_magic_formula(axle in axle(), alpha in -1.0..1.0_f64, amplitude in 0.0..0.09_f64) {
        let tire = Tire::new(TireModel::MagicFormula, &axle);
        let plain = |a| axle.force(a);
        let square = tire.force(alpha, Injection::SquareMean { amplitude });
        let sine = tire.force(alpha, Injection::SineMean { amplitude });
        prop_assert!((square - square_mean(plain, alpha, amplitude)).abs() <= 1e-12 * axle.peak_n);
        prop_assert!((sine - sine_mean(plain, alpha, amplitude)).abs() <= 1e-6 * axle.peak_n);
    }

    /// A held sample of the signal is nothing but a shifted slip angle.
    #[test]
    fn held_sample_shifts(axle in axle(), model in model(), alpha in -1.0..1.0_f64, offset in -0.5..0.5_f64) {
        let tire = Tire::new(model, &axle);
        let shifted = tire.force(alpha, Injection::Shift { offset });
        prop_assert_eq!(shifted, tire.force(alpha + offset, Injection::Off));
    }

    /// Dither of no amplitude is no dither: to the bit in the closed forms, to rounding in the quadrature.
    #[test]
    fn zero_amplitude_is_the_plain_tire(axle in axle(), model in model(), alpha in -1.0..1.0_f64) {
        let tire = Tire::new(model, &axle);
        let plain = tire.force(alpha, Injection::Off);
        let amplitude = 0.0;
        prop_assert_eq!(tire.force(alpha, Injection::SquareMean { amplitude }), plain);
        let sine = tire.force(alpha, Injection::SineMean { amplitude });
        prop_assert!((sine - plain).abs() <= 1e-14 * plain.abs());
        if model == TireModel::Cubic {
            prop_assert_eq!(sine, plain);
        }
    }

    /// The mean is linear: a tyre with a linear characteristic does not feel the dither, and the mean of a sum is the sum of
    /// the means.
    #[test]
    fn mean_is_linear(
        front in axle(), rear in axle(), slope in -1e5..1e5_f64, alpha in -1.0..1.0_f64, amplitude in 0.0..0.5_f64,
    ) {
        let mean = SineMean::new();
        let line = mean.of(|a| slope * a, alpha, amplitude);
        prop_assert!((line - slope * alpha).abs() <= 1e-14 * slope.abs(), "a line is its own mean");
        let of = |tire: MagicFormula<f64>| mean.of(|a| tire.force(a), alpha, amplitude);
        let sum = mean.of(|a| front.force(a) + 2.0 * rear.force(a), alpha, amplitude);
        let apart = of(front) + 2.0 * of(rear);
        prop_assert!((sum - apart).abs() <= 1e-14 * (front.peak_n + 2.0 * rear.peak_n));
    }
}

/// Cubic and Magic Formula agree up to the third order, both being odd, so that the difference
/// falls with the fifth power of the slip. The slips are small against the formula's poles and
/// large against rounding.
#[test]
fn cubic_differs_in_the_fifth_order() {
    for axle in AXLES {
        let difference = |alpha| axle.force(alpha) - axle.cubic().force(alpha);
        for alpha in [8e-4, 4e-4] {
            let order = libm::log2(difference(alpha) / difference(0.5 * alpha));
            assert!(
                (order - 5.0).abs() < 0.03,
                "order {order} at {alpha} rad of {axle:?}"
            );
        }
    }
}

/// Cornering stiffness: the derivative at zero slip is k1 = B C D, also of the mean of a weak
/// dither.
#[test]
fn slope_at_zero_is_k1() {
    let slip = 1e-6;
    for axle in AXLES {
        let k1 = axle.stiffness_per_rad * axle.shape * axle.peak_n;
        assert_eq!(axle.cubic().linear_n_per_rad, k1);
        for model in [TireModel::Cubic, TireModel::MagicFormula] {
            let tire = Tire::new(model, &axle);
            let slope = |injection| {
                (tire.force(slip, injection) - tire.force(-slip, injection)) / (2.0 * slip)
            };
            assert!((slope(Injection::Off) / k1 - 1.0).abs() < 1e-8);
            let weak = slope(Injection::SineMean { amplitude: 1e-5 });
            assert!(
                (weak / k1 - 1.0).abs() < 1e-6,
                "amplitude 1e-5 rad softens by k2/k1 1.5e-10"
            );
        }
    }
}

/// Table 1 names the sets the wrong way round: the one it calls high-friction carries 0.29 of the
/// weight, the other 0.81.
#[test]
fn road_labels_are_swapped_in_print() {
    const WEIGHT_N: f64 = 1500.0 * 9.81;
    let grip = |road: Road| (road.0.peak_n + road.1.peak_n) / WEIGHT_N;
    assert!((grip(LOW_FRICTION_ROAD) - 0.29).abs() < 0.005, "set A");
    assert!((grip(HIGH_FRICTION_ROAD) - 0.81).abs() < 0.005, "set B");
}

/// Set B's front tyre stiffens: its cubic tyre does not bound the force, so that the motion
/// diverges.
#[test]
fn set_b_front_cubic_is_negative() {
    assert!(HIGH_FRICTION_ROAD.0.cubic().cubic_n_per_rad3 < 0.0);
    for bounding in [
        LOW_FRICTION_ROAD.0,
        LOW_FRICTION_ROAD.1,
        HIGH_FRICTION_ROAD.1,
    ] {
        assert!(bounding.cubic().cubic_n_per_rad3 > 0.0, "{bounding:?}");
    }
}
