//! Largest Lyapunov exponent by twin trajectories: no derivative at all.

use crate::flow::{Flow, Unmeasured, check, steps};
use crate::lyapunov::{Exponent, over_segments};
use nalgebra::SVector;

/// Distance of the two motions after each return.
const DISTANCE: f64 = 1e-8;
/// Time between returns, s; at least a step.
const INTERVAL_S: f64 = 0.1;

/// Largest Lyapunov exponent of the motion from `start` over `time_s`, by a second motion beside
/// it.
///
/// The second one starts 1e-8 away and is brought back to that distance every tenth of a second,
/// along the line that joins the two; the logarithms of the factors add up to the exponent. G.
/// Benettin, L. Galgani, J.-M. Strelcyn, Physical Review A 14 (1976) 2338. Friction events and
/// stick need no care, since each motion meets its own.
///
/// `None` stands for minus infinity: the two motions become one. The first tenth of the time is not
/// counted.
///
/// # Errors
/// If the motion diverges, or is too short.
///
/// ```
/// use dynamics::flow::Flow;
/// use nalgebra::Vector1;
/// use shared_model::Real;
///
/// /// x' = -x: two trajectories approach each other at 1 1/s.
/// struct Decay;
///
/// impl Flow<1> for Decay {
///     fn step<T: Real>(&self, x: &Vector1<T>) -> Vector1<T> {
///         x * T::from_f64((-self.step_s()).exp())
///     }
///     fn step_s(&self) -> f64 {
///         1e-2
///     }
/// }
///
/// let exponent = dynamics::two_particle::largest(&Decay, &Vector1::new(0.1), 100.0)?;
/// assert!((exponent.unwrap().per_s + 1.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn largest<const N: usize>(
    flow: &impl Flow<N>,
    start: &SVector<f64, N>,
    time_s: f64,
) -> Result<Option<Exponent>, Unmeasured> {
    let interval = steps(flow, INTERVAL_S).max(1);
    let mut x = *start;
    let mut twin = x.add_scalar(DISTANCE / (N as f64).sqrt());
    let mut done = 0;
    let segments = over_segments(flow, time_s, |steps| {
        let mut growth = 0.0;
        let mut left = steps;
        while left > 0 {
            let stretch = left.min(interval);
            for _ in 0..stretch {
                x = flow.step(&x);
                twin = flow.step(&twin);
            }
            left -= stretch;
            done += stretch;
            check(flow, start, &x, done)?;
            let apart = twin - x;
            let distance = apart.dot(&apart).sqrt();
            growth += (distance / DISTANCE).ln();
            if distance > 0.0 {
                twin = x + apart * (DISTANCE / distance);
            }
        }
        Ok([growth])
    })?;
    let [exponent] = segments.spectrum();
    Ok(exponent)
}
