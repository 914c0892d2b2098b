//! How the tangent vectors grow.

use super::{Batch, coefficients};
use crate::taylor::equation::Equation;
use crate::taylor::lanes::Lanes;
use pulp::Simd;

/// Lengths of a tangent vector, squared, that leave room for a step's growth.
const LENGTHS_SQUARED: (f64, f64) = (1e-200, 1e200);
/// A tangent vector is lost when orthogonalisation leaves less than this share of it, squared.
const LOST_SQUARED: f64 = 1e-24;

impl<'a, S: Simd, const V: usize, const K: usize, E: Equation> Batch<'a, S, V, K, E> {
    /// Keeps a single tangent vector within the range of numbers; several at right angles and of
    /// length one, by Gram and Schmidt.
    #[inline(always)]
    pub(super) fn keep_tangents_finite(&mut self) {
        if K == 0 {
            return;
        }
        if K == 1 {
            let vector = coefficients(&self.expansion.tangents[0], 0);
            let square = dot(&vector, &vector);
            let (least, most) = LENGTHS_SQUARED;
            let simd = self.simd;
            let splat = |number| Lanes::splat(simd, number);
            if !(splat(least).all_less(square) && square.all_less(splat(most))) {
                for lane in 0..Lanes::<S, V>::COUNT {
                    if !(least..most).contains(&square.as_slice()[lane]) {
                        self.accumulate_stretching(lane);
                    }
                }
            }
            return;
        }
        self.orthonormalise();
        let (least, most) = LENGTHS_SQUARED;
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        for k in 0..K {
            let stretch = self.stretch[k];
            if !(splat(least).all_less(stretch) && stretch.all_less(splat(most))) {
                for lane in 0..Lanes::<S, V>::COUNT {
                    if !(least..most).contains(&stretch.as_slice()[lane]) {
                        self.accumulate_stretching(lane);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn orthonormalise(&mut self) {
        let simd = self.simd;
        let splat = |number| Lanes::splat(simd, number);
        let tangents = &mut self.expansion.tangents;
        let mut units = [[splat(0.0); 4]; K];
        for k in 0..K {
            let mut vector = coefficients(&tangents[k], 0);
            let before = dot(&vector, &vector);
            for j in 0..k {
                let share = -dot(&vector, &units[j]);
                for i in 0..4 {
                    vector[i] = units[j][i].mul_add(share, vector[i]);
                }
            }
            let after = dot(&vector, &vector);
            let lost = before.scale(LOST_SQUARED);
            let length = lost.select_less(after, after.sqrt(), splat(0.0));
            let inverse = lost.select_less(after, splat(1.0).over(length), splat(0.0));
            self.stretch[k] = self.stretch[k] * length;
            for i in 0..4 {
                units[k][i] = vector[i] * inverse;
                tangents[k][i][0] = units[k][i];
            }
        }
    }

    /// Adds what a lane's tangent vectors have grown by to its growth, and goes on with unit
    /// vectors.
    #[inline(never)]
    pub(super) fn accumulate_stretching(&mut self, lane: usize) {
        let Some(motion) = &mut self.lanes[lane] else {
            return;
        };
        if K == 1 {
            let x = &mut self.expansion.tangents[0];
            let square: f64 = x.iter().map(|x| x[0].as_slice()[lane].powi(2)).sum();
            let length = square.sqrt();
            motion.log_stretching[0] += length.ln();
            motion.log_stretching_before += length.ln();
            for x in x {
                x[0].as_mut_slice()[lane] /= length;
            }
            return;
        }
        motion.log_stretching_before += self.stretch[0].as_slice()[lane].ln();
        for (log_stretching, stretch) in motion.log_stretching.iter_mut().zip(&mut self.stretch) {
            let stretch = &mut stretch.as_mut_slice()[lane];
            *log_stretching += stretch.ln();
            *stretch = 1.0;
        }
    }
}

#[inline(always)]
fn dot<S: Simd, const V: usize>(a: &[Lanes<S, V>; 4], b: &[Lanes<S, V>; 4]) -> Lanes<S, V> {
    a[0].mul_add(b[0], a[1] * b[1]) + a[2].mul_add(b[2], a[3] * b[3])
}
