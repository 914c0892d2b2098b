//! Bifurcations of codimension two: points of a curve of bifurcations at which a second condition holds.

use crate::equilibrium::Equilibrium;
use crate::orbit::Orbit;
use crate::system::Parameters;
use crate::test_function::Bifurcation;
use nalgebra::Complex;

/// The second condition (Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, chapters 8 and 9).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Two folds meet: both parameters turn back.
    Cusp,
    /// Multipliers 1 and -1.
    FoldFlip,
    /// Two multipliers 1.
    StrongResonance1To1,
    /// Two multipliers -1.
    StrongResonance1To2,
    /// Multipliers exp(+-2 pi i / 3).
    StrongResonance1To3,
    /// Multipliers +-i.
    StrongResonance1To4,
    /// The first Lyapunov coefficient is zero: the Hopf bifurcation changes its criticality.
    GeneralisedHopf,
    /// A zero eigenvalue beside the imaginary pair.
    FoldHopf,
    /// A mode appears in the orbit or vanishes.
    Grazing,
}

impl Condition {
    /// Name in the terms of the field.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cusp => "cusp",
            Self::FoldFlip => "fold-flip",
            Self::StrongResonance1To1 => "strong resonance 1:1",
            Self::StrongResonance1To2 => "strong resonance 1:2",
            Self::StrongResonance1To3 => "strong resonance 1:3",
            Self::StrongResonance1To4 => "strong resonance 1:4",
            Self::GeneralisedHopf => "generalised Hopf",
            Self::FoldHopf => "fold-Hopf",
            Self::Grazing => "grazing",
        }
    }
}

/// A point of codimension two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CodimensionTwo {
    /// The second condition.
    pub condition: Condition,
    /// Both parameters, interpolated between neighbouring points of the curve.
    pub parameters: Parameters<f64>,
}

/// A condition with a function that is zero where it holds.
pub(crate) type Test = (Condition, f64);

/// The tests of an orbit on the curve of a bifurcation.
pub(crate) fn of_orbit<M, const N: usize>(kind: Bifurcation, orbit: &Orbit<M, N>) -> Vec<Test> {
    let product = |others: &[Complex<f64>], value: f64| {
        let factors = others.iter().map(|multiplier| multiplier - value);
        factors.product::<Complex<f64>>().re
    };
    match kind {
        Bifurcation::PeriodDoubling => {
            let others = without_nearest(&orbit.multipliers, -1.0);
            vec![
                (Condition::FoldFlip, product(&others, 1.0)),
                (Condition::StrongResonance1To2, product(&others, -1.0)),
            ]
        }
        Bifurcation::Fold => {
            let others = without_nearest(&orbit.multipliers, 1.0);
            vec![
                (Condition::StrongResonance1To1, product(&others, 1.0)),
                (Condition::FoldFlip, product(&others, -1.0)),
            ]
        }
        Bifurcation::NeimarkSacker => {
            let on_circle = orbit.multipliers.iter().filter(|m| m.im > 0.0);
            let distance = |m: &Complex<f64>| (m.norm() - 1.0).abs();
            let pair = on_circle.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            pair.map_or_else(Vec::new, |pair| {
                vec![
                    (Condition::StrongResonance1To3, pair.re + 0.5),
                    (Condition::StrongResonance1To4, pair.re),
                ]
            })
        }
        Bifurcation::BranchPoint | Bifurcation::Grazing => Vec::new(),
    }
}

/// The tests of an equilibrium at a Hopf bifurcation with that first Lyapunov coefficient.
pub(crate) fn of_hopf<const N: usize>(
    equilibrium: &Equilibrium<N>,
    first_lyapunov_coefficient: Option<f64>,
) -> Vec<Test> {
    let real = equilibrium
        .eigenvalues_per_s
        .iter()
        .filter(|value| value.im == 0.0);
    let mut tests = vec![(Condition::FoldHopf, real.map(|value| value.re).product())];
    tests.extend(first_lyapunov_coefficient.map(|value| (Condition::GeneralisedHopf, value)));
    tests
}

/// The multipliers without the one of the curve's own condition.
fn without_nearest(multipliers: &[Complex<f64>], value: f64) -> Vec<Complex<f64>> {
    let distance = |k: &usize| (multipliers[*k] - value).norm();
    let own = (0..multipliers.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let others = multipliers.iter().enumerate();
    others
        .filter(|(k, _)| Some(*k) != own)
        .map(|(_, m)| *m)
        .collect()
}

/// Conditions that begin or cease to hold between two points, by the signs of their tests.
pub(crate) fn between(
    before: (&[Test], Parameters<f64>),
    after: (&[Test], Parameters<f64>),
) -> Vec<CodimensionTwo> {
    let crossed = before.0.iter().filter_map(|(condition, from)| {
        let (_, to) = after.0.iter().find(|(other, _)| other == condition)?;
        let share = from / (from - to);
        ((*from > 0.0) != (*to > 0.0)).then(|| CodimensionTwo {
            condition: *condition,
            parameters: interpolated(before.1, after.1, share),
        })
    });
    crossed.collect()
}

/// Parameters at a share of the way between two points.
pub(crate) fn interpolated(
    from: Parameters<f64>,
    to: Parameters<f64>,
    share: f64,
) -> Parameters<f64> {
    std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
}
