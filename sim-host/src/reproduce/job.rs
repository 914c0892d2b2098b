//! The job: its options, its progress and its result.

use super::material::Judgement;
use shared_model::Scenario;

/// Resolution of the sweeps and lengths of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Coarse sweeps and short runs: everything in seconds.
    Quick,
    /// Sufficient to judge the claims.
    Full,
}

/// Options of a reproduction.
#[derive(Debug, Clone)]
pub struct Options {
    /// Resolution and lengths.
    pub quality: Quality,
    /// Preset or vehicle, by name; each is judged separately.
    pub scenarios: Vec<(String, Scenario<f64>)>,
}

/// Progress of a reproduction.
#[derive(Debug, Clone)]
pub enum Progress {
    /// A piece begins.
    Begins {
        /// Its number, from 1.
        number: usize,
        /// The number of pieces.
        of: usize,
        /// Its title.
        title: String,
        /// It is kept from an earlier run.
        kept: bool,
        /// Share of this run's work that is done, from 0 to 1.
        done: f64,
    },
    /// A point of the present piece is done.
    Point,
}

/// Result of a reproduction.
#[derive(Debug)]
pub struct Summary {
    /// All judgements, by claim and preset.
    pub judgements: Vec<Judgement>,
    /// All pieces are complete. Otherwise the user stopped the run; the next run continues.
    pub complete: bool,
}
