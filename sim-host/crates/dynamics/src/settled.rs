//! Whether a trajectory has settled, and on what: the periodic orbit or the equilibrium beside it, by
//! Newton's method.
//!
//! Near a bifurcation a transient is as slow as the greatest multiplier is near the unit circle, so that
//! maxima that still alternate look like those of twice the period, and a slow spiral like a cycle. The
//! orbit itself has its multipliers: if they are within the unit circle and the trajectory approaches it,
//! that is what the trajectory ends on, however long it takes.

use crate::bifurcations::OrbitPoint;
use crate::equilibria;
use crate::sweep::Parameter;
use continuation::Bifurcation;
use continuation::arclength::Settings;
use continuation::branch::{Branch, Special, follow, orbit_at};
use continuation::orbit::{Guess, Orbit, Shooting};
use continuation::start::{returns, rises};
use continuation::trajectory::integrate;
use continuation::vehicle::Vehicle;
use nalgebra::Vector4;
use shared_model::Scenario;
use shared_model::friction::FrictionMode;
use shared_model::vehicle::YAW_RATE;

/// Length of the trajectory that is compared with the orbit, s.
const COMPARED_S: f64 = 60.0;
/// Tolerances of that trajectory, and of the orbit.
const TRAJECTORY_TOLERANCE: f64 = 1e-9;
const ORBIT_TOLERANCE: f64 = 1e-11;
/// Tolerance of a branch whose bifurcation is located.
const BRANCH_TOLERANCE: f64 = 1e-12;
/// Most cycles of an orbit.
const MOST_CYCLES: usize = 8;
/// A return farther than this, as a share of the trajectory's extent, is none near a stable orbit.
const FARTHEST: f64 = 0.1;
/// A distance below which the trajectory is on the orbit, as a share of its extent.
const ON_ORBIT: f64 = 1e-7;
/// An orbit of less than this share of the trajectory's extent is the equilibrium within it.
const SHRUNK: f64 = 1e-2;
/// Steps in which a range of equilibria is searched, and halvings of one.
const REST_STEPS: u32 = 12;

pub(crate) type VehicleOrbit = Orbit<FrictionMode, 4>;

/// What a trajectory ends on.
#[derive(Debug, Clone)]
pub(crate) enum Settled {
    /// A stable periodic orbit.
    Orbit(Box<OrbitPoint>),
    /// A stable equilibrium.
    Equilibrium([f64; 4]),
}

/// What the trajectory from `end` ends on; `None` if it is no stable orbit or equilibrium beside it, or
/// the trajectory does not approach it.
pub(crate) fn settled(scenario: &Scenario<f64>, end: &[f64; 4]) -> Option<Settled> {
    let vehicle = Vehicle::new(scenario, [Parameter::Speed.key(), "vehicle.mass_kg"]).ok()?;
    let compared = Compared::new(&vehicle, end)?;
    match compared.approached() {
        Some(orbit) => Some(Settled::Orbit(Box::new(OrbitPoint::new(&vehicle, &orbit)))),
        None => compared.equilibrium(scenario).map(Settled::Equilibrium),
    }
}

/// The bifurcation at which the stable orbit beside a trajectory from `end` ends or loses its stability, on
/// the way of the parameter from the scenario's value towards `to`: its kind, the value and its error.
pub(crate) fn end_of_orbit(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    end: &[f64; 4],
    to: f64,
) -> Option<(&'static str, f64, f64)> {
    let vehicle = Vehicle::new(scenario, [parameter.key(), "vehicle.mass_kg"]).ok()?;
    let from = vehicle.parameters()[0];
    let compared = Compared::new(&vehicle, end)?;
    let orbit = compared.orbits().find(|orbit| orbit.is_stable())?;
    let (least, greatest) = Scenario::<f64>::range(parameter.key())?;
    let range = (from.min(to).max(least), from.max(to).min(greatest));
    let settings = Settings::over(&[range]);
    let sign = (to - from).signum();
    // The first unstable orbit is the last that is needed.
    let keeps = VehicleOrbit::is_stable;
    let branch = branch_from(&vehicle, &orbit, sign, &settings, BRANCH_TOLERANCE, keeps)?;
    let is_end = |special: &&Special<FrictionMode, 4>| match special.kind {
        Bifurcation::PeriodDoubling | Bifurcation::Fold | Bifurcation::NeimarkSacker => true,
        Bifurcation::BranchPoint | Bifurcation::Grazing => false,
    };
    let special = branch.specials.iter().find(is_end)?;
    let value = special.orbit.parameters[0];
    Some((special.kind.name(), value, special.parameter_error))
}

/// How perturbations of what a trajectory ends on decay, and where over a parameter they keep a margin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Decay {
    /// Share of a perturbation that is left after a period: the greatest modulus of a multiplier beside 1.
    pub multiplier: f64,
    /// Range around the scenario's value in which that share stays below the margin; the value alone where it
    /// does not.
    pub from: f64,
    /// Its upper end.
    pub to: f64,
}

/// The decay beside the trajectory from `end`, which may be at rest there, and the range of the parameter within `range` in which the
/// multipliers stay below `margin`. `None` without a stable orbit or equilibrium that the trajectory approaches.
pub(crate) fn decay(
    scenario: &Scenario<f64>,
    parameter: Parameter,
    (end, is_at_rest): (&[f64; 4], bool),
    range: (f64, f64),
    margin: f64,
) -> Option<Decay> {
    let vehicle = Vehicle::new(scenario, [parameter.key(), "vehicle.mass_kg"]).ok()?;
    let value = vehicle.parameters()[0];
    let compared = Compared::new(&vehicle, end)?;
    let orbit = if is_at_rest {
        None
    } else {
        compared.approached()
    };
    let Some(orbit) = orbit else {
        let state = if is_at_rest {
            *end
        } else {
            compared.equilibrium(scenario)?
        };
        let left = |value| left_at_rest(&parameter.set(scenario, value), &state);
        let [from, to] = [range.0, range.1].map(|bound| last_below(left, value, bound, margin));
        return Some(Decay {
            multiplier: left(value)?,
            from,
            to,
        });
    };
    let multiplier = greatest_multiplier(&orbit);
    let settings = Settings::over(&[range]);
    let keeps = |orbit: &VehicleOrbit| greatest_multiplier(orbit) <= margin;
    let bound = |sign| {
        let branch = branch_from(&vehicle, &orbit, sign, &settings, BRANCH_TOLERANCE, keeps)?;
        let values = branch
            .orbits
            .iter()
            .map(|orbit| (orbit.parameters[0], greatest_multiplier(orbit)));
        Some(crossing(values, margin))
    };
    Some(Decay {
        multiplier,
        from: bound(-1.0)?,
        to: bound(1.0)?,
    })
}

/// The branch from an orbit towards greater (`sign` 1) or smaller (-1) values of the first parameter, up to the first
/// orbit that is not kept.
pub(crate) fn branch_from(
    vehicle: &Vehicle,
    orbit: &VehicleOrbit,
    sign: f64,
    settings: &Settings,
    tolerance: f64,
    keeps: impl FnMut(&VehicleOrbit) -> bool,
) -> Option<Branch<FrictionMode, 4>> {
    let guess = orbit.guess();
    let problem =
        Shooting::<_, 4, 6>::new(vehicle, &guess, &settings.spans(), 1, tolerance).ok()?;
    let unknowns = problem.guess(&guess.start, guess.period_s, guess.parameters);
    let axis = problem.parameter_axis(sign);
    follow(&problem, unknowns.ok()?, &axis, settings, keeps).ok()
}

/// The orbit near a guess, at its parameters.
pub(crate) fn orbit_near(vehicle: &Vehicle, guess: &Guess<4>) -> Option<VehicleOrbit> {
    let problem = Shooting::<_, 4, 6>::new(vehicle, guess, &[1.0], 1, ORBIT_TOLERANCE).ok()?;
    let unknowns = problem.guess(&guess.start, guess.period_s, guess.parameters);
    orbit_at(&problem, unknowns.ok()?).ok()
}

fn greatest_multiplier(orbit: &VehicleOrbit) -> f64 {
    let moduli = orbit.multipliers.iter().map(|multiplier| multiplier.norm());
    moduli.fold(0.0, f64::max)
}

/// The parameter's value at which the multiplier passes the margin, by interpolation; the last value if it does
/// not.
fn crossing(values: impl Iterator<Item = (f64, f64)>, margin: f64) -> f64 {
    let mut last = None;
    for (value, multiplier) in values {
        match last {
            Some((before, kept)) if multiplier > margin => {
                return before + (value - before) * (margin - kept) / (multiplier - kept);
            }
            _ if multiplier > margin => return value,
            _ => last = Some((value, multiplier)),
        }
    }
    last.map_or(f64::NAN, |(value, _)| value)
}

/// Share of a perturbation of the equilibrium near `state` that is left after a turn of its slowest oscillation;
/// nothing where the steering sticks.
fn left_at_rest(scenario: &Scenario<f64>, state: &[f64; 4]) -> Option<f64> {
    let all = equilibria::find(scenario).ok()?;
    if let Some(held) = all.iter().find(|equilibrium| equilibrium.holds(state)) {
        return held.stable.then_some(0.0);
    }
    let apart =
        |e: &equilibria::Equilibrium| (Vector4::from(e.state) - Vector4::from(*state)).norm();
    let nearest = all.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
    let left = nearest.eigenvalues_per_s.iter().map(|value| {
        let turn_s = std::f64::consts::TAU / value.im.abs();
        (value.re * turn_s).exp()
    });
    Some(left.fold(0.0, f64::max))
}

/// The value farthest from `from` towards `to` up to which a quantity stays below the margin, by bisection in
/// each of some steps.
fn last_below(left: impl Fn(f64) -> Option<f64>, from: f64, to: f64, margin: f64) -> f64 {
    let keeps = |value| left(value).is_some_and(|left| left <= margin);
    let mut kept = from;
    for step in 1..=REST_STEPS {
        let mut lost = from + (to - from) * f64::from(step) / f64::from(REST_STEPS);
        if keeps(lost) {
            kept = lost;
            continue;
        }
        for _ in 0..REST_STEPS {
            let middle = 0.5 * (kept + lost);
            if keeps(middle) {
                kept = middle;
            } else {
                lost = middle;
            }
        }
        return kept;
    }
    kept
}

/// A trajectory, to be compared with what is beside it.
struct Compared<'a> {
    vehicle: &'a Vehicle,
    /// Its rises of the yaw rate through the middle of its range: time, s, and state.
    crossings: Vec<(f64, Vector4<f64>)>,
    level: f64,
    extent: Vector4<f64>,
}

impl<'a> Compared<'a> {
    fn new(vehicle: &'a Vehicle, end: &[f64; 4]) -> Option<Self> {
        let start = Vector4::from(*end);
        let parameters = vehicle.parameters();
        let tolerance = TRAJECTORY_TOLERANCE;
        let trajectory = integrate(vehicle, parameters, &start, COMPARED_S, tolerance).ok()?;
        let (low, high) = trajectory.extent();
        let level = 0.5 * (low[YAW_RATE] + high[YAW_RATE]);
        let crossings = rises(vehicle, parameters, &trajectory, YAW_RATE, level, tolerance);
        Some(Self {
            vehicle,
            crossings,
            level,
            extent: high - low,
        })
    }

    /// Orbits beside it, by ascending number of cycles.
    fn orbits(&self) -> impl Iterator<Item = VehicleOrbit> {
        let parameters = self.vehicle.parameters();
        returns(&self.crossings, &self.extent, parameters, MOST_CYCLES)
            .into_iter()
            .filter(|found| found.distance < FARTHEST)
            .filter_map(|found| orbit_near(self.vehicle, &found.guess))
            .filter(|orbit| orbit.size() > SHRUNK * self.extent.amax())
    }

    /// The stable orbit that it approaches.
    fn approached(&self) -> Option<VehicleOrbit> {
        self.orbits()
            .find(|orbit| orbit.is_stable() && self.approaches(orbit))
    }

    /// The trajectory's crossings come nearer to the orbit's, or are on it.
    fn approaches(&self, orbit: &VehicleOrbit) -> bool {
        let vehicle = self.vehicle;
        let tolerance = TRAJECTORY_TOLERANCE;
        // More than a period, so that no crossing is at its end.
        let length_s = 1.5 * orbit.period_s;
        let Ok(once) = integrate(
            vehicle,
            orbit.parameters,
            orbit.start(),
            length_s,
            tolerance,
        ) else {
            return false;
        };
        let own = rises(
            vehicle,
            orbit.parameters,
            &once,
            YAW_RATE,
            self.level,
            tolerance,
        );
        let distance = |(_, x): &(f64, Vector4<f64>)| {
            let apart = own
                .iter()
                .map(|(_, other)| (x - other).component_div(&self.extent).amax());
            apart.fold(f64::INFINITY, f64::min)
        };
        let quarter = self.crossings.len() / 4;
        if quarter == 0 || own.is_empty() {
            return false;
        }
        let greatest = |of: &[(f64, Vector4<f64>)]| of.iter().map(distance).fold(0.0, f64::max);
        let first = greatest(&self.crossings[..quarter]);
        let last = greatest(&self.crossings[self.crossings.len() - quarter..]);
        last < ON_ORBIT || (last < first && last < FARTHEST)
    }

    /// The stable equilibrium that a spiral shrinks to.
    fn equilibrium(&self, scenario: &Scenario<f64>) -> Option<[f64; 4]> {
        let (first, last) = (&self.crossings.first()?.1, &self.crossings.last()?.1);
        let all = equilibria::find(scenario).ok()?;
        let apart = |x: &Vector4<f64>, state: &[f64; 4]| (x - Vector4::from(*state)).norm();
        let nearest = all
            .iter()
            .min_by(|a, b| apart(last, &a.state).total_cmp(&apart(last, &b.state)))?;
        let shrinks = apart(last, &nearest.state) < apart(first, &nearest.state);
        (nearest.stable && shrinks).then_some(nearest.state)
    }
}
