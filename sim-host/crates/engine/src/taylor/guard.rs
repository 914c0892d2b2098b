//! Where friction modes end: a quantity of each lane that must stay within bounds, on the step's
//! polynomials.

use super::lanes::Lanes;
use super::roots::{self, Polynomial};
use super::series::{ORDER, Series, of_lane};
use crate::events::Guard;
use nalgebra::Vector4;
use pulp::Simd;
use shared_model::dither::Injection;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::Model;

/// Least time between two changes of mode, s: an end sooner than that is rounding of the torque at
/// its limit.
const SHORTEST_MODE_S: f64 = 1e-9;

/// [`Guard`]s in lanes, of the quantity `argument + per_force * F_f`.
pub(super) struct Guards<L> {
    lower: L,
    upper: L,
    /// Minus the trail while sticking, else 0.
    per_force: L,
}

impl<S: Simd, const V: usize> Guards<Lanes<S, V>> {
    /// No bounds in any lane.
    pub fn none(simd: S) -> Self {
        let splat = |number| Lanes::splat(simd, number);
        Self {
            lower: splat(f64::NEG_INFINITY),
            upper: splat(f64::INFINITY),
            per_force: splat(0.0),
        }
    }

    /// Takes a lane's bounds away.
    pub(crate) fn free_lane(&mut self, lane: usize) {
        self.lower.as_mut_slice()[lane] = f64::NEG_INFINITY;
        self.upper.as_mut_slice()[lane] = f64::INFINITY;
        self.per_force.as_mut_slice()[lane] = 0.0;
    }

    /// Puts the bounds of a motion's mode into its lane.
    pub(crate) fn set_lane(
        &mut self,
        lane: usize,
        model: &Model<f64>,
        injection: Injection<f64>,
        mode: FrictionMode,
        x: &Vector4<f64>,
    ) {
        let guard = Guard::of(model, injection, mode, x);
        let constants = model.constants();
        // While sticking the guard is the driving torque, whose constant goes over to the bounds.
        let (per_force, shift) = match mode {
            FrictionMode::Sticking => (-constants.trail_m, constants.motor_torque_nm),
            _ => (0.0, 0.0),
        };
        self.per_force.as_mut_slice()[lane] = per_force;
        self.lower.as_mut_slice()[lane] = guard.lower - shift;
        self.upper.as_mut_slice()[lane] = guard.upper - shift;
    }

    /// Positive in lanes that certainly stay within their bounds for the whole step, given the
    /// series of argument and force.
    #[inline(always)]
    pub fn room(
        &self,
        argument: &Series<S, V>,
        force: &Series<S, V>,
        step_s: Lanes<S, V>,
    ) -> Lanes<S, V> {
        let mut rest = argument[ORDER];
        let mut sizes = rest.abs();
        for k in (4..ORDER).rev() {
            let c = self.per_force.mul_add(force[k], argument[k]);
            rest = rest.mul_add(step_s, c);
            sizes = sizes.mul_add(step_s, c.abs());
        }
        let square = step_s * step_s;
        let [begin, linear, quadratic, cubic] = [
            self.per_force.mul_add(force[0], argument[0]),
            self.per_force.mul_add(force[1], argument[1]) * step_s,
            self.per_force.mul_add(force[2], argument[2]) * square,
            self.per_force.mul_add(force[3], argument[3]) * (square * step_s),
        ];
        let from_fourth = sizes * (square * square);
        let from_cubic = from_fourth + cubic.abs();
        let behind_linear = rest.mul_add(square * square, cubic) + quadratic;
        let path = Path {
            begin,
            linear,
            quadratic,
            behind_begin: behind_linear + linear,
            behind_linear,
            from_quadratic: from_cubic + quadratic.abs(),
            from_cubic,
            from_fourth,
        };
        let above = path.room_above(self.lower);
        let below = path.turned().room_above(-self.upper);
        above.min(below)
    }

    /// The first instant within `most_s` at which a lane's quantity leaves its bounds, and the
    /// bound.
    #[inline(always)]
    pub(crate) fn first_end(
        &self,
        lane: usize,
        argument: &Series<S, V>,
        force: &Series<S, V>,
        most_s: f64,
    ) -> Option<(f64, f64)> {
        let mut path = of_lane(argument, lane);
        let per_force = self.per_force.as_slice()[lane];
        if per_force != 0.0 {
            for k in 0..ORDER {
                path[k] = per_force.mul_add(force[k].as_slice()[lane], path[k]);
            }
        }
        let (lower, upper) = (self.lower.as_slice()[lane], self.upper.as_slice()[lane]);
        let mut first = None;
        let mut until_s = most_s;
        // One of them, usually the only one; then the other.
        let mut sign = if lower.is_finite() { 1.0 } else { -1.0 };
        loop {
            let bound = if sign > 0.0 { lower } else { upper };
            let mut room = [0.0; ORDER + 1];
            room[0] = sign * (path[0] - bound);
            for k in 1..ORDER + 1 {
                room[k] = sign * path[k];
            }
            if let Some(instant_s) = first_fall(room, until_s) {
                first = Some((instant_s, bound));
                until_s = instant_s;
            }
            if sign < 0.0 || !upper.is_finite() {
                return first;
            }
            sign = -1.0;
        }
    }
}

/// Terms of a polynomial at the step's end.
struct Path<L> {
    begin: L,
    linear: L,
    quadratic: L,
    /// Its value there but for the constant term, and but for that and the linear one.
    behind_begin: L,
    behind_linear: L,
    /// Sums of the absolute values of the terms of order 2, 3 and 4 and higher.
    from_quadratic: L,
    from_cubic: L,
    from_fourth: L,
}

impl<S: Simd, const V: usize> Path<Lanes<S, V>> {
    /// The negative of the polynomial.
    #[inline(always)]
    fn turned(&self) -> Self {
        Self {
            begin: -self.begin,
            linear: -self.linear,
            quadratic: -self.quadratic,
            behind_begin: -self.behind_begin,
            behind_linear: -self.behind_linear,
            ..*self
        }
    }

    /// Positive where the polynomial is above `bound` within the whole step, its beginning left
    /// out. A polynomial is no farther from its chord than the sum of the terms that bend it.
    /// Three of them are tried: the polynomial itself; what is behind its constant term, over
    /// t, for one that has just left the bound; and what is behind its linear one, over t^2, for
    /// one that left it with no speed.
    #[inline(always)]
    fn room_above(&self, bound: Lanes<S, V>) -> Lanes<S, V> {
        let zero = bound.zero();
        let begin = self.begin - bound;
        let chord = begin.min(begin + self.behind_begin) - self.from_quadratic;
        let leaving = self.linear.min(self.behind_begin) - self.from_cubic;
        let starting = self.quadratic.min(self.behind_linear) - self.from_fourth;
        let starting = self.linear.select_less(zero, self.linear, starting);
        begin.select_less(zero, begin, chord.max(leaving.max(starting)))
    }
}

/// The first instant in (0, `most_s`] at which a polynomial goes from positive to negative, but not
/// before the shortest time of a mode.
#[inline(always)]
fn first_fall(mut room: Polynomial, most_s: f64) -> Option<f64> {
    let soon_s = SHORTEST_MODE_S.min(most_s);
    if room[0] == 0.0 {
        // On the bound: the root at the beginning is the last change of mode.
        for k in 0..ORDER {
            room[k] = room[k + 1];
        }
        room[ORDER] = 0.0;
    }
    if room[0] < 0.0 && roots::value(&room, soon_s) < 0.0 {
        return Some(soon_s);
    }
    let mut first = None;
    roots::roots(&room, most_s, |root_s, rising| {
        if !rising {
            first.get_or_insert(root_s.max(soon_s));
        }
    });
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use pulp::Scalar;

    const STEP_S: f64 = 0.02;
    const SAMPLES: usize = 2000;

    /// Coefficients of a polynomial whose terms at the step's end are given.
    fn series(terms: &[f64]) -> Series<Scalar, 1> {
        let simd = Scalar::new();
        let coefficient = |k: usize| terms.get(k).copied().unwrap_or(0.0) / STEP_S.powi(k as i32);
        std::array::from_fn(|k| Lanes::splat(simd, coefficient(k)))
    }

    /// The first sample beyond the bounds, s.
    fn first_beyond(path: &Polynomial, lower: f64, upper: f64) -> Option<f64> {
        let at = |k: usize| STEP_S * k as f64 / SAMPLES as f64;
        let is_beyond = |t: &f64| !(lower..=upper).contains(&roots::value(path, *t));
        (1..=SAMPLES).map(at).find(is_beyond)
    }

    /// A path that is above the lower bound at the step's beginning, by `above`, and touches `lower
    /// - depth` at a share of it.
    fn dip(above: f64, share: f64, depth: f64) -> Vec<f64> {
        let bend = (above + depth) / (share * share);
        vec![above, -2.0 * bend * share, bend]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]

        /// Where there is room the bounds are kept; where they are not, the first instant beyond them is found, also of a path that
        /// comes back within the step, and of one that has just left the bound, with or without a speed.
        #[test]
        fn no_end_of_a_mode_is_missed(
            zeros in 0_usize..3,
            above in 0.0..1.0,
            share in 0.05..1.5,
            depth in -0.3..0.3,
            higher in proptest::collection::vec(-0.1..0.1, 3),
            upper in 0.5..3.0,
            per_force in prop_oneof![Just(0.0), Just(-0.02)],
            force in proptest::collection::vec(-1.0..1.0, 4),
        ) {
            let simd = Scalar::new();
            let behind = |terms: Vec<f64>| [vec![0.0; zeros], terms].concat();
            let terms = behind([dip(above, share, depth), higher].concat());
            let (argument, force) = (series(&terms), series(&behind(force)));
            let mut guards = Guards::<Lanes<Scalar, 1>>::none(simd);
            guards.lower = Lanes::splat(simd, 0.0);
            guards.upper = Lanes::splat(simd, upper);
            guards.per_force = Lanes::splat(simd, per_force);
            let path: Polynomial = std::array::from_fn(|k| {
                argument[k].as_slice()[0] + per_force * force[k].as_slice()[0]
            });
            prop_assume!(path[zeros] > 1e-6 && path[0] < upper);
            let wanted = first_beyond(&path, 0.0, upper);
            let room = guards.room(&argument, &force, Lanes::splat(simd, STEP_S));
            let found = guards.first_end(0, &argument, &force, STEP_S);
            if let Some((found_s, bound)) = found {
                let distance = (roots::value(&path, found_s) - bound).abs();
                prop_assert!(distance < 1e-9, "{distance} from {bound} at {found_s} s");
            }
            if let Some(wanted_s) = wanted {
                prop_assert!(room.as_slice()[0] <= 0.0);
                // A dip between two samples comes before the first one beyond.
                prop_assert!(found.is_some_and(|(found_s, _)| found_s <= wanted_s));
            }
        }
    }
}
