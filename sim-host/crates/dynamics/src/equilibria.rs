//! Equilibria at a speed, their eigenvalues, and the speeds of Hopf bifurcations.
//!
//! At an equilibrium sideslip, yaw rate and steering angle stay: beta' = gamma' = delta_f' =
//! delta_f'' = 0 in (14), with the mean of the dither. Dry friction needs care. Coulomb friction on
//! the rate holds the steering wherever the other torques are within its limit, so there is a
//! continuum of equilibria: reported is the one at which no friction is needed, and the
//! *stick band* around it, in which |r_s tau_M - tau_a| <= tau_c. The printed law is constant on
//! either side of delta_f = 0; reported are the balances with that torque on the side on which it
//! acts.

use crate::eigenvalues::{Eigenvalue, eigenvalues};
use crate::sweep::{Parameter, RunControl, SweepError, Values, scenarios};
use engine::dual::Dual;
use nalgebra::{Matrix2, Matrix3, Matrix4, Vector3, Vector4};
use plot::chart::{AxisSpec, Chart, Look, Panel, Series, large_dots};
use shared_model::dither::{Application, Injection};
use shared_model::friction::{FrictionLaw, FrictionMode, Sign};
use shared_model::vehicle::{Model, SIDESLIP, STEERING_ANGLE, STEERING_RATE, YAW_RATE};
use shared_model::{InvalidScenario, Scenario};

/// Starts of Newton's method for each axle's slip angle.
const STARTS: i32 = 25;
/// Greatest slip angle, rad: an equilibrium beyond is none of a vehicle that drives forwards.
const GREATEST_SLIP_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// Newton's steps before it counts as failed.
const NEWTON_STEPS: usize = 60;
/// Greatest residual of an equilibrium, in rad/s and rad/s^2.
const GREATEST_RESIDUAL: f64 = 1e-10;
/// Closer ones are the same, in every component.
const SAME: f64 = 1e-7;
/// Equilibria at neighbouring speeds with slip angles this close are one branch, rad.
const SAME_BRANCH_RAD: f64 = 1e-3;
/// Steps in which a stick band is followed from its middle to each end.
const BAND_STEPS: i32 = 64;
/// A state of rest this far out of a stick band still belongs to it, rad and rad/s: what the flow
/// still moves.
const BAND_MARGIN: f64 = 1e-4;
/// Width to which the speed of a Hopf bifurcation is located, rpm.
const HOPF_WIDTH_RPM: f64 = 1e-3;

/// Where a sticking steering may rest.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct StickBand {
    /// End at which friction holds the steering against a torque of -tau_c (state vector), or
    /// where the balance folds back before.
    pub lower: [f64; 4],
    /// The end with tau_c.
    pub upper: [f64; 4],
    /// Eigenvalues of sideslip and yaw rate with the steering held, at the middle, 1/s.
    pub eigenvalues_per_s: Vec<Eigenvalue>,
    /// These have negative real parts: with the steering held the motion comes to rest.
    pub stable: bool,
}

/// An equilibrium.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Equilibrium {
    /// [beta (rad), gamma (rad/s), delta_f (rad), delta_f' (rad/s) = 0].
    pub state: [f64; 4],
    /// Greatest rate of change there, rad/s and rad/s^2.
    pub residual: f64,
    /// Slip angles of front and rear tyres, rad.
    pub slip_angles_rad: [f64; 2],
    /// Eigenvalues of the motion beside it, friction constant, greatest real part first, 1/s.
    pub eigenvalues_per_s: Vec<Eigenvalue>,
    /// All real parts are negative.
    pub stable: bool,
    /// The continuum around it, with Coulomb friction that can stick.
    pub stick_band: Option<StickBand>,
}

impl Equilibrium {
    /// A motion at rest in this state is held here by friction.
    pub fn holds(&self, state: &[f64; 4]) -> bool {
        self.stick_band.as_ref().is_some_and(|band| {
            (0..4).all(|k| {
                let low = band.lower[k].min(band.upper[k]) - BAND_MARGIN;
                let high = band.lower[k].max(band.upper[k]) + BAND_MARGIN;
                (low..=high).contains(&state[k])
            })
        })
    }

    /// The equilibrium with these slip angles (rad) is this one at another speed: the motor's
    /// torque fixes the forces, so the slip angles stay.
    pub(crate) fn is_on_branch(&self, slip_angles_rad: &[f64; 2]) -> bool {
        let mut pairs = self.slip_angles_rad.iter().zip(slip_angles_rad);
        pairs.all(|(a, b)| (a - b).abs() < SAME_BRANCH_RAD)
    }

    /// The pair of complex eigenvalues with the greatest real part, by the one with positive
    /// imaginary part.
    pub fn leading_pair(&self) -> Option<Eigenvalue> {
        self.eigenvalues_per_s.iter().copied().find(|e| e.im > 0.0)
    }
}

/// The steady-state equations of one scenario and their derivatives.
struct Balance {
    model: Model<f64>,
    dual: Model<Dual<4>>,
    injection: Injection<f64>,
    sign: Sign<f64>,
    law: FrictionLaw,
    steering_inertia_kg_m2: f64,
    friction_limit_nm: f64,
}

impl Balance {
    fn new(scenario: &Scenario<f64>) -> Result<Self, InvalidScenario> {
        scenario.validate()?;
        let mut averaged = *scenario;
        averaged.dither.application = Application::Averaged;
        let injection = averaged.dither.injection(0.0);
        let friction = averaged.friction;
        let sign = friction.injection(injection, averaged.dither.frequency_rad_per_s());
        Ok(Self {
            model: Model::new(&averaged),
            dual: Model::new(&averaged.map(&Dual::constant)),
            injection,
            sign: Sign::new(sign),
            law: friction.law,
            steering_inertia_kg_m2: averaged.steering.inertia_kg_m2,
            friction_limit_nm: friction.limit_nm(averaged.steering.pneumatic_trail_m),
        })
    }

    /// Modes in which the friction can be at rest without holding.
    fn modes(&self) -> &'static [FrictionMode] {
        use FrictionMode::{Negative, Neutral, Positive};
        match self.law {
            FrictionLaw::PrintedAngle => &[Negative, Neutral, Positive],
            FrictionLaw::None | FrictionLaw::CoulombRate => &[Neutral],
        }
    }

    fn consistent(&self, x: &Vector4<f64>, mode: FrictionMode) -> bool {
        self.law != FrictionLaw::PrintedAngle || self.sign.mode(x[STEERING_ANGLE]) == mode
    }

    fn sticks(&self) -> bool {
        let (lower, upper) = (0.0, 0.0);
        self.law == FrictionLaw::CoulombRate && self.sign == Sign::Stepped { lower, upper }
    }

    /// Time derivative and Jacobian.
    fn linearised(&self, x: &Vector4<f64>, mode: FrictionMode) -> (Vector4<f64>, Matrix4<f64>) {
        let unit = |k: usize| std::array::from_fn(|j| f64::from(u8::from(j == k)));
        let dual = Vector4::from_fn(|k, _| Dual::new(x[k], unit(k)));
        let rates = self
            .dual
            .derivative(&dual, self.injection.map(Dual::constant), mode);
        let jacobian = Matrix4::from_fn(|row, column| rates[row].tangent[column]);
        (rates.map(|rate| rate.value), jacobian)
    }

    /// Newton's method for the balance with a torque of `held_nm` taken up by friction.
    fn newton(
        &self,
        start: Vector4<f64>,
        mode: FrictionMode,
        held_nm: f64,
    ) -> Option<(Vector4<f64>, f64)> {
        const ROWS: [usize; 3] = [SIDESLIP, YAW_RATE, STEERING_RATE];
        const COLUMNS: [usize; 3] = [SIDESLIP, YAW_RATE, STEERING_ANGLE];
        let mut x = start;
        for _ in 0..NEWTON_STEPS {
            let (mut rates, jacobian) = self.linearised(&x, mode);
            rates[STEERING_RATE] -= held_nm / self.steering_inertia_kg_m2;
            let residual = Vector3::from_fn(|row, _| rates[ROWS[row]]);
            let matrix = Matrix3::from_fn(|row, column| jacobian[(ROWS[row], COLUMNS[column])]);
            let step = matrix.lu().solve(&residual)?;
            for (row, column) in COLUMNS.into_iter().enumerate() {
                x[column] -= step[row];
            }
            let size = residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
            let moved = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
            if !size.is_finite() || !moved.is_finite() {
                return None;
            }
            if size < GREATEST_RESIDUAL && moved < 1e-12 {
                return Some((x, size));
            }
        }
        None
    }

    fn equilibrium(&self, x: Vector4<f64>, residual: f64, mode: FrictionMode) -> Equilibrium {
        let (_, jacobian) = self.linearised(&x, mode);
        let eigenvalues_per_s = eigenvalues(&jacobian);
        let (front, rear) = self.model.slip_angles(&x);
        let stick_band = self.sticks().then(|| {
            let held: Matrix2<f64> = jacobian.fixed_view::<2, 2>(0, 0).into_owned();
            let held = eigenvalues(&held);
            StickBand {
                lower: self.band_end(x, -self.friction_limit_nm).into(),
                upper: self.band_end(x, self.friction_limit_nm).into(),
                stable: held.iter().all(|e| e.re < 0.0),
                eigenvalues_per_s: held,
            }
        });
        Equilibrium {
            state: x.into(),
            residual,
            slip_angles_rad: [front, rear],
            stable: eigenvalues_per_s.iter().all(|e| e.re < 0.0),
            eigenvalues_per_s,
            stick_band,
        }
    }

    /// The balance followed from `x` to the torque `limit_nm`, or to where it ends.
    fn band_end(&self, mut x: Vector4<f64>, limit_nm: f64) -> Vector4<f64> {
        for k in 1..=BAND_STEPS {
            let held_nm = limit_nm * f64::from(k) / f64::from(BAND_STEPS);
            match self.newton(x, FrictionMode::Neutral, held_nm) {
                Some((next, _)) => x = next,
                None => break,
            }
        }
        x
    }
}

/// All equilibria of a scenario with slip angles below a right angle, by ascending steering angle.
///
/// Newton's method with the Jacobian of dual numbers from a grid of slip angles of both axles,
/// denser towards zero, each with the yaw rate that its forces balance; duplicates are merged. The
/// residual of each is below 1e-10 (rad/s, rad/s^2).
///
/// # Errors
/// If the scenario is not valid.
///
/// ```
/// let scenario = shared_model::Scenario::reconstruction();
/// let found = dynamics::equilibria::find(&scenario).unwrap();
/// assert!(found.iter().all(|equilibrium| equilibrium.residual < 1e-10));
/// ```
pub fn find(scenario: &Scenario<f64>) -> Result<Vec<Equilibrium>, InvalidScenario> {
    let balance = Balance::new(scenario)?;
    let vehicle = &scenario.vehicle;
    let speed = vehicle.speed_m_per_s(scenario.run.wheel_speed_rpm);
    let slip = |k: i32| {
        let share = f64::from(2 * k) / f64::from(STARTS - 1) - 1.0;
        GREATEST_SLIP_RAD * share * share.abs()
    };
    let start = |front: f64, rear: f64| {
        let straight = Vector4::new(rear, 0.0, rear - front, 0.0);
        let forces = balance.model.cornering_forces(&straight, balance.injection);
        let gamma = (forces.0 + forces.1) / (vehicle.mass_kg * speed);
        let beta = rear + vehicle.rear_axle_distance_m * gamma / speed;
        let delta = beta + vehicle.front_axle_distance_m * gamma / speed - front;
        Vector4::new(beta, gamma, delta, 0.0)
    };
    let mut found: Vec<Equilibrium> = Vec::new();
    for &mode in balance.modes() {
        for (i, j) in (0..STARTS).flat_map(|i| (0..STARTS).map(move |j| (i, j))) {
            let Some((x, residual)) = balance.newton(start(slip(i), slip(j)), mode, 0.0) else {
                continue;
            };
            let (front, rear) = balance.model.slip_angles(&x);
            let drives = front.abs() <= GREATEST_SLIP_RAD && rear.abs() <= GREATEST_SLIP_RAD;
            let known = |e: &Equilibrium| (Vector4::from(e.state) - x).abs().max() < SAME;
            if drives && balance.consistent(&x, mode) && !found.iter().any(known) {
                found.push(balance.equilibrium(x, residual, mode));
            }
        }
    }
    let angle = |e: &Equilibrium| e.state[STEERING_ANGLE];
    found.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    Ok(found)
}

/// A Hopf bifurcation: a pair of eigenvalues of an equilibrium crosses the imaginary axis.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Hopf {
    /// Lower end of the interval of wheel speed that it is located to, rpm.
    pub lower_rpm: f64,
    /// Upper end, rpm.
    pub upper_rpm: f64,
    /// Angular frequency of the oscillation there, rad/s.
    pub frequency_rad_per_s: f64,
    /// The equilibrium loses its stability as the speed rises.
    pub destabilises: bool,
    /// The equilibrium's state at the upper end.
    pub state: [f64; 4],
    /// Its slip angles, which the speed does not change, rad.
    pub slip_angles_rad: [f64; 2],
}

/// The equilibria at each speed. Speeds not begun are left out.
///
/// # Errors
/// If a speed is not valid.
pub fn over_speed(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    control: RunControl,
) -> Result<Vec<(f64, Vec<Equilibrium>)>, SweepError> {
    let scenarios = scenarios(scenario, Parameter::Speed, speeds_rpm)?;
    let at = |scenario: &Scenario<f64>| Ok((scenario.run.wheel_speed_rpm, find(scenario)?));
    control
        .points(&scenarios, at)
        .into_iter()
        .flatten()
        .collect()
}

/// Hopf bifurcations between neighbouring speeds of [`over_speed`], by ascending speed.
///
/// Each equilibrium is followed by Newton's method to the next speed; where the real part of its
/// leading pair changes sign, bisection locates the root to 0.001 rpm. The eigenvalues are those of
/// sliding motion. Coulomb friction with stick hides the bifurcation from small oscillations: they
/// come to rest in the stick band on both sides of it.
///
/// # Errors
/// If a speed is not valid.
pub fn hopf(
    scenario: &Scenario<f64>,
    over_speed: &[(f64, Vec<Equilibrium>)],
) -> Result<Vec<Hopf>, InvalidScenario> {
    let mut found = Vec::new();
    for pair in over_speed.windows(2) {
        for equilibrium in &pair[0].1 {
            found.extend(hopf_between(scenario, equilibrium, pair[0].0, pair[1].0)?);
        }
    }
    found.sort_by(|a, b| a.lower_rpm.total_cmp(&b.lower_rpm));
    Ok(found)
}

fn hopf_between(
    scenario: &Scenario<f64>,
    equilibrium: &Equilibrium,
    mut lower_rpm: f64,
    mut upper_rpm: f64,
) -> Result<Option<Hopf>, InvalidScenario> {
    let follow = |from: &Equilibrium, rpm| followed(scenario, from, rpm);
    let growth = |e: &Equilibrium| e.leading_pair().map(|pair| pair.re);
    let (Some(below), Some(mut above)) = (growth(equilibrium), follow(equilibrium, upper_rpm)?)
    else {
        return Ok(None);
    };
    let crosses = growth(&above).is_some_and(|growth| (growth > 0.0) != (below > 0.0));
    if !crosses {
        return Ok(None);
    }
    while upper_rpm - lower_rpm > HOPF_WIDTH_RPM {
        let middle_rpm = 0.5 * (lower_rpm + upper_rpm);
        let Some(middle) = follow(&above, middle_rpm)? else {
            return Ok(None);
        };
        let Some(growth) = growth(&middle) else {
            return Ok(None);
        };
        if (growth > 0.0) == (below > 0.0) {
            lower_rpm = middle_rpm;
        } else {
            (upper_rpm, above) = (middle_rpm, middle);
        }
    }
    Ok(above.leading_pair().map(|pair| Hopf {
        lower_rpm,
        upper_rpm,
        frequency_rad_per_s: pair.im,
        destabilises: below < 0.0,
        state: above.state,
        slip_angles_rad: above.slip_angles_rad,
    }))
}

/// The same equilibrium at another speed, if Newton's method gets there.
fn followed(
    scenario: &Scenario<f64>,
    from: &Equilibrium,
    rpm: f64,
) -> Result<Option<Equilibrium>, InvalidScenario> {
    let balance = Balance::new(&Parameter::Speed.set(scenario, rpm))?;
    let start = Vector4::from(from.state);
    let mode = balance
        .modes()
        .iter()
        .copied()
        .find(|&mode| balance.consistent(&start, mode));
    let arrived = mode.and_then(|mode| {
        let (x, residual) = balance.newton(start, mode, 0.0)?;
        Some(balance.equilibrium(x, residual, mode))
    });
    Ok(arrived)
}

/// The equilibria at one wheel speed.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Speed {
    /// The speed, rpm.
    pub wheel_speed_rpm: f64,
    /// Its equilibria.
    pub equilibria: Vec<Equilibrium>,
}

/// Eigenvalues in the complex plane at one speed, or branches over several, with their Hopf
/// bifurcations.
pub fn chart(speeds: &[Speed], hopf: &[Hopf]) -> Chart {
    match speeds {
        [speed] => eigenvalue_chart(speed),
        speeds => speed_chart(speeds, hopf),
    }
}

/// The eigenvalues at one speed in the complex plane.
fn eigenvalue_chart(speed: &Speed) -> Chart {
    let series = |label: &str, stable: bool| {
        let chosen = speed.equilibria.iter().filter(move |e| e.stable == stable);
        let all = chosen.flat_map(|e| &e.eigenvalues_per_s);
        let points = all.map(|e| (e.re, e.im)).collect();
        large_dots(label, usize::from(!stable), points)
    };
    let mut all = series("of stable equilibria", true);
    all.extend(series("of unstable equilibria", false));
    Chart {
        heading: format!(
            "Eigenvalues of the equilibria at {} rpm",
            speed.wheel_speed_rpm
        ),
        panels: vec![Panel {
            x: AxisSpec::linear("real part (1/s)"),
            y: AxisSpec::linear("imaginary part (1/s)"),
            series: all,
            instants: vec![(0.0, String::new())],
            ..Panel::default()
        }],
    }
}

fn speed_chart(speeds: &[Speed], hopf: &[Hopf]) -> Chart {
    let all = || {
        let of = |s: &'_ Speed| s.equilibria.iter().map(|e| e.slip_angles_rad).collect();
        speeds.iter().flat_map(of as fn(&Speed) -> Vec<[f64; 2]>)
    };
    let mut branches: Vec<[f64; 2]> = Vec::new();
    for slip in all() {
        let near = |b: &[f64; 2]| (b[0] - slip[0]).hypot(b[1] - slip[1]) < 1e-3;
        if !branches.iter().any(near) {
            branches.push(slip);
        }
    }
    let bifurcating: Vec<_> = hopf.iter().map(|h| h.slip_angles_rad).collect();
    let panel = |caption: &str, y: &str, branches: &[[f64; 2]], of: Quantity| Panel {
        caption: caption.into(),
        x: AxisSpec::linear("wheel speed (rpm)"),
        y: AxisSpec::linear(y),
        series: branches
            .iter()
            .flat_map(|branch| {
                [("stable", true), ("unstable", false)].map(|(label, stable)| Series {
                    label: label.into(),
                    points: branch_points(speeds, branch, stable, of),
                    look: Look::Line(usize::from(!stable)),
                })
            })
            .filter(|series| series.points.iter().any(|point| point.1.is_finite()))
            .collect(),
        instants: hopf
            .iter()
            .map(|h| {
                let rpm = 0.5 * (h.lower_rpm + h.upper_rpm);
                (rpm, format!("Hopf, {rpm:.1}"))
            })
            .collect(),
        ..Panel::default()
    };
    let angle: Quantity = |e| Some(e.state[STEERING_ANGLE]);
    let growth: Quantity = |e| Some(e.leading_pair()?.re);
    let mut panels = vec![panel(
        "steering angle at rest",
        "steering angle (rad)",
        &branches,
        angle,
    )];
    if !hopf.is_empty() {
        let caption = "growth of the pair of eigenvalues that changes stability";
        let mut growths = panel(caption, "real part (1/s)", &bifurcating, growth);
        growths.levels = vec![0.0];
        panels.push(growths);
    }
    Chart {
        heading: "Equilibria over wheel speed".into(),
        panels,
    }
}

/// What a chart shows of an equilibrium.
type Quantity = fn(&Equilibrium) -> Option<f64>;

/// A branch's stable or unstable part over the speed; NaN interrupts the line elsewhere.
fn branch_points(
    speeds: &[Speed],
    branch: &[f64; 2],
    stable: bool,
    of: Quantity,
) -> Vec<(f64, f64)> {
    let value = |speed: &Speed| {
        let mut on = speed.equilibria.iter().filter(|e| e.is_on_branch(branch));
        on.find(|e| e.stable == stable).and_then(of)
    };
    let point = |speed| (speed, f64::NAN);
    speeds
        .iter()
        .map(|s| value(s).map_or(point(s.wheel_speed_rpm), |y| (s.wheel_speed_rpm, y)))
        .collect()
}
