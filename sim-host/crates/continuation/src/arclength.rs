//! Curves of solutions: n - 1 equations in n unknowns, followed by pseudo-arclength (H. B. Keller,
//! Applications of Bifurcation Theory, 1977, 359).
//!
//! Unknowns are measured in scales, so that an arclength adds what can be compared.

use crate::failure::Failure;
use nalgebra::{DMatrix, DVector};

/// Size of a correction, in the scales, at which Newton's method has converged: the next one would be
/// its square.
const CONVERGED: f64 = 1e-8;
/// Size below which a correction that is no longer much less than the last one is rounding: that of an
/// unstable orbit is its multiplier's.
const STAGNANT: f64 = 1e-5;
/// Corrections of Newton's method; a good guess needs three.
const MOST_CORRECTIONS: usize = 10;
/// A correction beyond this, in the scales, leads elsewhere.
const FARTHEST: f64 = 2.0;

/// Growth of a step after easy corrections.
const GROWTH: f64 = 1.4;
/// Corrections of an easy step.
const EASY: usize = 4;
/// Least cosine between tangents that follow one another.
const LEAST_COSINE: f64 = 0.9;
/// Iterations of a location; bisection to rounding needs 60.
const MOST_ITERATIONS: usize = 80;
/// Iterations that may be secants.
const MOST_SECANTS: usize = 40;
/// Width of a location, as a share of its step.
const LOCATED: f64 = 1e-13;

/// Equations in one unknown more than there are equations.
pub trait Problem: Clone {
    /// What is known of a solution beside its unknowns.
    type Solution: Clone;

    /// Sizes of the unknowns.
    fn scales(&self) -> &DVector<f64>;

    /// Residuals, their derivatives by the unknowns, and the solution that these are.
    ///
    /// # Errors
    /// If there is no trajectory.
    fn evaluate(&self, unknowns: &DVector<f64>) -> Result<Evaluation<Self::Solution>, Failure>;

    /// Equations for the rest of the curve that suit the point better, with its unknowns and its tangent
    /// in their terms. As they are, unless a problem needs others.
    ///
    /// # Errors
    /// If there is no trajectory.
    fn rebased(
        &self,
        point: &Point<Self::Solution>,
    ) -> Result<(Self, DVector<f64>, DVector<f64>), Failure> {
        Ok((self.clone(), point.unknowns.clone(), point.tangent.clone()))
    }
}

/// The equations at a point.
#[derive(Debug, Clone)]
pub struct Evaluation<S> {
    /// What should be zero, in its scale.
    pub residual: DVector<f64>,
    /// Its derivatives: a row per equation, a column per unknown.
    pub jacobian: DMatrix<f64>,
    /// The solution.
    pub solution: S,
}

/// A point of a curve.
#[derive(Debug, Clone)]
pub struct Point<S> {
    /// The unknowns.
    pub unknowns: DVector<f64>,
    /// Unit tangent of the curve, in the scales.
    pub tangent: DVector<f64>,
    /// The solution.
    pub solution: S,
    /// Corrections that it took.
    pub corrections: usize,
}

impl<S> Point<S> {
    /// The guess for a point at that arclength from this one.
    pub fn predict(&self, scales: &DVector<f64>, arclength: f64) -> DVector<f64> {
        &self.unknowns + self.tangent.component_mul(scales) * arclength
    }
}

/// The point of the curve in the plane through `guess` across `tangent`.
///
/// # Errors
/// If Newton's method does not converge, or there is no trajectory.
pub fn correct<P: Problem>(
    problem: &P,
    guess: DVector<f64>,
    tangent: &DVector<f64>,
) -> Result<Point<P::Solution>, Failure> {
    let scales = problem.scales();
    let mut unknowns = guess.clone();
    let mut last = f64::INFINITY;
    for corrections in 1..=MOST_CORRECTIONS {
        let evaluation = problem.evaluate(&unknowns)?;
        let matrix = bordered(&evaluation.jacobian, scales, tangent);
        let offset = (&unknowns - &guess).component_div(scales).dot(tangent);
        let right = evaluation.residual.clone().push(offset);
        let lu = matrix.lu();
        let correction = lu.solve(&right).ok_or(Failure::Singular)?;
        let size = correction.amax();
        if !size.is_finite() || size > FARTHEST || (corrections > 3 && size > last) {
            return Err(Failure::NotConverged { correction: size });
        }
        unknowns -= correction.component_mul(scales);
        let stagnates = size < STAGNANT && size > 0.1 * last;
        if size < CONVERGED || stagnates {
            // The solution is that of the last unknowns; the next correction would be rounding.
            let evaluation = problem.evaluate(&unknowns)?;
            let mut along = DVector::zeros(right.len());
            along[right.len() - 1] = 1.0;
            let lu = bordered(&evaluation.jacobian, scales, tangent).lu();
            let along = lu.solve(&along).ok_or(Failure::Singular)?;
            return Ok(Point {
                unknowns,
                tangent: along.normalize(),
                solution: evaluation.solution,
                corrections,
            });
        }
        last = size;
    }
    Err(Failure::NotConverged { correction: last })
}

/// The derivatives in the scales, and the tangent as the last row.
fn bordered(
    jacobian: &DMatrix<f64>,
    scales: &DVector<f64>,
    tangent: &DVector<f64>,
) -> DMatrix<f64> {
    let (rows, columns) = jacobian.shape();
    DMatrix::from_fn(rows + 1, columns, |row, column| {
        if row < rows {
            jacobian[(row, column)] * scales[column]
        } else {
            tangent[column]
        }
    })
}

/// How a curve is followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Ranges of the parameters.
    pub ranges: Vec<(f64, f64)>,
    /// Greatest arclength of a step, in the scales: 0.02 gives 50 points over a parameter's range where
    /// nothing else changes.
    pub longest_step: f64,
    /// Least arclength of a step.
    pub shortest_step: f64,
    /// Most points.
    pub most_points: usize,
    /// Magnitude of a multiplier beyond which an orbit is not followed.
    pub greatest_multiplier: f64,
}

impl Settings {
    /// Usual steps over these ranges.
    pub fn over(ranges: &[(f64, f64)]) -> Self {
        Self {
            ranges: ranges.to_vec(),
            longest_step: 0.03,
            shortest_step: 1e-7,
            most_points: 1000,
            greatest_multiplier: 1e4,
        }
    }

    /// Extents of the ranges.
    pub fn spans(&self) -> Vec<f64> {
        self.ranges.iter().map(|(low, high)| high - low).collect()
    }
}

/// Why a curve ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// A parameter is at the end of its range.
    Range,
    /// The orbit shrinks to an equilibrium, at a Hopf bifurcation.
    Equilibrium,
    /// The period grows beyond its bound.
    LongPeriod,
    /// A multiplier is so great that a trajectory leaves the orbit within a period: it is nearly homoclinic,
    /// or needs more segments.
    TooUnstable,
    /// The curve is closed: it is back where it began.
    Closed,
    /// The greatest number of points is reached.
    Points,
    /// The corrections do not converge even at the shortest step.
    Failed(Failure),
    /// It was stopped.
    Stopped,
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Range => "a parameter is at the end of its range",
            Self::Equilibrium => "the orbit shrinks to an equilibrium",
            Self::LongPeriod => "the period grows without bound",
            Self::TooUnstable => "a multiplier grows without bound, as near a homoclinic orbit",
            Self::Closed => "the branch is closed",
            Self::Points => "the greatest number of points is reached",
            Self::Failed(failure) => return failure.fmt(f),
            Self::Stopped => "stopped",
        })
    }
}

impl serde::Serialize for End {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A step of a curve: from one point to the next, both in the terms of `problem`.
pub struct Step<'a, P: Problem> {
    /// The equations.
    pub problem: &'a P,
    /// The point before; the first point is its own.
    pub from: &'a Point<P::Solution>,
    /// The point after.
    pub to: &'a Point<P::Solution>,
}

impl<P: Problem> Step<'_, P> {
    /// Its length along the tangent, in the scales.
    pub fn arclength(&self) -> f64 {
        let moved = (&self.to.unknowns - &self.from.unknowns).component_div(self.problem.scales());
        moved.dot(&self.from.tangent)
    }
}

/// Follows the curve through the point near `guess` along `tangent`. `parameters` are the indices of the
/// parameters among the unknowns. `visit` is called with each step, and may end the curve.
///
/// # Errors
/// If there is no point near the guess.
pub fn walk<P: Problem>(
    mut problem: P,
    guess: DVector<f64>,
    tangent: &DVector<f64>,
    parameters: &[usize],
    settings: &Settings,
    mut visit: impl FnMut(Step<'_, P>) -> Option<End>,
) -> Result<End, Failure> {
    let mut point = correct(&problem, guess, tangent)?;
    if let Some(end) = visit(Step {
        problem: &problem,
        from: &point,
        to: &point,
    }) {
        return Ok(end);
    }
    let mut step = settings.longest_step;
    for _ in 1..settings.most_points {
        (problem, point.unknowns, point.tangent) = match problem.rebased(&point) {
            Ok(rebased) => rebased,
            Err(failure) => return Ok(End::Failed(failure)),
        };
        let mut next = match advance(&problem, &point, &mut step, settings) {
            Ok(next) => next,
            Err(failure) => return Ok(End::Failed(failure)),
        };
        let outside = parameters
            .iter()
            .zip(&settings.ranges)
            .find_map(|(&index, &(low, high))| {
                let value = next.unknowns[index];
                (!(low..=high).contains(&value)).then(|| (index, value.clamp(low, high)))
            });
        if let Some((index, bound)) = outside {
            next = at_bound(&problem, &point, &next, index, bound).unwrap_or(next);
        }
        let end = visit(Step {
            problem: &problem,
            from: &point,
            to: &next,
        });
        if end.is_some() || outside.is_some() {
            return Ok(end.unwrap_or(End::Range));
        }
        point = next;
    }
    Ok(End::Points)
}

/// The next point, at the greatest arclength that works.
fn advance<P: Problem>(
    problem: &P,
    point: &Point<P::Solution>,
    step: &mut f64,
    settings: &Settings,
) -> Result<Point<P::Solution>, Failure> {
    loop {
        let guess = point.predict(problem.scales(), *step);
        let failure = match correct(problem, guess, &point.tangent) {
            Ok(next) if next.tangent.dot(&point.tangent) < LEAST_COSINE => {
                Failure::NotConverged { correction: *step }
            }
            Ok(next) => {
                if next.corrections <= EASY {
                    *step = (*step * GROWTH).min(settings.longest_step);
                }
                return Ok(next);
            }
            Err(failure) => failure,
        };
        *step *= 0.5;
        if *step < settings.shortest_step {
            return Err(failure);
        }
    }
}

/// The point of the curve between two others at which an unknown has the value `bound`.
fn at_bound<P: Problem>(
    problem: &P,
    from: &Point<P::Solution>,
    to: &Point<P::Solution>,
    index: usize,
    bound: f64,
) -> Option<Point<P::Solution>> {
    let share = (bound - from.unknowns[index]) / (to.unknowns[index] - from.unknowns[index]);
    let mut guess = from.unknowns.lerp(&to.unknowns, share);
    guess[index] = bound;
    let mut axis = DVector::zeros(guess.len());
    axis[index] = 1.0;
    let mut point = correct(problem, guess, &axis).ok()?;
    if point.tangent.dot(&from.tangent) < 0.0 {
        point.tangent = -point.tangent;
    }
    Some(point)
}

/// Where `value` changes its sign between a point and the next one.
pub enum Function<'a, S> {
    /// A smooth function.
    Smooth(&'a dyn Fn(&Point<S>) -> f64),
    /// A property that holds at the first point and not at the next one.
    Property(&'a dyn Fn(&Point<S>) -> bool),
}

/// The point between `from` and the one `arclength` on at which the function changes its sign, and the
/// arclength that this is located to; `None` if it does not.
pub fn locate<P: Problem>(
    problem: &P,
    from: &Point<P::Solution>,
    arclength: f64,
    function: &Function<'_, P::Solution>,
) -> Option<(Point<P::Solution>, f64)> {
    let at = |s: f64| correct(problem, from.predict(problem.scales(), s), &from.tangent).ok();
    let value = |point: &Point<P::Solution>| match function {
        Function::Smooth(function) => function(point),
        Function::Property(holds) => {
            if holds(point) {
                1.0
            } else {
                -1.0
            }
        }
    };
    let is_smooth = matches!(function, Function::Smooth(_));
    let mut best = at(arclength)?;
    let (mut low, mut high) = (0.0, arclength);
    let (mut low_value, mut high_value) = (value(from), value(&best));
    if (low_value > 0.0) == (high_value > 0.0) {
        return None;
    }
    let (mut before, mut moved) = (f64::NAN, arclength);
    for iteration in 0..MOST_ITERATIONS {
        // Illinois: regula falsi that halves the value of an end that stays.
        let secant = (low * high_value - high * low_value) / (high_value - low_value);
        let is_secant = is_smooth && iteration < MOST_SECANTS && secant.is_finite();
        let s = if is_secant {
            secant
        } else {
            0.5 * (low + high)
        };
        best = at(s)?;
        let here = value(&best);
        moved = if is_secant {
            (s - before).abs()
        } else {
            (high - low).abs()
        };
        if here == 0.0 || moved < LOCATED * arclength {
            break;
        }
        before = s;
        if (here > 0.0) == (high_value > 0.0) {
            (high, high_value) = (s, here);
            low_value *= if is_smooth { 0.5 } else { 1.0 };
        } else {
            (low, low_value) = (s, here);
            high_value *= if is_smooth { 0.5 } else { 1.0 };
        }
    }
    Some((best, moved))
}
