//! What is found in a cell of the map.

use super::plan::{Place, Plan, Start};
use crate::chaos::attractor::{self, kind};
use crate::chaos::lyapunov::{Exponent, PIECES, WARM_UP};
use crate::chaos::period::{Period, TOLERANCE, maxima_of_turns, period_of_maxima};
use crate::engine::taylor::{Found, Growths, Motions, Span, Unfit, Watched};
use serde::{Deserialize, Serialize};
use shared_model::dither::Waveform;
use shared_model::vehicle::{STEERING_ANGLE, YAW_RATE};

/// Largest last term of a step's expansion, in rad and rad/s: that of the other analyses, so that a cell shows the very motion that
/// they find there. Where a chaotic transient ends by chance, another tolerance would end it elsewhere.
const TOLERANCE_OF_STEP: f64 = 1e-10;

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
            attractor::Kind::Undecided => Self::Undecided,
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
    /// Maxima of the yaw rate in a cycle, whatever the exponent says; 0 at rest, none without a cycle.
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
}

/// The cells at some places of a plan.
///
/// Motions run through their transients without tangent vectors. The exponent is taken over what follows but for its first tenth.
///
/// # Errors
/// If a place's scenario is not valid, or none for the engine.
pub fn cells(plan: &Plan, places: &[Place]) -> Result<Vec<Cell>, Unfit> {
    let scenarios: Vec<_> = places.iter().map(|place| plan.motion(place)).collect();
    let mut motions = Motions::new(&scenarios)?;
    let transient = Span {
        time_s: plan.transient_s,
        tolerance: TOLERANCE_OF_STEP,
        watched: Watched::default(),
        warm_up_s: 0.0,
        pieces: 0,
    };
    let settled = motions.follow::<0>(&transient);
    motions.go_on_from(&settled);
    let mut watched = Watched::default();
    watched.turns[YAW_RATE] = true;
    watched.turns[STEERING_ANGLE] = true;
    let observed = Span {
        time_s: plan.observed_s,
        watched,
        warm_up_s: WARM_UP * plan.observed_s,
        pieces: PIECES,
        ..transient
    };
    let found = motions.follow::<1>(&observed);
    let cell = |((place, settled), found): ((&Place, &Found<0>), &Found<1>)| {
        let later = |time_s| plan.transient_s + time_s;
        let diverges_at_s = match (settled.diverged, found.diverged) {
            (Some(diverged), _) => Some(diverged.time_s),
            (None, diverged) => diverged.map(|d| later(d.time_s)),
        };
        match diverges_at_s {
            Some(time_s) => diverging(place, time_s),
            None => staying(place, plan, found),
        }
    };
    Ok(places.iter().zip(&settled).zip(&found).map(cell).collect())
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

fn staying(place: &Place, plan: &Plan, found: &Found<1>) -> Cell {
    let range = |component: usize| found.upper[component] - found.lower[component];
    let maxima = maxima_of_turns(&found.turns[YAW_RATE], range(YAW_RATE));
    let period = period_of_maxima(&maxima, range(YAW_RATE), TOLERANCE);
    let exponent = exponent(&found.growths, (1.0 - WARM_UP) * plan.observed_s);
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

/// The exponent from pieces of equal time, `time_s` together; none where the tangent vector has no length left.
fn exponent(growths: &[Growths<1>], time_s: f64) -> Option<Exponent> {
    let piece_s = time_s / growths.len() as f64;
    let pieces: Vec<_> = growths.iter().map(|&[growth]| (growth, piece_s)).collect();
    let exponent = Exponent::from_pieces(&pieces);
    exponent.per_s.is_finite().then_some(exponent)
}
