//! The main job: the ECU in QEMU and the same model on the host, run side by side and compared.

mod case;
mod checks;
mod in_loop;
mod proofs;
mod suppression;

use crate::report::{DriveReport, Pair, RunReport};
use case::{Outcome, Role};
use engine::EarlyEnd;
use image::Image;
use plot::verdict::{Check, Verdict};
use qemu::RunError;
use qemu::telemetry::TelemetryError;
use rayon::prelude::*;
use shared_model::{InvalidScenario, Scenario};
use std::time::Duration;

/// What a verification is to do.
#[derive(Debug, Clone)]
pub struct Options {
    /// The firmware.
    pub image: Image,
    /// The same compiled with the functions' frames, for the worst stack; or why there is none.
    pub framed_image: Result<Image, String>,
    /// Vehicle, road, friction, servo and rates of all runs; their speeds and dithers are the job's own.
    pub base: Scenario<f64>,
    /// Length of each main run on the target, s.
    pub duration_s: f64,
    /// Longest time that one run of the emulator may take.
    pub time_out: Duration,
}

/// Why a verification could not be made.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// A scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] InvalidScenario),
    /// The motion leaves all bounds, so there is nothing to compare.
    #[error("{title}: {end}; there is no attractor to compare on")]
    EndsEarly {
        /// The run.
        title: String,
        /// When and why.
        end: EarlyEnd,
    },
    /// The user asked to stop.
    #[error("interrupted; no report was written")]
    Interrupted,
    /// The emulator or the firmware did not end as it should.
    #[error("{title}: {source}")]
    Run {
        /// The run.
        title: String,
        /// Why.
        source: RunError,
    },
    /// The firmware ended with an exit code that leaves nothing to compare.
    #[error(
        "{title}: the firmware ended with exit code {exit_code}: {meaning}; its last log line: {last_line}"
    )]
    Firmware {
        /// The run.
        title: String,
        /// Its exit code.
        exit_code: i32,
        /// What that means.
        meaning: &'static str,
        /// What it said last.
        last_line: String,
    },
    /// The telemetry is damaged or incomplete.
    #[error("{title}: {source}")]
    Telemetry {
        /// The run.
        title: String,
        /// Why.
        source: TelemetryError,
    },
    /// A manoeuvre could not be driven.
    #[error("{title}: {source}")]
    InLoop {
        /// The manoeuvre.
        title: String,
        /// Why.
        source: Box<pil::levels::LevelError>,
    },
    /// No place for telemetry.
    #[error("cannot make a temporary folder: {0}")]
    Folder(std::io::Error),
}

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

/// How far a verification is.
#[derive(Debug, Clone)]
pub enum Progress {
    /// A run has begun; that many simulated seconds are to come.
    Planned(f64),
    /// That many simulated seconds have been done since the last report.
    Simulated(f64),
    /// A run is complete and analysed.
    Done(String),
}

/// Runs all cases, as many at a time as there are threads, and checks them.
///
/// # Errors
/// If a run cannot be made or its telemetry cannot be used. A firmware that differs from the host is no error but a
/// failed check.
pub fn verify(
    options: &Options,
    on_progress: impl Fn(Progress) + Sync,
) -> Result<Verification, VerifyError> {
    let cases = case::all(options);
    for case in &cases {
        on_progress(Progress::Planned(case.scenario.run.duration_s));
    }
    let outcomes: Vec<Outcome> = cases
        .into_par_iter()
        // One at a time from the list's start, so that the long runs do not end up behind each other.
        .with_max_len(1)
        .map(|case| {
            let outcome = case::run(case, options, &on_progress)?;
            on_progress(Progress::Done(outcome.summary()));
            Ok(outcome)
        })
        .collect::<Result<_, VerifyError>>()?;

    let mut checks: Vec<Check> = Vec::new();
    for outcome in &outcomes {
        checks.extend(checks::of(outcome));
    }
    checks.extend(suppression::checks(&outcomes));
    let (in_loop, drives) = in_loop::run(options, &on_progress)?;
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

/// The outcome with the given role.
fn find(outcomes: &[Outcome], role: Role) -> Option<(usize, &Outcome)> {
    outcomes
        .iter()
        .enumerate()
        .find(|(_, outcome)| outcome.case.role == role)
}
