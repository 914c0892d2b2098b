//! What a motion ends on, and whether two motions end on the same.

use crate::equilibria::Equilibrium;
use crate::lyapunov::largest_of;
use crate::observe::{is_supported, observe};
use crate::period::{Period, TOLERANCE, maxima_of_turns, period_of_maxima};
use crate::settled::{Settled, settled};
use crate::sweep::{RunControl, Timing};
use engine::EarlyEnd;
use engine::taylor::{Observables, Trajectory};
pub use measures::regime::Kind;
use measures::regime::kind;
use shared_model::vehicle::{STEERING_ANGLE, State, YAW_RATE};
use shared_model::{InvalidScenario, Scenario};

/// Share of their joint extent that two motions' extents must have in common to be of the same
/// attractor.
const COMMON_PERIODIC: f64 = 0.97;
/// The same for chaotic motions, whose extents are those of a finite time.
const COMMON_CHAOTIC: f64 = 0.8;
/// Difference of maxima one cycle apart, as a share of the yaw rate's range, beyond which a trajectory has
/// not settled.
const UNSETTLED: f64 = 1e-6;
/// Distance within which two states of rest are the same, in each component (rad and rad/s).
const SAME_REST: f64 = 1e-4;

/// What a motion does behind its transient.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Attractor {
    /// Its kind.
    pub kind: Kind,
    /// Greatest difference of maxima one cycle apart, over the yaw rate's range: the period's
    /// uncertainty. Of a motion without a period, the least over the periods tried.
    pub residual: Option<f64>,
    /// Time after which the maxima repeat, s.
    pub cycle_s: Option<f64>,
    /// Cycles in that time, by rises of the yaw rate through the middle of its range: the period on a
    /// Poincaré section, which is what bifurcates. The maxima change their number without it.
    pub cycles: Option<usize>,
    /// Largest Lyapunov exponent, 1/s, where it was asked for and the run is long enough.
    pub exponent_per_s: Option<f64>,
    /// What the exponent must exceed to count as positive, 1/s.
    pub exponent_threshold_per_s: Option<f64>,
    /// Maxima of the yaw rate, rad/s, descending: those of one cycle, or all where there is none.
    pub maxima_rad_per_s: Vec<f64>,
    /// Least value of each component of the state.
    pub lower: [f64; 4],
    /// Greatest value of each component of the state.
    pub upper: [f64; 4],
    /// The state at the end.
    pub end: [f64; 4],
    /// When the motion left all bounds, s.
    pub diverges_at_s: Option<f64>,
}

impl Attractor {
    fn ending_early(early: EarlyEnd, end: &State<f64>) -> Self {
        let kind = Kind::from(early);
        Self {
            diverges_at_s: (kind == Kind::Diverges).then_some(early.time_s),
            ..Self::at(kind, end.x.into())
        }
    }

    /// In one state.
    fn at(kind: Kind, state: [f64; 4]) -> Self {
        Self {
            kind,
            residual: None,
            cycle_s: None,
            cycles: None,
            exponent_per_s: None,
            exponent_threshold_per_s: None,
            maxima_rad_per_s: Vec::new(),
            lower: state,
            upper: state,
            end: state,
            diverges_at_s: None,
        }
    }

    /// Of what is found of a motion; with an exponent if there is a tangent vector.
    fn of<const K: usize>(found: &Trajectory<K>, timing: Timing) -> Self {
        if let Some(early) = found.early_end {
            return Self::ending_early(early, &found.end);
        }
        let range = found.upper[YAW_RATE] - found.lower[YAW_RATE];
        let maxima = maxima_of_turns(&found.turns[YAW_RATE], range);
        let period = period_of_maxima(&maxima, range, TOLERANCE);
        let largest = largest_of(found, &maxima, timing.observed_s);
        let exponent = largest.filter(|_| period != Period::Equilibrium);
        let (residual, cycle_s) = match period {
            Period::Periodic {
                residual, time_s, ..
            } => (Some(residual), Some(time_s)),
            Period::Aperiodic { residual } => (Some(residual), None),
            Period::Equilibrium | Period::TooShort { .. } => (None, None),
        };
        let in_cycle = period.maxima().unwrap_or(maxima.len());
        let mut heights: Vec<f64> = maxima.iter().take(in_cycle).map(|m| m.1).collect();
        heights.sort_by(|a, b| b.total_cmp(a));
        Self {
            kind: kind(period, exponent, K > 0, &maxima),
            residual,
            cycle_s,
            cycles: cycle_s.and_then(|cycle_s| cycles(&found.turns[YAW_RATE], cycle_s)),
            exponent_per_s: exponent.map(|e| e.per_s),
            exponent_threshold_per_s: exponent.map(|e| e.threshold_per_s()),
            maxima_rad_per_s: heights,
            lower: found.lower,
            upper: found.upper,
            end: found.end.x.into(),
            diverges_at_s: None,
        }
    }

    /// The same, or what Newton's method finds beside a trajectory that has not settled.
    pub(crate) fn decided(mut self, scenario: &Scenario<f64>) -> Self {
        let is_doubtful = match self.kind {
            Kind::Undecided => true,
            Kind::Periodic(_) => self.residual.is_some_and(|residual| residual > UNSETTLED),
            _ => false,
        };
        // Where friction has modes in which trajectories slide, there is no engine and no shooting.
        if !is_doubtful || !is_supported(scenario).is_ok_and(|supported| supported) {
            return self;
        }
        match settled(scenario, &self.end) {
            Some(Settled::Orbit(orbit)) => {
                self.kind = Kind::Periodic(orbit.prominent_maxima_rad_per_s.len());
                self.residual = Some(0.0);
                self.cycle_s = Some(orbit.period_s);
                self.cycles = Some(orbit.cycles);
                self.maxima_rad_per_s = orbit.prominent_maxima_rad_per_s;
                self.end = orbit.state;
            }
            Some(Settled::Equilibrium(state)) => self = Self::at(Kind::Equilibrium, state),
            // It alternates, but leaves the orbit beside it.
            None => self.kind = Kind::Undecided,
        }
        self
    }

    /// The side of the steering angle on which it lies.
    pub fn lobe(&self) -> &'static str {
        match (self.lower[STEERING_ANGLE], self.upper[STEERING_ANGLE]) {
            (low, _) if low > 0.0 => "positive",
            (_, high) if high < 0.0 => "negative",
            _ => "both",
        }
    }

    /// Least and greatest yaw rate, rad/s.
    pub fn yaw_rates_rad_per_s(&self) -> (f64, f64) {
        (self.lower[YAW_RATE], self.upper[YAW_RATE])
    }

    /// The two are the same attractor: of the same kind, and at rest within 1e-4 of each other or
    /// in the stick band of the same of the `equilibria`; in motion with extents in every
    /// component that have 97 % in common, 80 % without a period. Trajectories that diverge are
    /// the same, and those that could not be followed for the same reason.
    pub(crate) fn is_same(&self, other: &Self, equilibria: &[Equilibrium]) -> bool {
        if self.kind != other.kind {
            return false;
        }
        let common = match self.kind {
            Kind::Diverges | Kind::NotFollowed(_) => return true,
            Kind::Equilibrium => {
                let apart = self.end.iter().zip(&other.end).map(|(a, b)| (a - b).abs());
                let both = |e: &Equilibrium| e.holds(&self.end) && e.holds(&other.end);
                return apart.fold(0.0, f64::max) < SAME_REST || equilibria.iter().any(both);
            }
            Kind::Periodic(_) => COMMON_PERIODIC,
            Kind::Chaos | Kind::BandedChaos(_) | Kind::Undecided => COMMON_CHAOTIC,
        };
        (0..4).all(|k| {
            let joint = self.upper[k].max(other.upper[k]) - self.lower[k].min(other.lower[k]);
            let shared = self.upper[k].min(other.upper[k]) - self.lower[k].max(other.lower[k]);
            shared >= common * joint
        })
    }
}

/// Follows the scenarios' motions through their transients and says what they end on. Results are
/// in the scenarios' order; motions that were not begun have none.
///
/// The period is that of the yaw rate's maxima over the time observed, to 0.2 % of its range. If
/// `with_exponent`, the largest Lyapunov exponent has to agree, positive only where there is no
/// period; else a motion without period stays undecided, and one with period is taken as such.
///
/// # Errors
/// If a scenario is not valid.
pub fn attractors(
    scenarios: &[Scenario<f64>],
    timing: Timing,
    with_exponent: bool,
    control: RunControl,
) -> Result<Vec<Option<Attractor>>, InvalidScenario> {
    let observables = Observables {
        turns: [true; 4],
        section: None,
    };
    if with_exponent {
        let see = |_: &_, found: &Trajectory<1>| Attractor::of(found, timing);
        observe(scenarios, timing, observables, control, see)
    } else {
        let see = |_: &_, found: &Trajectory<0>| Attractor::of(found, timing);
        observe(scenarios, timing, observables, control, see)
    }
}

/// What the motion of one scenario ends on; as [`attractors`].
///
/// # Errors
/// If the scenario is not valid.
///
/// ```
/// use dynamics::attractor::{Kind, attractor};
/// use dynamics::sweep::Timing;
///
/// let mut scenario = shared_model::Scenario::reconstruction();
/// scenario.run.wheel_speed_rpm = 1600.0;
/// let attractor = attractor(&scenario, Timing::new(100.0, 200.0)?, true)?;
/// assert_eq!(attractor.kind, Kind::Periodic(2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn attractor(
    scenario: &Scenario<f64>,
    timing: Timing,
    with_exponent: bool,
) -> Result<Attractor, InvalidScenario> {
    let one = std::slice::from_ref(scenario);
    let mut found = attractors(one, timing, with_exponent, RunControl::none())?;
    Ok(found.pop().flatten().expect("nobody stops it"))
}

/// Cycles in the time after which maxima repeat, by a quantity's turning points (time in s, value).
fn cycles(turns: &[(f64, f64)], cycle_s: f64) -> Option<usize> {
    let heights = || turns.iter().map(|turn| turn.1);
    let low = heights().fold(f64::INFINITY, f64::min);
    let high = heights().fold(f64::NEG_INFINITY, f64::max);
    let middle = 0.5 * (low + high);
    let rises = turns
        .windows(2)
        .filter(|pair| pair[0].1 < middle && pair[1].1 >= middle);
    let time_s = turns.last()?.0 - turns.first()?.0;
    Some((rises.count() as f64 * cycle_s / time_s).round() as usize)
}

impl Attractor {
    /// Kind and place, for people.
    pub fn describe(&self) -> String {
        let kind = self.kind;
        match kind {
            Kind::Diverges | Kind::NotFollowed(_) => kind.to_string(),
            Kind::Equilibrium => {
                let [beta, _, delta, _] = self.end;
                format!("{kind} near beta {beta:.3}, delta_f {delta:.3} rad")
            }
            _ => {
                let (low, high) = self.yaw_rates_rad_per_s();
                let lobe = self.lobe();
                format!("{kind}, yaw rate {low:.2} to {high:.2} rad/s, steering angle {lobe}")
            }
        }
    }
}
