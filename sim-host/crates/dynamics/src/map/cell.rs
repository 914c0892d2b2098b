//! What is found in a cell of the map.

use super::plan::{Place, Plan, Start};
use crate::attractor;
use crate::lyapunov::largest_of;
use crate::observe::follow;
use crate::period::{Period, TOLERANCE, maxima_of_turns, period_of_maxima};
use crate::sweep::Timing;
use engine::Reason;
use engine::taylor::{Observables, Trajectory, Unsupported};
use measures::regime::kind;
use serde::{Deserialize, Serialize};
use shared_model::dither::Waveform;
use shared_model::vehicle::{STEERING_ANGLE, YAW_RATE};

/// The kind of a motion, as [`attractor::Kind`] without its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// At rest.
    Equilibrium,
    /// The maxima of the yaw rate repeat, and the exponent is not positive.
    Periodic,
    /// They do not, and it is.
    Chaos,
    /// Maxima and exponent disagree, or the run is too short for one of them.
    Undecided,
    /// The motion leaves all bounds.
    Diverges,
}

impl From<attractor::Kind> for Kind {
    fn from(kind: attractor::Kind) -> Self {
        match kind {
            attractor::Kind::Equilibrium => Self::Equilibrium,
            attractor::Kind::Periodic(_) => Self::Periodic,
            attractor::Kind::Chaos | attractor::Kind::BandedChaos(_) => Self::Chaos,
            attractor::Kind::Undecided | attractor::Kind::NotFollowed(_) => Self::Undecided,
            attractor::Kind::Diverges => Self::Diverges,
        }
    }
}

/// A cell of the map, a row of its table. What a motion that diverges does not have is left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The dither's waveform.
    pub waveform: Waveform,
    /// Where the motion starts.
    pub start: Start,
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Dither amplitude W, V.
    pub dither_amplitude_v: f64,
    /// Kind of the motion.
    pub kind: Kind,
    /// Maxima of the yaw rate in a cycle, whatever the exponent says; 0 at rest, none without a
    /// cycle.
    pub period: Option<u32>,
    /// Bands that the maxima of a chaotic motion visit in turn.
    pub bands: Option<u32>,
    /// Largest Lyapunov exponent, 1/s.
    pub exponent_per_s: Option<f64>,
    /// Its standard error, 1/s.
    pub exponent_standard_error_per_s: Option<f64>,
    /// What it must exceed to count as positive, 1/s.
    pub exponent_threshold_per_s: Option<f64>,
    /// Greatest yaw rate less the least, rad/s.
    pub yaw_rate_peak_to_peak_rad_per_s: Option<f64>,
    /// Greatest steering angle less the least, rad.
    pub steering_angle_peak_to_peak_rad: Option<f64>,
    /// When the motion left all bounds, s from the start.
    pub diverges_at_s: Option<f64>,
}

impl Cell {
    /// Where it lies.
    pub fn place(&self) -> Place {
        Place {
            waveform: self.waveform,
            start: self.start,
            wheel_speed_rpm: self.wheel_speed_rpm,
            dither_amplitude_v: self.dither_amplitude_v,
        }
    }

    /// Checks a cell that comes from outside.
    ///
    /// # Errors
    /// The column with a value that no cell has.
    pub fn validate(&self) -> Result<(), InvalidCell> {
        let signed = [("exponent_per_s", self.exponent_per_s)];
        let magnitudes = [
            (
                "exponent_standard_error_per_s",
                self.exponent_standard_error_per_s,
            ),
            ("exponent_threshold_per_s", self.exponent_threshold_per_s),
            (
                "yaw_rate_peak_to_peak_rad_per_s",
                self.yaw_rate_peak_to_peak_rad_per_s,
            ),
            (
                "steering_angle_peak_to_peak_rad",
                self.steering_angle_peak_to_peak_rad,
            ),
            ("diverges_at_s", self.diverges_at_s),
        ];
        let is_bad = |&(_, value): &(_, f64), least| value.is_nan() || value < least;
        let given = |(column, value): (_, Option<f64>)| Some((column, value?));
        let mut signed = signed.into_iter().filter_map(given);
        let mut magnitudes = magnitudes.into_iter().filter_map(given);
        let bad = signed.find(|number| is_bad(number, f64::NEG_INFINITY));
        let bad = bad.or_else(|| magnitudes.find(|number| is_bad(number, 0.0)));
        if let Some((column, value)) = bad {
            return Err(InvalidCell::Number { column, value });
        }
        if (self.kind == Kind::Diverges) != self.diverges_at_s.is_some() {
            return Err(InvalidCell::Divergence);
        }
        Ok(())
    }
}

/// Why a cell is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidCell {
    /// A number that a motion cannot have.
    #[error("{column} = {value}: must be a number, and at least 0 unless it is an exponent")]
    Number {
        /// The column.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// The kind and the time of a divergence contradict each other.
    #[error("diverges_at_s must be there if the kind is diverges, and only then")]
    Divergence,
}

/// The cells at some places of a plan.
///
/// Trajectories run through their transients without tangent vectors. The exponent is taken over
/// what follows but for its first tenth.
///
/// # Errors
/// If a place's scenario is not valid, or none for the engine.
///
/// ```
/// use dynamics::map::cell::{Kind, cells};
/// use dynamics::map::plan::{Grid, Plan, Sheet, Start};
/// use dynamics::sweep::Timing;
/// use shared_model::dither::Waveform;
///
/// let grid = |from, to| Grid { from, to, count: 2 };
/// let sheet = Sheet { waveform: Waveform::Square, start: Start::Given, amplitudes_v: grid(0.0, 0.1) };
/// let scenario = shared_model::Scenario::reconstruction();
/// let plan = Plan::new(scenario, vec![sheet], grid(1600.0, 1750.0), Timing::new(200.0, 400.0)?)?;
/// let found = cells(&plan, &plan.places(0))?;
/// let at = |rpm, volts| {
///     let is_it = |cell: &&dynamics::map::cell::Cell| cell.wheel_speed_rpm == rpm && cell.dither_amplitude_v == volts;
///     found.iter().find(is_it).unwrap().kind
/// };
/// // Chaos at 1750 rpm, which dither ends.
/// assert_eq!((at(1750.0, 0.0), at(1750.0, 0.1)), (Kind::Chaos, Kind::Periodic));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn cells(plan: &Plan, places: &[Place]) -> Result<Vec<Cell>, Unsupported> {
    let scenarios: Vec<_> = places.iter().map(|place| plan.motion(place)).collect();
    let timing = Timing {
        transient_s: plan.transient_s,
        observed_s: plan.observed_s,
    };
    let mut observables = Observables::default();
    observables.turns[YAW_RATE] = true;
    observables.turns[STEERING_ANGLE] = true;
    let found = follow::<1>(&scenarios, timing, observables)?;
    let cell = |(place, found): (&Place, &Trajectory<1>)| match found.early_end {
        Some(end) if end.reason == Reason::Diverges => diverging(place, end.time_s),
        Some(_) => Cell {
            kind: Kind::Undecided,
            diverges_at_s: None,
            ..diverging(place, 0.0)
        },
        None => staying(place, plan, found),
    };
    Ok(places.iter().zip(&found).map(cell).collect())
}

fn diverging(place: &Place, time_s: f64) -> Cell {
    Cell {
        waveform: place.waveform,
        start: place.start,
        wheel_speed_rpm: place.wheel_speed_rpm,
        dither_amplitude_v: place.dither_amplitude_v,
        kind: Kind::Diverges,
        period: None,
        bands: None,
        exponent_per_s: None,
        exponent_standard_error_per_s: None,
        exponent_threshold_per_s: None,
        yaw_rate_peak_to_peak_rad_per_s: None,
        steering_angle_peak_to_peak_rad: None,
        diverges_at_s: Some(time_s),
    }
}

fn staying(place: &Place, plan: &Plan, found: &Trajectory<1>) -> Cell {
    let range = |component: usize| found.upper[component] - found.lower[component];
    let maxima = maxima_of_turns(&found.turns[YAW_RATE], range(YAW_RATE));
    let period = period_of_maxima(&maxima, range(YAW_RATE), TOLERANCE);
    let exponent = largest_of(found, &maxima, plan.observed_s);
    let kind = kind(period, exponent, true, &maxima);
    Cell {
        kind: kind.into(),
        period: match period {
            Period::Equilibrium => Some(0),
            Period::Periodic { maxima, .. } => Some(maxima as u32),
            Period::Aperiodic { .. } | Period::TooShort { .. } => None,
        },
        bands: match kind {
            attractor::Kind::Chaos => Some(1),
            attractor::Kind::BandedChaos(bands) => Some(bands as u32),
            _ => None,
        },
        exponent_per_s: exponent.map(|e| e.per_s),
        exponent_standard_error_per_s: exponent.map(|e| e.standard_error_per_s),
        exponent_threshold_per_s: exponent.map(|e| e.threshold_per_s()),
        yaw_rate_peak_to_peak_rad_per_s: Some(range(YAW_RATE)),
        steering_angle_peak_to_peak_rad: Some(range(STEERING_ANGLE)),
        diverges_at_s: None,
        ..diverging(place, 0.0)
    }
}
