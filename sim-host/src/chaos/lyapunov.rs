//! Largest Lyapunov exponent by tangent dynamics.
//!
//! A tangent vector is carried along a motion by the linearised step (dual numbers through the ECU's own program, so with
//! the right jumps at friction events; stick takes one dimension away), and the mean rate of its growth is the exponent.
//! The motion may be any recorded one: the firmware's own telemetry will do.

use crate::chaos::period::yaw_rate_maxima;
use crate::engine::dual::Dual;
use crate::trace::Trace;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::controller::Ecu;
use shared_model::vehicle::State;

/// Blocks end at every sixth maximum of the yaw rate, where a motion of period 1, 2, 3 or 6 is at the same phase again: the
/// vector's stretching and shrinking within a cycle then cancels.
const MAXIMA_IN_BLOCK: usize = 6;
/// Fewest blocks for a standard error.
const MIN_BLOCKS: usize = 4;
/// Where there are no maxima (at rest), blocks of equal time.
const BLOCKS_AT_REST: usize = 20;
/// Time in which the tangent vector turns into the direction of fastest growth, as a share of the motion.
const WARM_UP: f64 = 0.1;

/// A Lyapunov exponent with its statistical error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponent {
    /// Mean growth rate, 1/s.
    pub per_s: f64,
    /// Standard error from the scatter of block means, 1/s.
    pub standard_error_per_s: f64,
    /// Length of the motion that it is taken over, s.
    pub duration_s: f64,
}

impl Exponent {
    /// The exponent from growths (of the logarithm) and lengths (s) of blocks.
    fn from_blocks(blocks: &[(f64, f64)]) -> Self {
        let n = blocks.len() as f64;
        let duration_s: f64 = blocks.iter().map(|&(_, length)| length).sum();
        let mean = blocks.iter().map(|&(growth, _)| growth).sum::<f64>() / duration_s;
        // Scatter of the growths about the mean rate, blocks being nearly equally long.
        let squares: f64 = blocks
            .iter()
            .map(|&(growth, length)| (growth - mean * length).powi(2))
            .sum();
        Self {
            per_s: mean,
            standard_error_per_s: (squares * n / (n - 1.0)).sqrt() / duration_s,
            duration_s,
        }
    }

    /// The least rate that the motion's length can tell from zero: one e-fold over all of it.
    pub fn resolution_per_s(&self) -> f64 {
        1.0 / self.duration_s
    }

    /// Above zero by three standard errors and by its resolution: the motion is chaotic.
    pub fn is_positive(&self) -> bool {
        self.per_s > (3.0 * self.standard_error_per_s).max(self.resolution_per_s())
    }
}

impl std::fmt::Display for Exponent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.3} ± {:.3} 1/s over {:.0} s",
            self.per_s, self.standard_error_per_s, self.duration_s
        )
    }
}

/// Largest exponent along the recorded motion of a scenario from the state with index `from` on. `None` if the motion is too
/// short for a standard error, or not finite.
pub fn largest(scenario: &Scenario<f64>, trace: &Trace, from: usize) -> Option<Exponent> {
    let growth = tangent_growth(scenario, trace)?;
    let warm = from + ((trace.states.len() - from) as f64 * WARM_UP) as usize;
    let ends = block_ends(trace, warm);
    if ends.len() < MIN_BLOCKS + 1 {
        return None;
    }
    let block = |ends: &[usize]| {
        let length = (ends[1] - ends[0]) as f64 * trace.step_s;
        (growth[ends[1]] - growth[ends[0]], length)
    };
    let blocks: Vec<_> = ends.windows(2).map(block).collect();
    let exponent = Exponent::from_blocks(&blocks);
    exponent.per_s.is_finite().then_some(exponent)
}

/// Logarithm of the tangent vector's length at each state.
fn tangent_growth(scenario: &Scenario<f64>, trace: &Trace) -> Option<Vec<f64>> {
    let mut ecu = Ecu::new(&scenario.map(&Dual::<1>::constant)).ok()?;
    let mut tangent = Vector4::repeat(0.5);
    let mut logarithm = 0.0;
    let mut growth = Vec::with_capacity(trace.states.len());
    for start in trace.starts() {
        ecu.control.set_state(State {
            x: start.x.zip_map(&tangent, |value, t| Dual::new(value, [t])),
            friction: start.friction,
        });
        tangent = ecu.step(|_| {}).x.map(|component| component.tangent[0]);
        let length = tangent.dot(&tangent).sqrt();
        tangent /= length;
        logarithm += length.ln();
        growth.push(logarithm);
    }
    Some(growth)
}

/// Indices of the states at which blocks end and begin.
fn block_ends(trace: &Trace, from: usize) -> Vec<usize> {
    let maxima = yaw_rate_maxima(trace, from);
    if maxima.len() >= MAXIMA_IN_BLOCK {
        let index = |&(time_s, _): &(f64, f64)| (time_s / trace.step_s).round() as usize - 1;
        return maxima.iter().step_by(MAXIMA_IN_BLOCK).map(index).collect();
    }
    let block = (trace.states.len() - from) / BLOCKS_AT_REST;
    (from..trace.states.len()).step_by(block.max(1)).collect()
}
