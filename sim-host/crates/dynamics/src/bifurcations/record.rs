//! What is kept of an orbit, an equilibrium or a bifurcation.

use crate::eigenvalues::Eigenvalue;
use crate::period::PROMINENCE;
use continuation::branch::Special;
use continuation::equilibrium::{Equilibrium, Hopf};
use continuation::orbit::Orbit;
use continuation::system::{Equations, System};
use continuation::trajectory::{Sample, hermite};
use continuation::vehicle::Vehicle;
use engine::dual::Dual;
use nalgebra::{Complex, Vector4};
use shared_model::friction::FrictionMode;
use shared_model::vehicle::YAW_RATE;

/// Samples of a step between whose ends the yaw rate's slope is a cubic.
const SAMPLES: usize = 8;

type Vehicles = Orbit<FrictionMode, 4>;

/// A periodic orbit.
#[derive(Debug, Clone, serde::Serialize)]
pub struct OrbitPoint {
    /// The parameter's value.
    pub parameter: f64,
    /// Period, s.
    pub period_s: f64,
    /// Cycles of a period: rises of the yaw rate through the middle of its range.
    pub cycles: usize,
    /// Heights of all local maxima of the yaw rate in a period, descending, rad/s.
    pub maxima_rad_per_s: Vec<f64>,
    /// Those that stand out by a hundredth of the yaw rate's range.
    pub prominent_maxima_rad_per_s: Vec<f64>,
    /// Least yaw rate, rad/s.
    pub yaw_rate_min_rad_per_s: f64,
    /// Greatest yaw rate, rad/s.
    pub yaw_rate_max_rad_per_s: f64,
    /// All multipliers but the trivial one are within the unit circle.
    pub stable: bool,
    /// Those multipliers, by descending magnitude.
    pub multipliers: Vec<Eigenvalue>,
    /// Error of the trivial multiplier, which is 1.
    pub trivial_multiplier_error: f64,
    /// Rate at which a perturbation grows, 1/s; negative where it decays.
    pub exponent_per_s: f64,
    /// Times per period that the steering comes to stick.
    pub sticks: usize,
    /// A state on the orbit.
    pub state: [f64; 4],
}

impl OrbitPoint {
    pub(crate) fn new(vehicle: &Vehicle, orbit: &Vehicles) -> Self {
        let extrema = extrema(vehicle, orbit);
        let (low, high) = orbit.extent();
        let heights = || extrema.iter().map(|extremum| extremum.height);
        let least = heights().fold(low[YAW_RATE], f64::min);
        let greatest = heights().fold(high[YAW_RATE], f64::max);
        let middle = 0.5 * (least + greatest);
        let states = orbit
            .segments
            .iter()
            .flat_map(|segment| segment.states.windows(2));
        let rises = states.filter(|pair| pair[0][YAW_RATE] < middle && pair[1][YAW_RATE] >= middle);
        let largest = orbit
            .multipliers
            .first()
            .map_or(0.0, |multiplier| multiplier.norm());
        let sticks = orbit
            .modes()
            .iter()
            .filter(|mode| **mode == FrictionMode::Sticking)
            .count();
        Self {
            parameter: orbit.parameters[0],
            period_s: orbit.period_s,
            cycles: rises.count(),
            prominent_maxima_rad_per_s: prominent(&extrema, PROMINENCE * (greatest - least)),
            maxima_rad_per_s: maxima(&extrema),
            yaw_rate_min_rad_per_s: least,
            yaw_rate_max_rad_per_s: greatest,
            stable: orbit.is_stable(),
            multipliers: orbit.multipliers.iter().map(of_complex).collect(),
            trivial_multiplier_error: orbit.trivial_error,
            exponent_per_s: largest.ln() / orbit.period_s,
            sticks,
            state: (*orbit.start()).into(),
        }
    }
}

fn of_complex(value: &Complex<f64>) -> Eigenvalue {
    Eigenvalue {
        re: value.re,
        im: value.im,
    }
}

/// A local extremum of the yaw rate.
#[derive(Debug, Clone, Copy)]
struct Extremum {
    height: f64,
    is_maximum: bool,
}

/// The yaw rate's extrema in a period, in order: zeros of its slope, which within a step is the cubic
/// through the slopes and their rates at both ends.
fn extrema(vehicle: &Vehicle, orbit: &Vehicles) -> Vec<Extremum> {
    let equations = vehicle.equations(orbit.parameters.map(Dual::<1>::constant));
    let slope = |x: &Vector4<f64>, mode| {
        let still = x.map(Dual::constant);
        let rates = equations.derivative(&still, mode).map(|rate| rate.value);
        let moving = Vector4::from_fn(|i, _| Dual::new(x[i], [rates[i]]));
        let second = equations.derivative(&moving, mode)[YAW_RATE];
        Sample {
            value: second.value,
            rate_per_s: second.tangent[0],
        }
    };
    let mut found = Vec::new();
    for segment in &orbit.segments {
        for (leg, pair) in segment.legs.iter().zip(segment.states.windows(2)) {
            let step_s = leg.step_s;
            let (from, to) = (slope(&pair[0], leg.mode), slope(&pair[1], leg.mode));
            let (first, last) = (pair[0][YAW_RATE], pair[1][YAW_RATE]);
            let at = |share: f64| hermite(from, to, step_s, share);
            // The quartic that has this cubic as its slope, by Simpson's rule.
            let height = |share: f64| {
                let area = |from: f64, to: f64| {
                    (to - from) / 6.0 * (at(from) + 4.0 * at(0.5 * (from + to)) + at(to)) * step_s
                };
                let whole = area(0.0, 1.0);
                first + area(0.0, share) + share * (last - first - whole)
            };
            for k in 0..SAMPLES {
                let (mut low, mut high) =
                    (k as f64 / SAMPLES as f64, (k + 1) as f64 / SAMPLES as f64);
                let is_maximum = at(low) > 0.0;
                if is_maximum == (at(high) > 0.0) {
                    continue;
                }
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    if (at(middle) > 0.0) == is_maximum {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                found.push(Extremum {
                    height: height(low),
                    is_maximum,
                });
            }
        }
    }
    found
}

/// Heights of the maxima that stand out by more than `least`, descending: pairs of neighbouring extrema that differ by
/// less are taken out, the nearest first.
fn prominent(extrema: &[Extremum], least: f64) -> Vec<f64> {
    let mut left: Vec<Extremum> = extrema.to_vec();
    while left.len() > 2 {
        let difference = |k: usize| (left[(k + 1) % left.len()].height - left[k].height).abs();
        let nearest = (0..left.len()).min_by(|&a, &b| difference(a).total_cmp(&difference(b)));
        let Some(nearest) = nearest.filter(|&k| difference(k) < least) else {
            break;
        };
        let next = (nearest + 1) % left.len();
        left.remove(nearest.max(next));
        left.remove(nearest.min(next));
    }
    maxima(&left)
}

/// Heights of the maxima, descending.
fn maxima(extrema: &[Extremum]) -> Vec<f64> {
    let maxima = extrema.iter().filter(|extremum| extremum.is_maximum);
    let mut heights: Vec<f64> = maxima.map(|extremum| extremum.height).collect();
    heights.sort_by(|a, b| b.total_cmp(a));
    heights
}

/// An equilibrium.
#[derive(Debug, Clone, serde::Serialize)]
pub struct RestPoint {
    /// The parameter's value.
    pub parameter: f64,
    /// The state.
    pub state: [f64; 4],
    /// All eigenvalues have negative real parts.
    pub stable: bool,
    /// The eigenvalues, by descending real part, 1/s.
    pub eigenvalues_per_s: Vec<Eigenvalue>,
}

impl RestPoint {
    pub(super) fn new(equilibrium: &Equilibrium<4>) -> Self {
        Self {
            parameter: equilibrium.parameters[0],
            state: equilibrium.x.into(),
            stable: equilibrium.is_stable(),
            eigenvalues_per_s: equilibrium
                .eigenvalues_per_s
                .iter()
                .map(of_complex)
                .collect(),
        }
    }
}

/// A Hopf bifurcation.
#[derive(Debug, Clone, serde::Serialize)]
pub struct HopfPoint {
    /// The parameter's value.
    pub parameter: f64,
    /// The equilibrium.
    pub state: [f64; 4],
    /// Angular frequency, rad/s.
    pub frequency_rad_per_s: f64,
    /// First Lyapunov coefficient: negative where the orbit that is born is stable (supercritical),
    /// positive where it is not (subcritical).
    pub first_lyapunov_coefficient: f64,
}

impl HopfPoint {
    pub(super) fn new(hopf: &Hopf<4>) -> Self {
        Self {
            parameter: hopf.at.parameters[0],
            state: hopf.at.x.into(),
            frequency_rad_per_s: hopf.frequency_rad_per_s,
            first_lyapunov_coefficient: hopf.first_lyapunov_coefficient,
        }
    }
}

/// A bifurcation of a periodic orbit.
#[derive(Debug, Clone, serde::Serialize)]
pub struct SpecialPoint {
    /// Its kind.
    pub kind: &'static str,
    /// The parameter's value.
    pub parameter: f64,
    /// Its error: difference to a location at a hundred times the tolerance, and width of the location.
    pub parameter_error: f64,
    /// Number of the branch that it is on.
    pub branch: usize,
    /// The orbit there.
    #[serde(flatten)]
    pub orbit: OrbitPoint,
}

impl SpecialPoint {
    pub(super) fn new(
        vehicle: &Vehicle,
        special: &Special<FrictionMode, 4>,
        branch: usize,
    ) -> Self {
        Self {
            kind: special.kind.name(),
            parameter: special.orbit.parameters[0],
            parameter_error: special.parameter_error,
            branch,
            orbit: OrbitPoint::new(vehicle, &special.orbit),
        }
    }
}

/// A point of a curve in two parameters.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct CurvePoint {
    /// Both parameters.
    pub parameters: [f64; 2],
    /// Period of the orbit, or of the oscillation that a Hopf bifurcation begins with, s.
    pub period_s: f64,
}

impl CurvePoint {
    pub(super) fn of_orbit(orbit: &Vehicles) -> Self {
        Self {
            parameters: orbit.parameters,
            period_s: orbit.period_s,
        }
    }

    pub(super) fn of_equilibrium(equilibrium: &Equilibrium<4>) -> Self {
        let pairs = equilibrium
            .eigenvalues_per_s
            .iter()
            .filter(|value| value.im > 0.0);
        let pair = pairs.min_by(|a, b| a.re.abs().total_cmp(&b.re.abs()));
        Self {
            parameters: equilibrium.parameters,
            period_s: pair.map_or(f64::NAN, |pair| std::f64::consts::TAU / pair.im),
        }
    }
}
