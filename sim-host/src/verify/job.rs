//! The inputs of a verification, its progress, and its errors.

use engine::EarlyEnd;
use image::Image;
use qemu::RunError;
use qemu::telemetry::TelemetryError;
use shared_model::{InvalidScenario, Scenario};
use std::time::Duration;

/// What a verification is to do.
#[derive(Debug, Clone)]
pub struct Options {
    /// The firmware.
    pub image: Image,
    /// Vehicle, road, friction, servo and rates of all runs; their speeds and dithers are the
    /// job's own.
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
        source: Box<pil::mil_sil_pil::LoopError>,
    },
    /// No place for telemetry.
    #[error("cannot make a temporary folder: {0}")]
    Folder(std::io::Error),
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
