//! The fixed step against the model's fastest rate.
//!
//! A Runge-Kutta step of fourth order is stable as long as step times rate stays within its region
//! of stability (E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.2).
//! Beyond it the numerical solution diverges where the motion itself decays. Rates are bounded by
//! the eigenvalues of the model linearised over the slopes that its tyres have.

use crate::tire::Tire;
use crate::vehicle::Model;
use crate::{Real, Scenario};

/// Greatest step times rate: the half disc of this radius on the left of the imaginary axis is
/// within the region of stability.
pub const MAX_STEP_TIMES_RATE: f64 = 2.6;
/// Least rate of the fixed step that is stable with a model's fastest rate, Hz: a whole number, as
/// the rates must be.
pub fn min_rate_hz(fastest_rate_per_s: f64) -> f64 {
    libm::ceil(fastest_rate_per_s / MAX_STEP_TIMES_RATE)
}

/// Squarings of a matrix whose norm then bounds the greatest eigenvalue: the bound is less than a
/// percent high.
const SQUARINGS: u32 = 10;

type Matrix = nalgebra::Matrix4<f64>;

/// Bound on the model's fastest rate, 1/s: the greatest magnitude of an eigenvalue of (14),
/// linearised with every pair of slopes that the tyres of the two axles may have, their dither
/// included.
///
/// ```
/// let scenario = shared_model::Scenario::<f64>::reconstruction();
/// // The steering's damping over its inertia is 20 1/s; the aligning torque adds to it.
/// let rate = shared_model::stability::fastest_rate_per_s(&scenario);
/// assert!((23.8..24.0).contains(&rate), "{rate}");
/// ```
pub fn fastest_rate_per_s<T: Real>(scenario: &Scenario<T>) -> f64 {
    let model = Model::new(scenario);
    let amplitude_rad = scenario.dither.amplitude_rad();
    let (front, rear) = model.tires();
    let mut fastest = 0.0;
    for front in slopes(front, amplitude_rad) {
        for rear in slopes(rear, amplitude_rad) {
            let rate = greatest_eigenvalue(jacobian(&model, front, rear));
            if rate > fastest || rate.is_nan() {
                fastest = rate;
            }
        }
    }
    fastest
}

/// Least and greatest slope of a tyre, N/rad.
///
/// A cubic tyre has k1 at no slip, and -2 k1 where its force is zero again: motions stay between
/// the two. The dither takes 3 k2 W^2 from k1 at most. The Magic Formula's slope is bounded by its
/// stiffness, B C D max(1, |1 - E|), either way.
fn slopes<T: Real>(tire: &Tire<T>, amplitude_rad: T) -> [f64; 2] {
    match tire {
        Tire::Cubic(tire) => {
            let dithered = tire.softened(amplitude_rad * amplitude_rad);
            let [plain, dithered] = [tire, &dithered].map(|tire| tire.linear_n_per_rad.to_f64());
            // Where the dither turns the sign of the slope, no other angle is without force.
            let returning = if dithered * plain > 0.0 {
                dithered
            } else {
                0.0
            };
            let all = [plain, -2.0 * plain, dithered, -2.0 * returning];
            [
                all.iter().copied().fold(0.0, f64::min),
                all.iter().copied().fold(0.0, f64::max),
            ]
        }
        Tire::MagicFormula(tire, _) => {
            let stiffness = tire.stiffness_per_rad * tire.shape * tire.peak_n;
            let steeper = (1.0 - tire.curvature.to_f64()).abs().max(1.0);
            let slope = stiffness.to_f64() * steeper;
            [-slope, slope]
        }
    }
}

/// The right-hand side (14) linearised, with given slopes of the tyres, N/rad. Dry friction is
/// constant within its modes.
fn jacobian<T: Real>(model: &Model<T>, front: f64, rear: f64) -> Matrix {
    let c = model.constants();
    let (front_lever_s, rear_lever_s) = (c.front_lever_s.to_f64(), c.rear_lever_s.to_f64());
    let (front_gain, rear_gain) = (c.front_yaw_gain.to_f64(), c.rear_yaw_gain.to_f64());
    let lateral = c.lateral_gain.to_f64();
    let per_inertia = c.inverse_steering_inertia.to_f64();
    let (front_yaw, rear_yaw) = (front_gain * front, rear_gain * rear);
    let aligning = c.trail_m.to_f64() * front * per_inertia;
    Matrix::new(
        (front + rear) * lateral,
        (front * front_lever_s - rear * rear_lever_s) * lateral - 1.0,
        -front * lateral,
        0.0,
        front_yaw - rear_yaw,
        front_yaw * front_lever_s + rear_yaw * rear_lever_s,
        -front_yaw,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
        -aligning,
        -aligning * front_lever_s,
        aligning,
        -c.damping_nm_s_per_rad.to_f64() * per_inertia,
    )
}

/// Bound on the magnitude of the greatest eigenvalue: the root of the norm of a power (I. Gelfand).
/// The power is scaled at each squaring, so that no number overflows.
fn greatest_eigenvalue(matrix: Matrix) -> f64 {
    // `power`, scaled, is the matrix to the power of `exponent`, whose norm is `bound` to that
    // power times its own.
    let mut power = matrix;
    let mut bound = 1.0;
    let mut exponent = 1.0;
    for _ in 0..SQUARINGS {
        let scale = norm(&power);
        if scale == 0.0 {
            return 0.0;
        }
        power /= scale;
        bound *= root(scale, exponent);
        power *= power;
        exponent *= 2.0;
    }
    bound * root(norm(&power), exponent)
}

/// Greatest sum of magnitudes in a row.
fn norm(matrix: &Matrix) -> f64 {
    let mut greatest = 0.0;
    for row in 0..4 {
        let mut sum: f64 = 0.0;
        for column in 0..4 {
            sum += f64::abs(matrix[(row, column)]);
        }
        if sum > greatest || sum.is_nan() {
            greatest = sum;
        }
    }
    greatest
}

/// The root of the given degree, a power of two.
fn root(value: f64, degree: f64) -> f64 {
    let mut value = value;
    let mut left = degree;
    while left > 1.0 {
        value = libm::sqrt(value);
        left *= 0.5;
    }
    value
}
