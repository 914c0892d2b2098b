//! The job: its options, its progress and its result.

use super::material::Judgement;
use shared_model::Scenario;

/// How finely to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Coarse sweeps and short runs: a look at everything in seconds.
    Quick,
    /// As the claims need.
    Full,
}

/// What to reproduce, and how.
#[derive(Debug, Clone)]
pub struct Options {
    /// How finely to look.
    pub quality: Quality,
    /// Preset or vehicle, by name; each is judged by itself.
    pub scenarios: Vec<(String, Scenario<f64>)>,
}

/// How far the reproduction is.
#[derive(Debug, Clone)]
pub enum Progress {
    /// That piece of so many begins.
    Begins {
        /// Its number, from 1.
        number: usize,
        /// How many there are.
        of: usize,
        /// What it is.
        title: String,
        /// It was made by an earlier run and is kept.
        kept: bool,
        /// Share of this run's work that is done, from 0 to 1.
        done: f64,
    },
    /// A point of the present piece is done.
    Point,
}

/// What came out.
#[derive(Debug)]
pub struct Summary {
    /// All judgements, by claim and preset.
    pub judgements: Vec<Judgement>,
    /// Everything was made; otherwise the user has stopped it, and another run goes on from here.
    pub complete: bool,
}
