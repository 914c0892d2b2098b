//! Bifurcation diagram by continuation: branches of equilibria and of periodic orbits, stable and
//! unstable, with the bifurcations between them, and curves of these in two parameters.
//!
//! An orbit diagram shows where trajectories end after a transient; near a bifurcation a transient is as
//! slow as its multiplier is near the unit circle. Continuation solves for the orbits themselves, so a
//! bifurcation is located where a multiplier is 1 or -1.

mod figure;
mod record;

pub use figure::chart;
pub use record::{CurvePoint, HopfPoint, OrbitPoint, RestPoint, SpecialPoint};

use crate::equilibria;
use crate::observe::observe;
use crate::sweep::{RunControl, Timing};
use continuation::arclength::{End, Settings};
use continuation::branch::{self, Special};
use continuation::equilibrium::{Equilibria, Hopf};
use continuation::orbit::{Guess, Orbit, Shooting};
use continuation::start::{Search, near_returns};
use continuation::vehicle::{InvalidParameter, Vehicle};
use continuation::{Bifurcation, Failure, curve, equilibrium};
use engine::taylor::{Observables, Trajectory};
use nalgebra::{DVector, Vector2, Vector4};
use shared_model::friction::FrictionMode;
use shared_model::vehicle::YAW_RATE;
use shared_model::{InvalidScenario, Scenario};

/// Sizes of the states of the vehicle's equilibria, rad and rad/s.
const SIZES: Vector4<f64> = Vector4::new(0.3, 1.0, 0.5, 1.0);
/// Tolerance of the search for a start.
const SEARCH_TOLERANCE: f64 = 1e-9;
/// A return after one cycle that near, as a share of the extent, is that of a settled orbit.
const SETTLED: f64 = 1e-3;
/// The same after several cycles: chaos too returns to a thousandth within some hundred cycles.
const SETTLED_AFTER_SEVERAL: f64 = 1e-6;
/// What is observed after the transient, s.
const JUST_AFTER_S: f64 = 0.01;
/// Most cycles of an orbit that is searched for.
const MOST_CYCLES: usize = 16;
/// Amplitude of an orbit beside a Hopf bifurcation, in the scales.
const BESIDE_HOPF: f64 = 0.02;
/// Arclengths of the first step on a branch of twice the period, one after another.
const BESIDE_DOUBLING: [f64; 4] = [0.01, 0.003, 0.001, 0.0003];
/// Most points on each side of a curve.
const MOST_CURVE_POINTS: usize = 200;
/// A bifurcation nearer to a curve than this, as a share of both ranges, is on it.
const ON_CURVE: f64 = 2e-3;
/// Two bifurcations of the same kind nearer than this, as a share of the range, are one.
const SAME: f64 = 1e-6;

/// What is to be computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The scenario; the first orbit is searched for at its value of the parameter.
    pub scenario: Scenario<f64>,
    /// The parameter, as in a configuration file: `run.wheel_speed_rpm`.
    pub parameter: String,
    /// Its range.
    pub range: (f64, f64),
    /// The second parameter of curves, and its range.
    pub second: Option<(String, (f64, f64))>,
    /// Cycles of the orbit to begin with; without, the settled one's, or one.
    pub cycles: Option<usize>,
    /// Initial transient to discard, s.
    pub transient_s: f64,
    /// How many period doublings are followed one after another.
    pub doublings: usize,
    /// Integration tolerance, relative.
    pub tolerance: f64,
}

/// Why there is no diagram.
#[derive(Debug, thiserror::Error)]
pub enum BifurcationsError {
    /// The parameter or the scenario is not valid.
    #[error(transparent)]
    Parameter(#[from] InvalidParameter),
    /// The scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
    /// The range is none, or not within the parameter's own.
    #[error("{key}: from {from} to {to}: must be an ascending range within {least} to {greatest}")]
    Range {
        /// The parameter.
        key: String,
        /// Its lower end.
        from: f64,
        /// Its upper end.
        to: f64,
        /// Least allowed value.
        least: f64,
        /// Greatest allowed value.
        greatest: f64,
    },
    /// The scenario's value is not in the range.
    #[error(
        "{key} = {value}: must be in the range from {from} to {to}, as the start of the branches"
    )]
    Start {
        /// The parameter.
        key: String,
        /// Its value.
        value: f64,
        /// Lower end of the range.
        from: f64,
        /// Upper end of the range.
        to: f64,
    },
    /// The two parameters are one.
    #[error("{key}: both parameters of a curve are the same")]
    SameParameter {
        /// The parameter.
        key: String,
    },
    /// The tolerance is out of range.
    #[error("a tolerance of {tolerance:e}: must be from 1e-14 (rounding) to 1e-6")]
    Tolerance {
        /// The tolerance.
        tolerance: f64,
    },
}

/// A branch of equilibria.
#[derive(Debug, Clone, serde::Serialize)]
pub struct RestBranch {
    /// Its points, by ascending parameter where the branch does not turn back.
    pub points: Vec<RestPoint>,
    /// Values of the parameter at folds.
    pub folds: Vec<f64>,
}

/// A branch of periodic orbits.
#[derive(Debug, Clone, serde::Serialize)]
pub struct OrbitBranch {
    /// Where it comes from.
    pub origin: String,
    /// Its orbits, in the order of arclength.
    pub points: Vec<OrbitPoint>,
    /// Why it ends, at both ends.
    pub ends: Vec<End>,
}

/// A curve in both parameters.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Curve {
    /// The bifurcation.
    pub kind: &'static str,
    /// Its points in order.
    pub points: Vec<CurvePoint>,
    /// Points of codimension two on it: the second condition and both parameters.
    pub codimension_two: Vec<(&'static str, [f64; 2])>,
    /// Why it ends, at both ends.
    pub ends: Vec<End>,
}

/// A bifurcation diagram.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct Bifurcations {
    /// The parameter.
    pub parameter: String,
    /// The second parameter of the curves.
    pub second: Option<String>,
    /// Branches of equilibria.
    pub equilibria: Vec<RestBranch>,
    /// Hopf bifurcations.
    pub hopf: Vec<HopfPoint>,
    /// Branches of orbits.
    pub orbits: Vec<OrbitBranch>,
    /// Bifurcations of orbits.
    pub specials: Vec<SpecialPoint>,
    /// Curves of bifurcations.
    pub curves: Vec<Curve>,
    /// Starts that led to no branch, with the reason.
    pub without_branch: Vec<String>,
}

/// The diagram of a plan. After an interruption it contains what was complete.
///
/// # Errors
/// If the plan is not valid.
///
/// ```
/// use dynamics::bifurcations::{Plan, bifurcations};
/// let mut scenario = shared_model::Scenario::reconstruction();
/// scenario.friction.coefficient = 0.0;
/// scenario.run.wheel_speed_rpm = 1700.0;
/// let plan = Plan {
///     scenario,
///     parameter: "run.wheel_speed_rpm".into(),
///     range: (1600.0, 1800.0),
///     second: None,
///     cycles: None,
///     transient_s: 100.0,
///     doublings: 0,
///     tolerance: 1e-12,
/// };
/// let diagram = bifurcations(&plan)?;
/// let doubling = diagram.specials.iter().find(|special| special.kind == "period doubling").unwrap();
/// assert!((doubling.parameter - 1730.29362).abs() < 1e-4);
/// let hopf = &diagram.hopf[0];
/// assert!((hopf.parameter - 1650.817).abs() < 1e-3 && hopf.first_lyapunov_coefficient > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn bifurcations(plan: &Plan) -> Result<Bifurcations, BifurcationsError> {
    let mut work = Work::new(plan)?;
    // What is interrupted leaves what was complete.
    let _ = interrupt::catch(|| {
        let hopf = work.equilibria()?;
        work.orbits();
        work.born_by_hopf(&hopf);
        work.doubled();
        work.curves(&hopf);
        Ok::<_, InvalidScenario>(())
    });
    Ok(work.found)
}

type Vehicles<'a> = Shooting<'a, Vehicle, 4, 6>;

/// A bifurcation of orbits that may be followed, and how many doublings led to it.
struct Located {
    special: Special<FrictionMode, 4>,
    depth: usize,
}

struct Work<'a> {
    plan: &'a Plan,
    vehicle: Vehicle,
    settings: Settings,
    found: Bifurcations,
    located: Vec<Located>,
}

impl<'a> Work<'a> {
    fn new(plan: &'a Plan) -> Result<Self, BifurcationsError> {
        if !(1e-14..=1e-6).contains(&plan.tolerance) {
            return Err(BifurcationsError::Tolerance {
                tolerance: plan.tolerance,
            });
        }
        let idle = if plan.parameter == "vehicle.mass_kg" {
            "vehicle.yaw_inertia_kg_m2"
        } else {
            "vehicle.mass_kg"
        };
        let second = plan.second.as_ref().map_or(idle, |(key, _)| key.as_str());
        if second == plan.parameter {
            return Err(BifurcationsError::SameParameter { key: second.into() });
        }
        let vehicle = Vehicle::new(&plan.scenario, [&plan.parameter, second])?;
        check_range(&plan.parameter, plan.range)?;
        if let Some((key, range)) = &plan.second {
            check_range(key, *range)?;
        }
        let value = vehicle.parameters()[0];
        let (from, to) = plan.range;
        if !(from..=to).contains(&value) {
            let key = plan.parameter.clone();
            return Err(BifurcationsError::Start {
                key,
                value,
                from,
                to,
            });
        }
        Ok(Self {
            plan,
            vehicle,
            settings: Settings::over(&[plan.range]),
            found: Bifurcations {
                parameter: plan.parameter.clone(),
                second: plan.second.as_ref().map(|(key, _)| key.clone()),
                ..Bifurcations::default()
            },
            located: Vec::new(),
        })
    }

    /// Branches of equilibria through those at the start.
    fn equilibria(&mut self) -> Result<Vec<Hopf<4>>, InvalidScenario> {
        let parameters = self.vehicle.parameters();
        let mut all = Vec::new();
        for at in equilibria::find(&self.plan.scenario)? {
            let x = Vector4::from(at.state);
            let mode = self.vehicle.mode_of_slipping(&x);
            let spans = self.settings.spans();
            let problem =
                Equilibria::<_, 4, 6>::new(&self.vehicle, mode, &SIZES, parameters, &spans);
            let follow = |sign| {
                let guess = problem.unknowns(&x, parameters);
                equilibrium::follow(&problem, guess, sign, &self.settings)
            };
            let (Ok(down), Ok(up)) = (follow(-1.0), follow(1.0)) else {
                let note = format!("an equilibrium at {}", parameters[0]);
                self.found.without_branch.push(note);
                continue;
            };
            let points = down.equilibria.iter().skip(1).rev().chain(&up.equilibria);
            let folds = down
                .folds
                .iter()
                .chain(&up.folds)
                .map(|fold| fold.parameters[0]);
            self.found.equilibria.push(RestBranch {
                points: points.map(RestPoint::new).collect(),
                folds: folds.collect(),
            });
            for hopf in down.hopf.into_iter().chain(up.hopf) {
                // Two equilibria may be on one branch.
                let is_same = |other: &Hopf<4>| (other.at.x - hopf.at.x).amax() < SAME;
                if !all.iter().any(is_same) {
                    self.found.hopf.push(HopfPoint::new(&hopf));
                    all.push(hopf);
                }
            }
        }
        self.found
            .hopf
            .sort_by(|a, b| a.parameter.total_cmp(&b.parameter));
        Ok(all)
    }

    /// The branch through the orbit that the scenario's trajectory returns to.
    fn orbits(&mut self) {
        let parameters = self.vehicle.parameters();
        let start = match self.settled() {
            Ok(start) => start,
            Err(reason) => {
                let reason = format!("the scenario's trajectory: {reason}");
                self.found.without_branch.push(reason);
                return;
            }
        };
        let search = Search {
            start,
            transient_s: 0.0,
            observed_s: 100.0,
            component: YAW_RATE,
            most_cycles: self.plan.cycles.unwrap_or(MOST_CYCLES),
            tolerance: SEARCH_TOLERANCE,
        };
        let returns = match near_returns(&self.vehicle, parameters, &search) {
            Ok(returns) => returns,
            Err(failure) => {
                self.found
                    .without_branch
                    .push(format!("the scenario's trajectory: {failure}"));
                return;
            }
        };
        let chosen = match self.plan.cycles {
            Some(cycles) => returns.iter().find(|found| found.cycles == cycles),
            None => returns
                .iter()
                .find(|found| match found.cycles {
                    1 => found.distance < SETTLED,
                    _ => found.distance < SETTLED_AFTER_SEVERAL,
                })
                .or(returns.first()),
        };
        let Some(chosen) = chosen else {
            self.found
                .without_branch
                .push("the scenario's trajectory: no return".into());
            return;
        };
        let origin = format!("the trajectory at {}", parameters[0]);
        if let Err(failure) = self.both_ways(&origin, &chosen.guess) {
            self.found
                .without_branch
                .push(format!("{origin}: {failure}"));
        }
    }

    /// The state after the transient, by the engine.
    fn settled(&self) -> Result<Vector4<f64>, String> {
        let timing = Timing {
            transient_s: self.plan.transient_s,
            observed_s: JUST_AFTER_S,
        };
        let one = std::slice::from_ref(&self.plan.scenario);
        let nothing = Observables::default();
        let see = |_: &_, found: &Trajectory<0>| (found.end.x, found.early_end);
        let found = observe(one, timing, nothing, RunControl::none(), see);
        let mut found = found.map_err(|error| error.to_string())?;
        match found.pop().flatten() {
            Some((x, None)) => Ok(x),
            Some((_, Some(end))) => Err(end.to_string()),
            None => Err("not computed".into()),
        }
    }

    fn both_ways(&mut self, origin: &str, guess: &Guess<4>) -> Result<(), Failure> {
        let vehicle = self.vehicle.clone();
        let spans = self.settings.spans();
        let problem = Vehicles::new(&vehicle, guess, &spans, 1, self.plan.tolerance)?;
        let unknowns = problem.guess(&guess.start, guess.period_s, guess.parameters)?;
        let follow = |sign| {
            let axis = problem.parameter_axis(sign);
            branch::follow(&problem, unknowns.clone(), &axis, &self.settings, |_| true)
        };
        let (down, up) = (follow(-1.0)?, follow(1.0)?);
        let points = down.orbits.iter().skip(1).rev().chain(&up.orbits);
        self.found.orbits.push(OrbitBranch {
            origin: origin.into(),
            points: points
                .map(|orbit| OrbitPoint::new(&vehicle, orbit))
                .collect(),
            ends: vec![down.end, up.end],
        });
        self.note(down.specials, 0);
        self.note(up.specials, 0);
        Ok(())
    }

    /// Keeps bifurcations that were not known.
    fn note(&mut self, specials: Vec<Special<FrictionMode, 4>>, depth: usize) {
        let span = self.settings.spans()[0];
        for special in specials {
            let parameter = special.orbit.parameters[0];
            let known = self.located.iter().any(|other| {
                let period = other.special.orbit.period_s / special.orbit.period_s - 1.0;
                other.special.kind == special.kind
                    && (other.special.orbit.parameters[0] - parameter).abs() < SAME * span
                    && period.abs() < SAME
            });
            if !known {
                let branch = self.found.orbits.len() - 1;
                self.found
                    .specials
                    .push(SpecialPoint::new(&self.vehicle, &special, branch));
                self.located.push(Located { special, depth });
            }
        }
    }

    /// Branches of the orbits that are born at Hopf bifurcations. Where the steering can stick there are
    /// none: small oscillations come to rest.
    fn born_by_hopf(&mut self, all: &[Hopf<4>]) {
        if self.vehicle.can_stick() {
            return;
        }
        for hopf in all {
            let origin = format!("the Hopf bifurcation at {:.6}", hopf.at.parameters[0]);
            if let Err(failure) = self.beside_hopf(&origin, hopf) {
                self.found
                    .without_branch
                    .push(format!("{origin}: {failure}"));
            }
        }
    }

    fn beside_hopf(&mut self, origin: &str, hopf: &Hopf<4>) -> Result<(), Failure> {
        let vehicle = self.vehicle.clone();
        let mode = vehicle.mode_of_slipping(&hopf.at.x);
        let spans = self.settings.spans();
        let problem =
            Equilibria::<_, 4, 6>::new(&vehicle, mode, &SIZES, hopf.at.parameters, &spans);
        let (displacement, period_s) = problem
            .orbit_guess(&hopf.at, BESIDE_HOPF)
            .ok_or(Failure::Singular)?;
        let guess = Guess {
            start: hopf.at.x + displacement,
            period_s,
            parameters: hopf.at.parameters,
        };
        let problem = Vehicles::new(&vehicle, &guess, &spans, 1, self.plan.tolerance)?;
        let unknowns = problem.guess(&guess.start, period_s, guess.parameters)?;
        self.one_way(
            origin,
            &problem,
            unknowns,
            &problem.state_axis(&displacement),
            0,
        )
    }

    /// A branch from where it begins; one that is known already is left out.
    fn one_way(
        &mut self,
        origin: &str,
        problem: &Vehicles<'_>,
        guess: DVector<f64>,
        tangent: &DVector<f64>,
        depth: usize,
    ) -> Result<(), Failure> {
        let branch = branch::follow(problem, guess, tangent, &self.settings, |_| true)?;
        let points: Vec<_> = branch
            .orbits
            .iter()
            .map(|orbit| OrbitPoint::new(problem.system(), orbit))
            .collect();
        if self.is_known(&points) {
            return Ok(());
        }
        let ends = vec![branch.end];
        self.found.orbits.push(OrbitBranch {
            origin: origin.into(),
            points,
            ends,
        });
        self.note(branch.specials, depth);
        Ok(())
    }

    /// Whether a branch's middle orbit is on another branch.
    fn is_known(&self, points: &[OrbitPoint]) -> bool {
        let Some(middle) = points.get(points.len() / 2) else {
            return true;
        };
        let is_between = |pair: &[OrbitPoint]| {
            let share =
                (middle.parameter - pair[0].parameter) / (pair[1].parameter - pair[0].parameter);
            let mix =
                |of: fn(&OrbitPoint) -> f64| of(&pair[0]) + share * (of(&pair[1]) - of(&pair[0]));
            (0.0..=1.0).contains(&share)
                && (mix(|p| p.period_s) / middle.period_s - 1.0).abs() < 1e-3
                && (mix(|p| p.yaw_rate_max_rad_per_s) - middle.yaw_rate_max_rad_per_s).abs() < 1e-2
        };
        self.found
            .orbits
            .iter()
            .any(|known| known.points.windows(2).any(is_between))
    }

    /// Branches of twice the period, one after another.
    fn doubled(&mut self) {
        let mut next = 0;
        while next < self.located.len() {
            let Located { special, depth } = &self.located[next];
            let (kind, depth, orbit) = (special.kind, *depth, special.orbit.clone());
            next += 1;
            if kind != Bifurcation::PeriodDoubling || depth >= self.plan.doublings {
                continue;
            }
            let origin = format!("the period doubling at {:.6}", orbit.parameters[0]);
            if let Err(failure) = self.beside_doubling(&origin, &orbit, depth + 1) {
                self.found
                    .without_branch
                    .push(format!("{origin}: {failure}"));
            }
        }
    }

    fn beside_doubling(
        &mut self,
        origin: &str,
        orbit: &Orbit<FrictionMode, 4>,
        depth: usize,
    ) -> Result<(), Failure> {
        let vehicle = self.vehicle.clone();
        let problem = self.problem_at(&vehicle, orbit)?;
        // The parameter changes with the square of the arclength: the next one if it is too far.
        let mut result = Err(Failure::Singular);
        for arclength in BESIDE_DOUBLING {
            let (problem, guess, tangent) = problem.doubled(orbit, arclength)?;
            result = self.one_way(origin, &problem, guess, &tangent, depth);
            if result.is_ok() {
                break;
            }
        }
        result
    }

    fn problem_at<'v>(
        &self,
        vehicle: &'v Vehicle,
        orbit: &Orbit<FrictionMode, 4>,
    ) -> Result<Vehicles<'v>, Failure> {
        Vehicles::new(
            vehicle,
            &orbit.guess(),
            &self.settings.spans(),
            1,
            self.plan.tolerance,
        )
    }

    /// Curves of the bifurcations in both parameters: of those on branches that are not born by a doubling.
    fn curves(&mut self, hopf: &[Hopf<4>]) {
        let Some((_, range)) = &self.plan.second else {
            return;
        };
        let mut settings = Settings::over(&[self.plan.range, *range]);
        settings.most_points = MOST_CURVE_POINTS;
        let vehicle = self.vehicle.clone();
        for number in 0..self.located.len() {
            let Located { special, depth } = &self.located[number];
            let (kind, orbit) = (special.kind, special.orbit.clone());
            let has_no_curve = kind == Bifurcation::Grazing || *depth > 0;
            if has_no_curve || self.is_on_curve(kind.name(), orbit.parameters, &settings) {
                continue;
            }
            let follow = |sign| {
                let problem = self.problem_at(&vehicle, &orbit)?;
                curve::of_orbits(&problem, kind, &orbit, sign, &settings)
            };
            let sides = [follow(-1.0), follow(1.0)];
            self.keep_curve(kind.name(), sides, CurvePoint::of_orbit);
        }
        for hopf in hopf {
            let mode = vehicle.mode_of_slipping(&hopf.at.x);
            let follow =
                |sign| curve::of_hopf::<_, 4, 6>(&vehicle, mode, &SIZES, &hopf.at, sign, &settings);
            self.keep_curve(
                "Hopf",
                [follow(-1.0), follow(1.0)],
                CurvePoint::of_equilibrium,
            );
        }
    }

    /// Whether a curve of that kind passes through the parameters.
    fn is_on_curve(&self, kind: &str, at: [f64; 2], settings: &Settings) -> bool {
        let spans = settings.spans();
        let scaled = |p: [f64; 2]| Vector2::new(p[0] / spans[0], p[1] / spans[1]);
        let passes = |pair: &[CurvePoint]| {
            let (from, to) = (scaled(pair[0].parameters), scaled(pair[1].parameters));
            let along = to - from;
            let share = (scaled(at) - from).dot(&along) / along.norm_squared();
            let nearest = from + along * share.clamp(0.0, 1.0);
            (nearest - scaled(at)).norm() < ON_CURVE
        };
        let of_kind = self.found.curves.iter().filter(|curve| curve.kind == kind);
        of_kind
            .into_iter()
            .any(|curve| curve.points.windows(2).any(passes))
    }

    /// Joins both sides of a curve.
    fn keep_curve<T>(
        &mut self,
        kind: &'static str,
        sides: [Result<curve::Curve<T>, Failure>; 2],
        point: impl Fn(&T) -> CurvePoint,
    ) {
        let mut points: Vec<CurvePoint> = Vec::new();
        let mut codimension_two = Vec::new();
        let mut ends = Vec::new();
        for side in sides {
            match side {
                Ok(side) => {
                    let named = side.codimension_two.iter();
                    codimension_two
                        .extend(named.map(|point| (point.condition.name(), point.parameters)));
                    points.reverse();
                    let known = usize::from(!points.is_empty());
                    points.extend(side.points.iter().skip(known).map(&point));
                    ends.push(side.end);
                }
                Err(failure) => ends.push(End::Failed(failure)),
            }
        }
        self.found.curves.push(Curve {
            kind,
            points,
            codimension_two,
            ends,
        });
    }
}

fn check_range(key: &str, (from, to): (f64, f64)) -> Result<(), BifurcationsError> {
    // An unknown key has been refused before.
    let (least, greatest) = Scenario::<f64>::range(key).unwrap_or((f64::MIN, f64::MAX));
    if from < to && from >= least && to <= greatest {
        return Ok(());
    }
    Err(BifurcationsError::Range {
        key: key.into(),
        from,
        to,
        least,
        greatest,
    })
}
