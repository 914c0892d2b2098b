//! Feedback of the whole state to an equilibrium: from chaos to rest.
//!
//! Near an unstable focus x_e of the sliding vehicle, z = w (x - x_e) with the left eigenvector w of the eigenvalue
//! lambda = sigma + i omega follows z' = lambda z + c u, u being the torque. A torque of at most U can return z
//! only from |z| < 2 U |c| / (pi sigma), for sigma much less than omega (T. Hu, Z. Lin, Control Systems with Actuator
//! Saturation, 2001, section 2.3). The feedback acts only there, and waits elsewhere for the chaos to lead the
//! trajectory there. Its gain is twice that of least energy, which mirrors the pair of eigenvalues, because friction
//! takes part of the torque. Near the equilibrium friction holds the steering, and the rest is stable without torque.
//!
//! It needs the whole state, and so the sideslip angle, for which the vehicle has no sensor.

use super::feedback::Plan;
use super::simulation::{Held, run};
use super::vehicle::vehicle;
use crate::equilibria::{Equilibrium, find};
use engine::dual::Dual;
use nalgebra::{Complex, Matrix4, Vector4};
use shared_model::Scenario;
use shared_model::friction::FrictionMode;

/// The gain, relative to that of least energy.
const GAIN: f64 = 2.0;
/// Greatest range of the yaw rate over the last minute of a vehicle at rest, rad/s.
const AT_REST_RAD_PER_S: f64 = 1e-3;
/// Relative distance from the eigenvalue at which its eigenvector is iterated, and steps of that.
const SHIFT: f64 = 1e-9;
const ITERATIONS: usize = 10;

/// An unstable focus, and the torque that leads to it.
#[derive(Debug, Clone)]
struct Focus {
    state: Vector4<f64>,
    left: Vector4<Complex<f64>>,
    /// Greatest |z| from which the limit of the torque suffices.
    radius: f64,
    /// Torque per deviation of the state.
    gains: Vector4<f64>,
}

impl Focus {
    /// `None` if the equilibrium is no focus with one unstable pair of eigenvalues.
    fn at(scenario: &Scenario<f64>, equilibrium: &Equilibrium, limit_nm: f64) -> Option<Self> {
        let pair = equilibrium.leading_pair()?;
        let unstable = equilibrium
            .eigenvalues_per_s
            .iter()
            .filter(|value| value.re > 0.0);
        if pair.re <= 0.0 || unstable.count() != 2 {
            return None;
        }
        let state = Vector4::from(equilibrium.state);
        let (by_state, by_torque) = linearised(scenario, &state);
        let eigenvalue = Complex::new(pair.re, pair.im);
        let left = left_eigenvector(&by_state, eigenvalue)?;
        let by_torque: Complex<f64> = left.iter().zip(&by_torque).map(|(w, b)| w * b).sum();
        let (sigma, omega) = (pair.re, pair.im);
        // Re(c k) = 2 sigma and Re(conj(lambda) c k) = 0 mirror the pair under u = -2 Re(k z).
        let gain = Complex::new(omega, -sigma) * (2.0 * sigma / omega) / by_torque;
        Some(Self {
            state,
            left,
            radius: 2.0 * limit_nm * by_torque.norm() / (std::f64::consts::PI * sigma),
            gains: left.map(|w| 2.0 * (gain * w).re),
        })
    }

    /// |z| relative to its greatest.
    fn distance(&self, x: &Vector4<f64>) -> f64 {
        let deviation = x - self.state;
        let z: Complex<f64> = self.left.iter().zip(&deviation).map(|(w, d)| w * d).sum();
        z.norm() / self.radius
    }
}

/// Derivatives of the rates by the state and by the motor's torque, without friction.
fn linearised(scenario: &Scenario<f64>, x: &Vector4<f64>) -> (Matrix4<f64>, Vector4<f64>) {
    let (model, torque_nm, injection) = vehicle(scenario);
    let mut dual = model.map(&Dual::<5>::constant);
    let seeded = |value: f64, n: usize| {
        let mut seeded = Dual::constant(value);
        seeded.tangent[n] = 1.0;
        seeded
    };
    dual.set_motor_torque_nm(seeded(torque_nm, 4));
    let state = Vector4::from_fn(|k, _| seeded(x[k], k));
    let rates = dual.derivative(&state, injection.map(Dual::constant), FrictionMode::Neutral);
    (
        Matrix4::from_fn(|row, column| rates[row].tangent[column]),
        rates.map(|rate| rate.tangent[4]),
    )
}

/// By inverse iteration; of norm 1.
fn left_eigenvector(
    matrix: &Matrix4<f64>,
    eigenvalue: Complex<f64>,
) -> Option<Vector4<Complex<f64>>> {
    let shifted = matrix.transpose().map(Complex::from)
        - Matrix4::from_diagonal_element(eigenvalue * (1.0 + SHIFT));
    let factors = shifted.lu();
    let mut left = Vector4::new(1.0, -0.7, 0.5, 0.3).map(Complex::from);
    for _ in 0..ITERATIONS {
        left = factors.solve(&left)?.normalize();
    }
    Some(left)
}

/// The trajectory of a vehicle with feedback to the nearest unstable focus of the scenario, where the limit suffices.
/// It is captured if it comes to rest, from when the feedback acts without a break.
pub(super) fn simulate(scenario: &Scenario<f64>, plan: &Plan, plant: &Scenario<f64>) -> Held {
    let limit_nm = plan.feedback.limit_nm;
    let equilibria = find(scenario).unwrap_or_default();
    let foci: Vec<Focus> = equilibria
        .iter()
        .filter_map(|equilibrium| Focus::at(scenario, equilibrium, limit_nm))
        .collect();
    let (mut ticks_on, mut acting_since) = (0_u64, None);
    let mut law = |x: &Vector4<f64>, is_on: bool| {
        let distances = foci.iter().map(|focus| (focus.distance(x), focus));
        let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
        let within = nearest.filter(|(distance, _)| is_on && *distance < 1.0);
        ticks_on += u64::from(is_on);
        let Some((_, focus)) = within else {
            acting_since = None;
            return 0.0;
        };
        acting_since.get_or_insert(ticks_on - 1);
        let wanted_nm = -GAIN * focus.gains.dot(&(x - focus.state));
        wanted_nm.clamp(-limit_nm, limit_nm)
    };
    let delayed_by = (plan.feedback.latency_ticks, limit_nm);
    let held = run(plant, &plan.conditions, delayed_by, &mut law);
    let is_at_rest = held
        .yaw_rates_rad_per_s
        .is_some_and(|(low, high)| held.diverges_at_s.is_none() && high - low < AT_REST_RAD_PER_S);
    let since_s = |ticks: u64| ticks as f64 / plant.run.control_rate_hz;
    Held {
        capture_s: acting_since.filter(|_| is_at_rest).map(since_s),
        ..held
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eigenvalues::eigenvalues;

    /// The gain of least energy mirrors the unstable pair and leaves the other eigenvalues.
    #[test]
    fn the_unstable_pair_is_mirrored() {
        let scenario = Scenario::reconstruction();
        let equilibria = find(&scenario).unwrap();
        let mut foci = 0;
        for equilibrium in &equilibria {
            let Some(focus) = Focus::at(&scenario, equilibrium, 8.0) else {
                continue;
            };
            foci += 1;
            let (by_state, by_torque) = linearised(&scenario, &focus.state);
            let before = &equilibrium.eigenvalues_per_s;
            let mut wanted: Vec<(f64, f64)> = before.iter().map(|e| (-e.re.abs(), e.im)).collect();
            wanted.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
            let under = eigenvalues(&(by_state - by_torque * focus.gains.transpose()));
            for (under, (re, im)) in under.iter().zip(&wanted) {
                assert!(
                    (under.re - re).hypot(under.im - im) < 1e-6,
                    "{under} {re} {im}"
                );
            }
            assert!(focus.distance(&focus.state) == 0.0 && focus.radius > 0.0);
        }
        assert_eq!(foci, 5);
    }
}
