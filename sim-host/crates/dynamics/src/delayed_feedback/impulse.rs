//! An impulse per cycle: the other classical way to hold an unstable orbit.
//!
//! E. Ott, C. Grebogi, J. A. Yorke, Physical Review Letters 64 (1990) 1196. Where the trajectory crosses a section
//! near the orbit, a constant torque for a tenth of a second takes its next return onto the orbit's stable
//! manifold. It needs the whole state, and so the sideslip angle, for which the vehicle has no sensor.

use super::feedback::Conditions;
use super::linearised::Linearised;
use super::simulation::{Held, run};
use nalgebra::{Matrix4, Vector4};
use shared_model::Scenario;

/// Length of an impulse, s.
const IMPULSE_S: f64 = 0.1;
/// Iterations for the left eigenvector: the next multiplier is 1, that of the shift along the orbit.
const ITERATIONS: usize = 2000;

/// The torque of an impulse by the state at the section.
#[derive(Debug, Clone)]
struct Impulse {
    start: Vector4<f64>,
    /// Normal of the section, along the orbit.
    normal: Vector4<f64>,
    /// Torque per deviation from the orbit.
    gains: Vector4<f64>,
    ticks: usize,
}

impl Impulse {
    fn of(orbit: &Linearised) -> Self {
        let ticks = (IMPULSE_S / orbit.tick_s()).round() as usize;
        let mut by_state = Matrix4::identity();
        let mut by_torque = Vector4::zeros();
        for (k, tick) in orbit.ticks().iter().enumerate() {
            by_torque = tick.by_state * by_torque;
            if k < ticks {
                by_torque += tick.by_torque;
            }
            by_state = tick.by_state * by_state;
        }
        // The left eigenvector of the unstable multiplier sees neither the stable directions nor the shift.
        let transposed = by_state.transpose();
        let mut left = Vector4::new(1.0, 0.5, -0.3, 0.2);
        for _ in 0..ITERATIONS {
            left = (transposed * left).normalize();
        }
        let multiplier = left.dot(&(transposed * left));
        Self {
            start: orbit.start.into(),
            normal: orbit.ticks()[0].rate,
            gains: left * (-multiplier / left.dot(&by_torque)),
            ticks,
        }
    }
}

/// The trajectory of a vehicle with an impulse in each cycle that takes no more than the limit.
pub(super) fn simulate(
    plant: &Scenario<f64>,
    orbit: &Linearised,
    limit_nm: f64,
    conditions: &Conditions,
) -> Held {
    let impulse = Impulse::of(orbit);
    let mut side = 0.0;
    let (mut left_ticks, mut torque_nm) = (0, 0.0);
    let mut law = |x: &Vector4<f64>, _: bool| {
        let deviation = x - impulse.start;
        let before = std::mem::replace(&mut side, impulse.normal.dot(&deviation));
        if before < 0.0 && side >= 0.0 {
            let wanted_nm = impulse.gains.dot(&deviation);
            let is_near = wanted_nm.abs() <= limit_nm;
            left_ticks = if is_near { impulse.ticks } else { 0 };
            torque_nm = wanted_nm;
        }
        if left_ticks == 0 {
            return 0.0;
        }
        left_ticks -= 1;
        torque_nm
    };
    let held = run(plant, conditions, (0, limit_nm), &mut law);
    // Without any impulse it is another orbit's own motion.
    let is_its = held.torque_peak_nm > 0.0;
    Held {
        capture_s: held.capture_s.filter(|_| is_its),
        ..held
    }
}
