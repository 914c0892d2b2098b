//! Turning points and crossings of a section within a step.

use super::Batch;
use crate::taylor::equation::Equation;
use crate::taylor::lanes::{LaneSet, Lanes};
use crate::taylor::observables::Crossing;
use crate::taylor::roots::{self, derivative};
use crate::taylor::series::{ORDER, Series, of_lane, value};
use pulp::Simd;
use shared_model::vehicle::YAW_RATE;

/// A rate of change below this (in the component's unit a second) is rounding, which has turning
/// points of its own.
const RATE_FLOOR: f64 = 1e-13;

impl<'a, S: Simd, const V: usize, const K: usize, E: Equation> Batch<'a, S, V, K, E> {
    /// Notes the turning points of a component within the step.
    #[inline(always)]
    pub(super) fn find_turning_points(&mut self, component: usize, step_s: &Lanes<S, V>) {
        let x = &self.expansion.x[component];
        let mut rate = [Lanes::splat(self.simd, 0.0); ORDER + 1];
        for k in 0..ORDER {
            rate[k] = x[k + 1].scale((k + 1) as f64);
        }
        let floor = Lanes::splat(self.simd, RATE_FLOOR);
        let clear = clearance(&rate, value(&rate, *step_s), *step_s) + floor;
        for lane in lanes_with_roots(clear, bend(&rate, *step_s)) {
            let most_s = step_s.as_slice()[lane];
            let begin_s = self.time_s(lane);
            let path = of_lane(&self.expansion.x[component], lane);
            let tangent = match component {
                YAW_RATE => self.expansion.tangents.first(),
                _ => None,
            };
            let stretch = match self.stretch.first() {
                Some(stretch) => stretch.as_slice()[lane],
                None => 1.0,
            };
            let Some(motion) = &mut self.lanes[lane] else {
                continue;
            };
            roots::roots(&derivative(&path), most_s, |root_s, _| {
                let turn = roots::value(&path, root_s);
                motion.trajectory.turns[component].push((begin_s + root_s, turn));
                motion.trajectory.extend(component, turn);
                if let Some(tangent) = tangent {
                    let log_stretching = motion.log_stretching_before
                        + stretch.ln()
                        + log_length(tangent, lane, root_s);
                    motion
                        .trajectory
                        .log_stretching_at_turns
                        .push(log_stretching);
                }
            });
        }
    }

    /// Notes the crossings of a component's level within the step.
    #[inline(always)]
    pub(super) fn find_crossings(
        &mut self,
        component: usize,
        level: f64,
        step_s: &Lanes<S, V>,
        next: &[Lanes<S, V>; 4],
    ) {
        let level_lanes = Lanes::splat(self.simd, level);
        let mut series = self.expansion.x[component];
        series[0] = series[0] - level_lanes;
        let clear = clearance(&series, next[component] - level_lanes, *step_s);
        for lane in lanes_with_roots(clear, bend(&series, *step_s)) {
            let most_s = step_s.as_slice()[lane];
            let begin_s = self.time_s(lane);
            let height = of_lane(&series, lane);
            let x = &self.expansion.x;
            let Some(motion) = &mut self.lanes[lane] else {
                continue;
            };
            roots::roots(&height, most_s, |root_s, rising| {
                motion.trajectory.crossings.push(Crossing {
                    time_s: begin_s + root_s,
                    x: x.each_ref()
                        .map(|series| roots::value(&of_lane(series, lane), root_s)),
                    rising,
                });
            });
        }
    }
}

/// Logarithm of the length of one lane's tangent vector, `t` from the step's beginning.
#[inline(always)]
fn log_length<S: Simd, const V: usize>(tangent: &[Series<S, V>; 4], lane: usize, t: f64) -> f64 {
    let mut square = 0.0;
    for series in tangent {
        square += roots::value(&of_lane(series, lane), t).powi(2);
    }
    0.5 * square.ln()
}

/// Lanes in which a polynomial may have roots: its chord is no clearer of zero than it bends.
#[inline(always)]
fn lanes_with_roots<S: Simd, const V: usize>(clear: Lanes<S, V>, bend: Lanes<S, V>) -> LaneSet {
    if bend.all_less(clear) {
        return LaneSet::NONE;
    }
    (clear - bend).at_most_zero()
}

/// Bound on how far a polynomial is from its chord within (0, `t`).
#[inline(always)]
fn bend<S: Simd, const V: usize>(series: &Series<S, V>, t: Lanes<S, V>) -> Lanes<S, V> {
    let mut sum = series[ORDER].abs();
    for k in (2..ORDER).rev() {
        sum = sum.mul_add(t, series[k].abs());
    }
    sum * (t * t)
}

/// Distance from zero of a polynomial's chord over a step; negative where it changes sign.
#[inline(always)]
fn clearance<S: Simd, const V: usize>(
    series: &Series<S, V>,
    end: Lanes<S, V>,
    step_s: Lanes<S, V>,
) -> Lanes<S, V> {
    let zero = step_s.zero();
    let begin = series[0];
    let end = begin.select_less(zero, -end, end);
    begin.abs().min(end)
}
