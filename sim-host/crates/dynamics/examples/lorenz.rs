//! The largest Lyapunov exponent of a system of one's own, here Lorenz's, by two methods.
//!
//! `cargo run --release -p dithersteer-dynamics --example lorenz`

use dynamics::flow::{Flow, settle};
use dynamics::{lyapunov, two_particle};
use nalgebra::{SVector, Vector3};
use shared_model::Real;

/// x' = s (y - x), y' = x (r - z) - y, z' = x y - b z at s = 10, r = 28, b = 8/3.
struct Lorenz;

const STEP_S: f64 = 2e-3;

fn derivative<T: Real>(x: &SVector<T, 3>) -> SVector<T, 3> {
    let number = T::from_f64;
    let [x, y, z] = [x[0], x[1], x[2]];
    Vector3::new(
        number(10.0) * (y - x),
        x * (number(28.0) - z) - y,
        x * y - number(8.0 / 3.0) * z,
    )
}

impl Flow<3> for Lorenz {
    /// One step of the classical Runge-Kutta method.
    fn step<T: Real>(&self, x: &SVector<T, 3>) -> SVector<T, 3> {
        let h = T::from_f64(STEP_S);
        let half = T::from_f64(0.5 * STEP_S);
        let a = derivative(x);
        let b = derivative(&(x + a * half));
        let c = derivative(&(x + b * half));
        let d = derivative(&(x + c * h));
        x + (a + (b + c) * T::from_f64(2.0) + d) * (h * T::from_f64(1.0 / 6.0))
    }

    fn step_s(&self) -> f64 {
        STEP_S
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let start = settle(&Lorenz, &Vector3::new(1.0, 1.0, 20.0), 50.0)?;
    let [tangent] = lyapunov::exponents(&Lorenz, &start, 2000.0)?;
    let tangent = tangent.ok_or("the tangent vector vanished")?;
    let two_particle = two_particle::largest(&Lorenz, &start, 2000.0)?;
    let two_particle = two_particle.ok_or("the trajectories coincide")?;
    println!("tangent dynamics:    {tangent}");
    println!("two-particle method: {two_particle}");
    // J. C. Sprott, Chaos and Time-Series Analysis (2003): 0.9056.
    for exponent in [tangent, two_particle] {
        assert!((exponent.per_s - 0.9056).abs() < 3.0 * exponent.standard_error_per_s.max(0.003));
    }
    Ok(())
}
