//! Roots of a step's polynomial, to machine precision.

use super::series::ORDER;

/// Width, as a share of the step, at which an interval with several roots counts as one: a root of
/// higher order.
const NARROWEST: f64 = 1e-12;
/// Iterations by which a bracketed root has long been found.
const MOST_ITERATIONS: usize = 80;

/// Coefficients of a step's polynomial, the constant one first.
pub(super) type Polynomial = [f64; ORDER + 1];

/// Value at `t`. Pairs of terms, then pairs of pairs, by Estrin: the processor adds them up side by
/// side.
#[inline(always)]
pub(super) fn value(polynomial: &Polynomial, t: f64) -> f64 {
    const { assert!(ORDER == 12) };
    let c = polynomial;
    let square = t * t;
    let fourth = square * square;
    let pair = |k: usize| c[k + 1].mul_add(t, c[k]);
    let low = pair(2).mul_add(square, pair(0));
    let middle = pair(6).mul_add(square, pair(4));
    let high = c[12].mul_add(fourth, pair(10).mul_add(square, pair(8)));
    high.mul_add(fourth * fourth, middle.mul_add(fourth, low))
}

/// Coefficients of the derivative.
#[inline(always)]
pub(super) fn derivative(polynomial: &Polynomial) -> Polynomial {
    let mut rate = [0.0; ORDER + 1];
    for k in 0..ORDER {
        rate[k] = (k + 1) as f64 * polynomial[k + 1];
    }
    rate
}

/// A polynomial at an instant.
#[derive(Clone, Copy)]
struct Point {
    t: f64,
    value: f64,
    rate: f64,
}

impl Point {
    #[inline(always)]
    fn at(polynomial: &Polynomial, rate: &Polynomial, t: f64) -> Self {
        Self {
            t,
            value: value(polynomial, t),
            rate: value(rate, t),
        }
    }

    #[inline(always)]
    fn is_below(&self) -> bool {
        self.value < 0.0
    }
}

/// Shows `see` the roots within (0, `end`], ascending, each with whether the polynomial rises
/// there. By Bernstein's form: the signs of its coefficients bound the number of roots, and where
/// they leave open how many there are, the interval is halved. Roots where the sign does not change
/// may be left out.
#[inline(always)]
pub(super) fn roots(polynomial: &Polynomial, end: f64, mut see: impl FnMut(f64, bool)) {
    let rate = derivative(polynomial);
    let begin = Point {
        t: 0.0,
        value: polynomial[0],
        rate: rate[0],
    };
    let last = Point::at(polynomial, &rate, end);
    let changes = begin.is_below() != last.is_below();
    let bend = derivative(&rate);
    if keeps_its_sign(&rate, end) || (changes && keeps_its_sign(&bend, end)) {
        // Without a turning point there is one root at most, without an inflection one between two
        // signs.
        if changes {
            see(refine(polynomial, &rate, begin, last), begin.is_below());
        }
        return;
    }
    let bernstein = to_bernstein(*polynomial, end);
    match sign_changes(&bernstein) {
        0 => {}
        1 => see(refine(polynomial, &rate, begin, last), begin.is_below()),
        _ => isolate(&bernstein, 0.0, 1.0, &mut |from, to| {
            let [from, to] = [from, to].map(|share| Point::at(polynomial, &rate, share * end));
            see(refine(polynomial, &rate, from, to), from.is_below());
        }),
    }
}

/// The constant term outweighs all others within (0, `end`).
#[inline(always)]
fn keeps_its_sign(polynomial: &Polynomial, end: f64) -> bool {
    let mut others = [0.0; ORDER + 1];
    for k in 1..ORDER {
        others[k] = polynomial[k].abs();
    }
    polynomial[0].abs() > value(&others, end)
}

/// Coefficients in Bernstein's basis of degree ORDER on [0, `end`].
#[inline(never)]
fn to_bernstein(polynomial: Polynomial, end: f64) -> Polynomial {
    // b_i = sum over j <= i of C(i, j)/C(n, j) a_j end^j.
    let mut power = 1.0;
    let mut binomial = 1.0;
    let scaled: Polynomial = std::array::from_fn(|j| {
        if j > 0 {
            power *= end;
            binomial *= (ORDER + 1 - j) as f64 / j as f64;
        }
        polynomial[j] * power / binomial
    });
    let mut sums = scaled;
    // Differences undone: each pass adds Pascal's triangle up.
    for first in (1..=ORDER).rev() {
        for k in first..=ORDER {
            sums[k] += sums[k - 1];
        }
    }
    sums
}

/// Intervals, as shares of the first, on which the sign changes once.
fn isolate(bernstein: &Polynomial, from: f64, to: f64, see: &mut impl FnMut(f64, f64)) {
    match sign_changes(bernstein) {
        0 => {}
        1 => see(from, to),
        _ if to - from < NARROWEST => {
            if (bernstein[0] < 0.0) != (bernstein[ORDER] < 0.0) {
                see(from, to);
            }
        }
        _ => {
            let (left, right) = halves(bernstein);
            let middle = 0.5 * (from + to);
            isolate(&left, from, middle, see);
            isolate(&right, middle, to, see);
        }
    }
}

/// Changes of sign in a sequence; zero counts as positive.
fn sign_changes(sequence: &[f64]) -> usize {
    let differ = |pair: &&[f64]| (pair[0] < 0.0) != (pair[1] < 0.0);
    sequence.windows(2).filter(differ).count()
}

/// The same polynomial on both halves of its interval, by de Casteljau.
fn halves(bernstein: &Polynomial) -> (Polynomial, Polynomial) {
    let mut row = *bernstein;
    let mut left = row;
    for k in 1..=ORDER {
        for i in 0..=ORDER - k {
            row[i] = 0.5 * (row[i] + row[i + 1]);
        }
        left[k] = row[0];
    }
    // What is left of the triangle is its other edge.
    (left, row)
}

/// The root between two signs, by Newton from the inverse's cubic within its bracket, and bisection
/// where that leaves it.
#[inline(always)]
fn refine(polynomial: &Polynomial, rate: &Polynomial, begin: Point, end: Point) -> f64 {
    let (mut low, mut high) = (begin.t, end.t);
    let mut t = inverse_at_zero(begin, end);
    if !(t > low && t < high) {
        t = 0.5 * (low + high);
    }
    let mut move_before = 0.0;
    for _ in 0..MOST_ITERATIONS {
        let here = Point::at(polynomial, rate, t);
        if here.value == 0.0 {
            return t;
        }
        if here.is_below() == begin.is_below() {
            low = t;
        } else {
            high = t;
        }
        let newton = t - here.value / here.rate;
        if !(newton > low && newton < high) {
            t = 0.5 * (low + high);
            move_before = 0.0;
            continue;
        }
        let moved = newton - t;
        t = newton;
        // Moves square, times a factor that two of them tell: the next one would be rounding.
        let ends = moved * moved * moved.abs() <= f64::EPSILON * end.t * move_before;
        if ends || moved.abs() <= f64::EPSILON * end.t {
            return t;
        }
        move_before = moved * moved;
    }
    t
}

/// Where the cubic with the inverse's values and rates at both ends is at zero.
#[inline(always)]
fn inverse_at_zero(begin: Point, end: Point) -> f64 {
    let rise = end.value - begin.value;
    let share = -begin.value / rise;
    let rest = 1.0 - share;
    let ends = share * share * rest.mul_add(2.0, 1.0) * (end.t - begin.t);
    let slopes = rest * (1.0 / begin.rate) - share * (1.0 / end.rate);
    (share * rest * rise).mul_add(slopes, ends) + begin.t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of the product of (t - root).
    fn with_roots(roots: &[f64]) -> Polynomial {
        let mut polynomial = [0.0; 13];
        polynomial[0] = 1.0;
        for root in roots {
            let mut next = [0.0; 13];
            for k in 0..12 {
                next[k + 1] += polynomial[k];
                next[k] -= root * polynomial[k];
            }
            polynomial = next;
        }
        polynomial
    }

    fn found(polynomial: &Polynomial, end: f64) -> Vec<f64> {
        let mut all = Vec::new();
        roots(polynomial, end, |root, _| all.push(root));
        all
    }

    #[test]
    fn all_roots_of_an_interval_are_found_in_order() {
        let wanted = [1e-6, 0.003, 0.0031, 0.011, 0.0249999];
        let polynomial = with_roots(&[-0.4, 0.003, 0.0249999, 0.011, 0.0031, 0.026, 1e-6]);
        let all = found(&polynomial, 0.025);
        assert_eq!(all.len(), wanted.len(), "{all:?}");
        for (found, wanted) in all.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-13, "{found} {wanted}");
        }
        assert!(found(&polynomial, 0.5e-6).is_empty());
    }

    #[test]
    fn a_touch_is_no_change_of_sign() {
        let near = [
            1e-8 + 1e-4,
            -2e-2,
            1.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ];
        assert!(found(&near, 0.02).is_empty());
    }

    #[test]
    fn derivative_and_value_by_coefficients() {
        let ones = [1.0; 13];
        let slope: Vec<f64> = (1..=13).map(|k| f64::from(k % 13)).collect();
        assert_eq!(derivative(&ones).to_vec(), slope);
        assert_eq!(value(&ones, 2.0), 8191.0);
        assert_eq!(value(&derivative(&ones), 1.0), 78.0);
    }
}
