//! Roots of a step's polynomial, to machine precision.

/// Width, as a share of the step, at which an interval with several roots counts as one: a root of higher order.
const NARROWEST: f64 = 1e-12;
/// Iterations by which a bracketed root has long been found.
const MOST_ITERATIONS: usize = 80;

/// Value at `t` of the polynomial with these coefficients, the constant one first. Even and odd powers on their own, which the
/// processor adds up side by side.
pub(super) fn value<const N: usize>(polynomial: &[f64; N], t: f64) -> f64 {
    let square = t * t;
    let (mut even, mut odd) = (0.0, 0.0);
    for k in (0..N).rev() {
        if k % 2 == 0 {
            even = even * square + polynomial[k];
        } else {
            odd = odd * square + polynomial[k];
        }
    }
    odd * t + even
}

/// Coefficients of the derivative.
pub(super) fn derivative<const N: usize>(polynomial: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|k| match polynomial.get(k + 1) {
        Some(c) => (k + 1) as f64 * c,
        None => 0.0,
    })
}

/// Shows `see` the roots within (0, `end`], ascending, by Bernstein's form: the signs of its coefficients bound the number of
/// roots, and where they leave open how many there are, the interval is halved. Roots where the sign does not change may be
/// left out.
pub(super) fn roots<const N: usize>(polynomial: &[f64; N], end: f64, mut see: impl FnMut(f64)) {
    if is_monotone(polynomial, end) {
        if (polynomial[0] < 0.0) != (value(polynomial, end) < 0.0) {
            see(refine(polynomial, 0.0, end));
        }
        return;
    }
    let bernstein = to_bernstein(polynomial, end);
    isolate(&bernstein, 0.0, 1.0, &mut |from, to| {
        see(refine(polynomial, from * end, to * end));
    });
}

/// The linear term outweighs all others within (0, `end`): the usual case, in which there is at most one root.
fn is_monotone<const N: usize>(polynomial: &[f64; N], end: f64) -> bool {
    let mut others = 0.0;
    for k in (2..N).rev() {
        others = (others + k as f64 * polynomial[k].abs()) * end;
    }
    polynomial[1].abs() > others
}

/// Coefficients in Bernstein's basis of degree N - 1 on [0, `end`].
fn to_bernstein<const N: usize>(polynomial: &[f64; N], end: f64) -> [f64; N] {
    // b_i = sum over j <= i of C(i, j)/C(n, j) a_j end^j.
    let mut power = 1.0;
    let mut binomial = 1.0;
    let scaled: [f64; N] = std::array::from_fn(|j| {
        if j > 0 {
            power *= end;
            binomial *= (N - j) as f64 / j as f64;
        }
        polynomial[j] * power / binomial
    });
    let mut sums = scaled;
    // Differences undone: each pass adds Pascal's triangle up.
    for first in (1..N).rev() {
        for k in first..N {
            sums[k] += sums[k - 1];
        }
    }
    sums
}

/// Intervals, as shares of the first, on which the sign changes once.
fn isolate<const N: usize>(
    bernstein: &[f64; N],
    from: f64,
    to: f64,
    see: &mut impl FnMut(f64, f64),
) {
    match sign_changes(bernstein) {
        0 => {}
        1 => see(from, to),
        _ if to - from < NARROWEST => {
            if (bernstein[0] < 0.0) != (bernstein[N - 1] < 0.0) {
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
fn halves<const N: usize>(bernstein: &[f64; N]) -> ([f64; N], [f64; N]) {
    let mut row = *bernstein;
    let mut left = row;
    for k in 1..N {
        for i in 0..N - k {
            row[i] = 0.5 * (row[i] + row[i + 1]);
        }
        left[k] = row[0];
    }
    // What is left of the triangle is its other edge.
    (left, row)
}

/// The root between two signs, by Newton from the chord's root within its bracket, and bisection where that leaves it.
fn refine<const N: usize>(polynomial: &[f64; N], from: f64, to: f64) -> f64 {
    let rate = derivative(polynomial);
    let (mut low, mut high) = (from, to);
    let (first, last) = (value(polynomial, low), value(polynomial, high));
    let begins_negative = first < 0.0;
    let mut t = low + (high - low) * (first / (first - last));
    for _ in 0..MOST_ITERATIONS {
        let (at, slope) = (value(polynomial, t), value(&rate, t));
        if at == 0.0 {
            return t;
        }
        if (at < 0.0) == begins_negative {
            low = t;
        } else {
            high = t;
        }
        let newton = t - at / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - t).abs() <= f64::EPSILON * to {
            return next;
        }
        t = next;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of the product of (t - root).
    fn with_roots(roots: &[f64]) -> [f64; 13] {
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

    fn found(polynomial: &[f64; 13], end: f64) -> Vec<f64> {
        let mut all = Vec::new();
        roots(polynomial, end, |root| all.push(root));
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
    fn derivative_by_coefficients() {
        assert_eq!(derivative(&[5.0, 1.0, 2.0, 3.0]), [1.0, 4.0, 9.0, 0.0]);
    }
}
