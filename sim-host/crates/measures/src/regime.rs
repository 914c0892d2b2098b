//! The regime of a motion, by its period and its largest exponent.

use crate::early_end::{EarlyEnd, Reason};
use crate::exponent::Exponent;
use crate::period::Period;

/// Most bands that are counted.
const MAX_BANDS: usize = 6;
/// Fewest maxima that give a band's extent.
const MAXIMA_PER_BAND: usize = 20;

/// The regime of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The yaw rate varies by less than 1e-6 rad/s.
    Equilibrium,
    /// The maxima of the yaw rate repeat after this many, and the exponent is not positive.
    Periodic(usize),
    /// The maxima do not repeat, and the exponent is positive.
    Chaos,
    /// Chaos whose maxima visit this many separate bands in turn: a diagram shows narrow ones much
    /// as it shows a period.
    BandedChaos(usize),
    /// Maxima and exponent disagree, or the run is too short for one of them.
    Undecided,
    /// The motion leaves all bounds.
    Diverges,
    /// The integrator could not follow the motion.
    NotFollowed(Reason),
}

impl Kind {
    /// Chaos, in however many bands.
    pub fn is_chaotic(self) -> bool {
        matches!(self, Self::Chaos | Self::BandedChaos(_))
    }

    /// The motion has an attractor that was followed to the end of the run.
    pub fn stays(self) -> bool {
        !matches!(self, Self::Diverges | Self::NotFollowed(_))
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Equilibrium => f.write_str("equilibrium"),
            Self::Periodic(maxima) => write!(f, "period-{maxima}"),
            Self::Chaos => f.write_str("chaos"),
            Self::BandedChaos(bands) => write!(f, "{bands}-band chaos"),
            Self::Undecided => f.write_str("undecided"),
            Self::Diverges => f.write_str("diverges"),
            Self::NotFollowed(reason) => write!(f, "{reason}"),
        }
    }
}

impl From<EarlyEnd> for Kind {
    fn from(end: EarlyEnd) -> Self {
        match end.reason {
            Reason::Diverges => Self::Diverges,
            reason => Self::NotFollowed(reason),
        }
    }
}

/// Maxima and exponent must agree.
pub fn kind(
    period: Period,
    exponent: Option<Exponent>,
    with_exponent: bool,
    maxima: &[(f64, f64)],
) -> Kind {
    let positive = exponent.map(|e| e.is_positive());
    match period {
        Period::Equilibrium => Kind::Equilibrium,
        Period::Periodic { maxima, .. } if positive == Some(false) || !with_exponent => {
            Kind::Periodic(maxima)
        }
        Period::Aperiodic { .. } if positive == Some(true) => match bands(maxima) {
            1 => Kind::Chaos,
            bands => Kind::BandedChaos(bands),
        },
        _ => Kind::Undecided,
    }
}

/// The greatest number of bands, up to six, that the maxima visit in turn without any two of them
/// meeting.
fn bands(maxima: &[(f64, f64)]) -> usize {
    let apart = |n: usize| {
        let band = |k: usize| {
            let heights = maxima.iter().skip(k).step_by(n).map(|m| m.1);
            let empty = (f64::INFINITY, f64::NEG_INFINITY);
            heights.fold(empty, |(low, high), h| (h.min(low), h.max(high)))
        };
        let mut bands: Vec<_> = (0..n).map(band).collect();
        bands.sort_by(|a, b| a.0.total_cmp(&b.0));
        bands.windows(2).all(|pair| pair[0].1 < pair[1].0)
    };
    let most = MAX_BANDS.min(maxima.len() / MAXIMA_PER_BAND);
    (2..=most).rev().find(|&n| apart(n)).unwrap_or(1)
}
