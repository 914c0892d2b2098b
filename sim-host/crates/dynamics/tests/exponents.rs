//! Lyapunov exponents by three methods: against published figures, and against each other.

use dynamics::attractor::attractors;
use dynamics::flow::{Flow, Unmeasured, VehicleFlow, settle};
use dynamics::lyapunov::{Exponent, Spectrum, exponents};
use dynamics::sweep::{RunControl, Timing};
use dynamics::synchronisation::{self, NoThreshold, Search};
use dynamics::two_particle;
use engine::Reason;
use engine::dual::Dual;
use nalgebra::{SVector, Vector2, Vector3, Vector4};
use shared_model::friction::{FrictionLaw, FrictionMode};
use shared_model::tire::HIGH_FRICTION_ROAD;
use shared_model::{Real, Scenario};

/// A differential equation by Runge-Kutta of fourth order.
struct Equation<F> {
    field: F,
    step_s: f64,
}

/// A right-hand side in any arithmetic.
trait Field {
    fn at<T: Real>(&self, x: &Vector3<T>) -> Vector3<T>;
}

impl<F: Field> Flow<3> for Equation<F> {
    fn step<T: Real>(&self, x: &Vector3<T>) -> Vector3<T> {
        let h = T::from_f64(self.step_s);
        let half = T::from_f64(0.5) * h;
        let two = T::from_f64(2.0);
        let k1 = self.field.at(x);
        let k2 = self.field.at(&(x + k1 * half));
        let k3 = self.field.at(&(x + k2 * half));
        let k4 = self.field.at(&(x + k3 * h));
        x + (k1 + k2 * two + k3 * two + k4) * (T::from_f64(1.0 / 6.0) * h)
    }
    fn step_s(&self) -> f64 {
        self.step_s
    }
}

/// E. N. Lorenz, sigma = 10, rho = 28, beta = 8/3. Exponents 0.9056, 0, -14.5723: J. C. Sprott,
/// Chaos and Time-Series Analysis (2003), table of common chaotic systems.
struct Lorenz;

impl Field for Lorenz {
    fn at<T: Real>(&self, x: &Vector3<T>) -> Vector3<T> {
        let c = T::from_f64;
        Vector3::new(
            c(10.0) * (x[1] - x[0]),
            x[0] * (c(28.0) - x[2]) - x[1],
            x[0] * x[1] - c(8.0 / 3.0) * x[2],
        )
    }
}

/// O. E. Roessler, a = b = 0.2, c = 5.7. Exponents 0.0714, 0, -5.3943: Sprott, as above.
struct Roessler;

impl Field for Roessler {
    fn at<T: Real>(&self, x: &Vector3<T>) -> Vector3<T> {
        let c = T::from_f64;
        Vector3::new(
            -x[1] - x[2],
            x[0] + c(0.2) * x[1],
            c(0.2) + x[2] * (x[0] - c(5.7)),
        )
    }
}

/// The logistic map x -> 4 x (1 - x), whose exponent is ln 2 exactly.
struct Logistic;

impl Flow<1> for Logistic {
    fn step<T: Real>(&self, x: &SVector<T, 1>) -> SVector<T, 1> {
        SVector::<T, 1>::new(T::from_f64(4.0) * x[0] * (T::one() - x[0]))
    }
    fn step_s(&self) -> f64 {
        1.0
    }
}

/// A figure and its error, 1/s.
type Measured = (f64, f64);

/// Standard error and, as a third standard error, what the length can tell apart.
fn measured(exponent: &Exponent) -> Measured {
    let error = exponent
        .standard_error_per_s
        .max(exponent.resolution_per_s / 3.0);
    (exponent.per_s, error)
}

fn apart(a: Measured, b: Measured) -> bool {
    (a.0 - b.0).abs() > 3.0 * a.1.hypot(b.1)
}

fn tangent<const N: usize>(flow: &impl Flow<N>, x: &SVector<f64, N>, time_s: f64) -> Measured {
    let [exponent] = exponents(flow, x, time_s).expect("the motion is bounded");
    measured(&exponent.expect("finite"))
}

fn twins<const N: usize>(flow: &impl Flow<N>, x: &SVector<f64, N>, time_s: f64) -> Measured {
    let exponent = two_particle::largest(flow, x, time_s).expect("the motion is bounded");
    measured(&exponent.expect("finite"))
}

fn synchronised<const N: usize>(flow: &impl Flow<N>, x: &SVector<f64, N>, time_s: f64) -> Measured {
    let threshold = synchronisation::largest(flow, x, time_s, Search::default());
    let threshold = threshold.expect("the interval holds it");
    let (per_s, error) = measured(&threshold.exponent);
    (per_s, error.hypot(threshold.tolerance_per_s))
}

/// The three methods, each on its own stretch of the motion, so that their errors are independent,
/// against each other and against a published figure.
fn assert_exponent<const N: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    time_s: f64,
    published_per_s: f64,
) {
    let second = settle(flow, start, time_s).expect("the motion is bounded");
    let third = settle(flow, &second, time_s).expect("the motion is bounded");
    let all = [
        ("tangent", tangent(flow, start, time_s)),
        ("twin", twins(flow, &second, time_s)),
        ("synchronisation", synchronised(flow, &third, time_s)),
    ];
    for (method, measured) in all {
        println!(
            "{method} {:.5} ± {:.5}, published {published_per_s:.5}",
            measured.0, measured.1
        );
        assert!(
            !apart(measured, (published_per_s, 5e-5)),
            "{method}: {measured:?}"
        );
    }
}

fn assert_spectrum<const N: usize>(spectrum: &Spectrum<N>, published_per_s: [f64; N]) {
    for (exponent, published) in spectrum.iter().zip(published_per_s) {
        let measured = measured(exponent.as_ref().expect("finite"));
        println!(
            "{:.5} ± {:.5}, published {published:.5}",
            measured.0, measured.1
        );
        assert!(
            !apart(measured, (published, 5e-5)),
            "{measured:?}, published {published}"
        );
    }
}

fn sum<const N: usize>(spectrum: &Spectrum<N>) -> f64 {
    spectrum.iter().map(|e| e.expect("finite").per_s).sum()
}

#[test]
fn lorenz() {
    let (field, step_s) = (Lorenz, 0.005);
    let flow = Equation { field, step_s };
    let x = settle(&flow, &Vector3::new(1.0, 2.0, 20.0), 50.0).expect("bounded");
    assert_exponent(&flow, &x, 2000.0, 0.9056);
    let spectrum = exponents(&flow, &x, 2000.0).expect("bounded");
    assert_spectrum(&spectrum, [0.9056, 0.0, -14.5723]);
    // The sum is the divergence of the field, -(sigma + 1 + beta), which is the same everywhere.
    let divergence = -(10.0 + 1.0 + 8.0 / 3.0);
    assert!(
        (sum(&spectrum) - divergence).abs() < 1e-3,
        "{}",
        sum(&spectrum)
    );
}

#[test]
fn roessler() {
    let (field, step_s) = (Roessler, 0.02);
    let flow = Equation { field, step_s };
    let x = settle(&flow, &Vector3::new(1.0, 2.0, 0.1), 200.0).expect("bounded");
    assert_exponent(&flow, &x, 10_000.0, 0.0714);
    let spectrum = exponents(&flow, &x, 10_000.0).expect("bounded");
    assert_spectrum(&spectrum, [0.0714, 0.0, -5.3943]);
}

#[test]
fn logistic_map() {
    let x = SVector::<f64, 1>::new(0.3);
    assert_exponent(&Logistic, &x, 200_000.0, std::f64::consts::LN_2);
}

const TIME_S: f64 = 400.0;

/// The vehicle behind its transient.
fn vehicle(rpm: f64, law: FrictionLaw) -> (VehicleFlow, Vector4<f64>) {
    let mut scenario = Scenario::reconstruction();
    scenario.run.wheel_speed_rpm = rpm;
    scenario.friction.law = law;
    let flow = VehicleFlow::new(&scenario).expect("the scenario is valid");
    let x = settle(&flow, &flow.start(), 200.0).expect("the motion is bounded");
    (flow, x)
}

const LAWS: [FrictionLaw; 2] = [FrictionLaw::CoulombRate, FrictionLaw::None];

/// On one stretch of the motion the methods must give the same figure, but for the search's
/// tolerance and what the stretch's ends add; on different stretches, within their errors.
#[test]
fn the_three_methods_agree_on_the_vehicle() {
    for law in LAWS {
        for rpm in [1600.0, 1700.0, 1750.0, 1845.0, 1880.0] {
            let (flow, x) = vehicle(rpm, law);
            let tangent = tangent(&flow, &x, TIME_S);
            let twin = twins(&flow, &x, TIME_S);
            let synchronised = synchronised(&flow, &x, TIME_S);
            let later = settle(&flow, &x, TIME_S).expect("the motion is bounded");
            let elsewhere = twins(&flow, &later, TIME_S);
            let message = format!(
                "{law:?} at {rpm} rpm: tangent {tangent:.4?}, twin {twin:.4?}, elsewhere {elsewhere:.4?}, synchronisation {synchronised:.4?}"
            );
            println!("{message}");
            assert!((tangent.0 - twin.0).abs() < 1e-3, "{message}");
            assert!((tangent.0 - synchronised.0).abs() < 5e-3, "{message}");
            assert!(!apart(tangent, elsewhere), "{message}");
            assert!(!apart(synchronised, elsewhere), "{message}");
        }
    }
}

/// Along the motion nothing grows or shrinks: one exponent of any motion that is not at rest is
/// zero. On a periodic one it is the largest, on a chaotic one the second.
#[test]
fn one_exponent_is_zero() {
    for (rpm, index) in [
        (1600.0, 0),
        (1845.0, 0),
        (1700.0, 1),
        (1750.0, 1),
        (1880.0, 1),
    ] {
        let (flow, x) = vehicle(rpm, FrictionLaw::CoulombRate);
        let spectrum: Spectrum<4> = exponents(&flow, &x, TIME_S).expect("bounded");
        let zero = spectrum[index].expect("finite");
        println!("{rpm} rpm: {zero}");
        assert!(
            zero.per_s.abs() <= zero.threshold_per_s(),
            "{rpm} rpm: {zero}"
        );
        assert_eq!(
            spectrum[0].expect("finite").is_positive(),
            index == 1,
            "{rpm} rpm"
        );
    }
}

#[test]
fn stick_takes_one_dimension_and_no_more() {
    let (flow, x) = vehicle(1750.0, FrictionLaw::CoulombRate);
    let spectrum: Spectrum<4> = exponents(&flow, &x, TIME_S).expect("bounded");
    assert!(spectrum[..3].iter().all(Option::is_some), "{spectrum:?}");
    assert_eq!(spectrum[3], None);
    // Without the lost direction the others are the same.
    let three: Spectrum<3> = exponents(&flow, &x, TIME_S).expect("bounded");
    assert_eq!(three, spectrum[..3]);
    // At 1500 rpm the steering never comes to rest for good.
    let (flow, x) = vehicle(1500.0, FrictionLaw::CoulombRate);
    let spectrum: Spectrum<4> = exponents(&flow, &x, TIME_S).expect("bounded");
    assert!(spectrum.iter().all(Option::is_some), "{spectrum:?}");
}

/// The model's Jacobian without friction, by dual numbers.
fn jacobian(flow: &VehicleFlow, x: &Vector4<f64>) -> nalgebra::Matrix4<f64> {
    let dual = Vector4::from_fn(|i, _| {
        Dual::<4>::new(x[i], std::array::from_fn(|k| f64::from(u8::from(i == k))))
    });
    let model = flow.model().map(&Dual::constant);
    let injection = flow.injection().map(Dual::constant);
    let derivative = model.derivative(&dual, injection, FrictionMode::Neutral);
    nalgebra::Matrix4::from_fn(|i, k| derivative[i].tangent[k])
}

/// Volume shrinks at the mean divergence of the right-hand side, and the exponents add up to that.
#[test]
fn the_spectrum_adds_up_to_the_mean_divergence() {
    for rpm in [1600.0, 1880.0] {
        let (flow, start) = vehicle(rpm, FrictionLaw::None);
        let spectrum: Spectrum<4> = exponents(&flow, &start, TIME_S).expect("bounded");
        let counted_s = spectrum[0].expect("finite").duration_s;
        let mut x = settle(&flow, &start, 0.1 * TIME_S).expect("bounded");
        let mut divergence = 0.0;
        let steps = (counted_s / flow.step_s()).round() as usize;
        for _ in 0..steps {
            let next = flow.step(&x);
            divergence += jacobian(&flow, &((x + next) * 0.5)).trace();
            x = next;
        }
        divergence /= steps as f64;
        println!(
            "{rpm} rpm: sum {:.6}, divergence {divergence:.6}",
            sum(&spectrum)
        );
        assert!((sum(&spectrum) - divergence).abs() < 1e-3, "{rpm} rpm");
    }
}

/// Exponent of sideslip angle and yaw rate alone, the steering angle being given: their tangent
/// vector by the midpoint rule.
fn conditional_per_s(flow: &VehicleFlow, start: &Vector4<f64>) -> f64 {
    let mut x = *start;
    let mut w = Vector2::new(1.0, 0.0);
    let (mut growth, h) = (0.0, flow.step_s());
    let steps = (TIME_S / h).round() as usize;
    for _ in 0..steps {
        let next = flow.step(&x);
        let block = |x: &Vector4<f64>| jacobian(flow, x).fixed_view::<2, 2>(0, 0).into_owned();
        let half = w + block(&x) * w * (0.5 * h);
        w += block(&((x + next) * 0.5)) * half * h;
        let length = w.dot(&w).sqrt();
        growth += length.ln();
        w /= length;
        x = next;
    }
    growth / TIME_S
}

/// Equation (20) as printed gives the conditional exponent of sideslip angle and yaw rate. It is
/// positive on periodic motions, so it cannot tell chaos.
#[test]
fn the_printed_response_misleads() {
    for rpm in [1600.0, 1845.0] {
        let (flow, x) = vehicle(rpm, FrictionLaw::CoulombRate);
        let (largest, error) = synchronised(&flow, &x, TIME_S);
        assert!(largest.abs() <= 3.0 * error, "{rpm} rpm: {largest}");
        let literal = synchronisation::literal(&flow, &x, TIME_S, Search::default());
        let literal = literal.expect("the interval holds it");
        let conditional = conditional_per_s(&flow, &x);
        println!(
            "{rpm} rpm: (17) {largest:.4}, (20) {}, conditional {conditional:.4}",
            literal.exponent
        );
        assert!(
            literal.exponent.is_positive(),
            "{rpm} rpm: {}",
            literal.exponent
        );
        let difference = literal.exponent.per_s - conditional;
        assert!(
            difference.abs() <= 3.0 * literal.error_per_s(),
            "{rpm} rpm: (20) {}, conditional {conditional}",
            literal.exponent
        );
    }
}

#[test]
fn what_cannot_be_measured_is_said() {
    let (flow, x) = vehicle(1750.0, FrictionLaw::CoulombRate);
    let search = |from_per_s, to_per_s| Search {
        from_per_s,
        to_per_s,
        tolerance_per_s: 1e-2,
    };
    let low = search(-1.0, 0.01);
    let result = synchronisation::largest(&flow, &x, TIME_S, low);
    assert_eq!(result, Err(NoThreshold::NoneSynchronises(low)));
    let high = search(2.0, 3.0);
    let result = synchronisation::largest(&flow, &x, TIME_S, high);
    assert_eq!(result, Err(NoThreshold::AllSynchronise(high)));
    let message = result.expect_err("it is untested").to_string();
    assert_eq!(
        message,
        "untested: every coupling from 2 to 3 1/s synchronises"
    );

    assert!(matches!(
        exponents::<4, 1>(&flow, &x, 0.1),
        Err(Unmeasured::TooShort { .. })
    ));
    assert!(matches!(
        synchronisation::largest(&flow, &x, 0.01, low),
        Err(NoThreshold::Unmeasured(Unmeasured::TooShort { .. }))
    ));

    let mut scenario = Scenario::reconstruction();
    (scenario.tires.front, scenario.tires.rear) = HIGH_FRICTION_ROAD;
    let flow = VehicleFlow::new(&scenario).expect("the scenario is valid");
    let diverges = |result: Option<Unmeasured>| matches!(result, Some(Unmeasured::EndsEarly(end)) if end.reason == Reason::Diverges);
    let start = flow.start();
    assert!(diverges(settle(&flow, &start, 200.0).err()));
    assert!(diverges(exponents::<4, 4>(&flow, &start, 200.0).err()));
    assert!(diverges(two_particle::largest(&flow, &start, 200.0).err()));
    assert!(matches!(
        synchronisation::largest(&flow, &start, 200.0, low),
        Err(NoThreshold::Unmeasured(Unmeasured::EndsEarly(end))) if end.reason == Reason::Diverges
    ));
}

/// Exponents from many starts differ as much as their standard errors say: of 128, nominally 95 % are within
/// 1.96 of theirs from the mean of all. Just above the period doubling laminar phases are nearly as long as
/// the run of 600 s, and 83 to 86 % are.
#[test]
fn standard_errors_cover_the_exponent() {
    let mut shares = Vec::new();
    for rpm in [1645.0, 1650.0, 1700.0, 1750.0, 1880.0, 1950.0] {
        let mut scenario = Scenario::reconstruction();
        scenario.run.wheel_speed_rpm = rpm;
        let starts: Vec<_> = (0..128)
            .map(|k| {
                let mut start = scenario;
                start.run.sideslip_rad = 0.1 + 0.001 * f64::from(k);
                start
            })
            .collect();
        let timing = Timing::new(300.0, 900.0).unwrap();
        let found = attractors(&starts, timing, true, RunControl::none()).unwrap();
        let measured: Vec<(f64, f64)> = found
            .into_iter()
            .flatten()
            .filter(|attractor| attractor.kind.is_chaotic())
            .filter_map(|attractor| {
                let threshold = attractor.exponent_threshold_per_s?;
                Some((attractor.exponent_per_s?, threshold / 3.0))
            })
            .collect();
        let count = measured.len() as f64;
        assert!(count > 60.0, "{rpm} rpm: {count}");
        let mean = measured.iter().map(|(exponent, _)| exponent).sum::<f64>() / count;
        let covered = measured
            .iter()
            .filter(|(e, error)| (e - mean).abs() < 1.96 * error);
        let share = covered.count() as f64 / count;
        shares.push((rpm, share));
    }
    for (rpm, share) in shares {
        let least = if rpm < 1700.0 { 0.78 } else { 0.92 };
        assert!(share > least, "{rpm} rpm: {share}");
    }
}
