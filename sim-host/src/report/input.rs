//! The contents of a report: checks, runs on the ECU, manoeuvres, recorded texts.

use dynamics::trace::Trace;
use pil::closed_loop::Run;
use pil::instructions::Instructions;
use plot::verdict::Verdict;

/// One run on the ECU.
#[derive(Debug, Clone)]
pub struct RunReport {
    /// Name for file names: lower case, digits and hyphens.
    pub id: String,
    /// Name for people, for instance `1750 rpm, square dither 0.1 V`.
    pub title: String,
    /// The firmware's telemetry.
    pub trace: Trace,
    /// Time at which the dither starts, s; none without dither.
    pub dither_start_s: Option<f64>,
    /// Volts of a duty code: (code - period/2) times this.
    pub volts_per_count: f64,
    /// Time (s) and defect of each step over its bound (at most 1 passes): host f64 step from the
    /// firmware's state.
    pub one_step_defect: Vec<(f64, f64)>,
    /// Time (s) and distance of free f32 and f64 runs, relative to the attractor's size.
    pub divergence: Vec<(f64, f64)>,
    /// Predicted time of their separation, s: least, expected, greatest; none where they must stay
    /// together.
    pub horizon_s: Option<[f64; 3]>,
    /// Distance that counts as separation, or that must not be reached.
    pub divergence_limit: f64,
    /// Instructions of its tasks.
    pub instructions: Instructions,
}

/// Two runs that differ only in the dither.
#[derive(Debug, Clone)]
pub struct Pair {
    /// Name for people, for instance `1750 rpm: no dither against square dither 0.1 V`.
    pub title: String,
    /// Index of the run without dither.
    pub before: usize,
    /// Index of the run with dither.
    pub after: usize,
}

/// A manoeuvre with the ECU in the loop.
#[derive(Debug, Clone)]
pub struct DriveReport {
    /// Name for file names: lower case, digits and hyphens.
    pub id: String,
    /// Name for people.
    pub title: String,
    /// The firmware's run.
    pub run: Run,
    /// Instructions of its tasks.
    pub instructions: Instructions,
}

/// The contents of a report.
#[derive(Debug, Clone, Copy)]
pub struct ReportInput<'a> {
    /// Heading of the page and name of the test suite.
    pub title: &'a str,
    /// The checks.
    pub verdict: &'a Verdict,
    /// The runs on the ECU. Check ids name them after the `/`.
    pub runs: &'a [RunReport],
    /// The runs to be shown before and after.
    pub pairs: &'a [Pair],
    /// Manoeuvres with the ECU in the loop.
    pub drives: &'a [DriveReport],
    /// Name and text of recorded proofs about the firmware.
    pub proofs: &'a [(String, String)],
    /// Name and value of further facts: memory use, toolchain, revision.
    pub notes: &'a [(String, String)],
}
