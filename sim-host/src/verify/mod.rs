//! The main job: the ECU in QEMU and the same model on the host, run side by side and compared.

mod case;
mod checks;
mod feedback;
mod in_loop;
mod job;
mod proofs;
mod suppression;

use crate::report::{DriveReport, Pair, RunReport};
use case::Outcome;

pub use job::{Options, Progress, VerifyError};
use plot::verdict::{Check, Verdict};
use rayon::prelude::*;

/// A verification's results, ready to be reported.
#[derive(Debug)]
pub struct Verification {
    /// All checks.
    pub verdict: Verdict,
    /// What the figures show.
    pub runs: Vec<RunReport>,
    /// Runs before and after dither.
    pub pairs: Vec<Pair>,
    /// Manoeuvres with the ECU in the loop.
    pub drives: Vec<DriveReport>,
    /// Facts about image and runs.
    pub notes: Vec<(String, String)>,
}

/// Runs all cases, as many at a time as there are threads, and checks them.
///
/// # Errors
/// If a run cannot be made or its telemetry cannot be used. A firmware that differs from the host
/// is no error but a failed check.
pub fn verify(
    options: &Options,
    on_progress: impl Fn(Progress) + Sync,
) -> Result<Verification, VerifyError> {
    let cases = case::all(options);
    for case in &cases {
        on_progress(Progress::Planned(case.scenario.run.duration_s));
    }
    let in_open_loop = || {
        cases
            .into_par_iter()
            // One at a time from the list's start, so that the long runs do not end up behind each
            // other.
            .with_max_len(1)
            .map(|case| {
                let outcome = case::run(case, options, &on_progress)?;
                on_progress(Progress::Done(outcome.summary()));
                Ok(outcome)
            })
            .collect::<Result<Vec<Outcome>, VerifyError>>()
    };
    // At the same time, so that no thread is idle while the last run of one part ends.
    let (outcomes, in_loop) = rayon::join(in_open_loop, || in_loop::run(options, &on_progress));
    let outcomes = outcomes?;

    let mut checks: Vec<Check> = Vec::new();
    for outcome in &outcomes {
        checks.extend(checks::of(outcome));
    }
    checks.extend(suppression::checks(&outcomes));
    let (in_loop, drives) = in_loop?;
    checks.extend(in_loop);
    checks.extend(checks::resources(&options.image, &outcomes));
    checks.extend(proofs::stack(options, &outcomes));
    Ok(Verification {
        verdict: Verdict::over(checks),
        pairs: suppression::pairs(&outcomes),
        drives,
        notes: checks::notes(&options.image, &outcomes),
        runs: outcomes.iter().map(Outcome::report).collect(),
    })
}
