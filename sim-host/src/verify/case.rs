//! The cases of a verification: which runs there are, and what is measured of each.

use super::job::{Options, Progress, VerifyError};
use crate::report::RunReport;
use dynamics::lyapunov::{self, Exponent};
use dynamics::period::{Period, RIPPLE_TOLERANCE, TOLERANCE, period};
use dynamics::simulate::{Unsettled, early_end, settle, simulate, started_at};
use dynamics::trace::Trace;
use pil::equivalence::{self, Bits, OneStep, trace_of};
use pil::instructions::Instructions;
use qemu::settings;
use qemu::telemetry::Recording;
use qemu::{self, Finished, Machine, RunError};
use shared_model::Scenario;
use shared_model::dither::{Application, Waveform};
use shared_model::servo::Pwm;
use shared_model::telemetry::record_len;
use std::path::Path;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

/// Free f32 and f64 runs of a periodic motion never get this far apart, over the attractor's size:
/// a hundredth of what counts as parted.
pub(super) const NEVER_PART: f64 = 1e-3;

/// Transient of the paper's start before a run begins, s.
const TRANSIENT_S: f64 = 200.0;
/// Transient after the dither has set in, s.
pub(super) const DITHER_TRANSIENT_S: f64 = 20.0;
/// Length of the host's run that gives the motion's invariants, s.
const LONG_RUN_S: f64 = 600.0;
/// Greatest length of runs that are not compared on all levels, s.
const SIGNAL_RUN_S: f64 = 40.0;
const SECOND_CORE_RUN_S: f64 = 10.0;
/// Length of the runs that measure timing, after the start of the dither, s.
const TIMING_RUN_S: f64 = 2.0;
const TELEMETRY: &str = "telemetry.bin";
/// How often the progress of a run is looked at.
const PROGRESS_POLL: Duration = Duration::from_millis(200);

/// What a case is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// 1750 rpm without dither: chaos.
    Chaos,
    /// 1750 rpm with a dither, averaged.
    Dithered(Waveform),
    /// One speed of another region.
    Region,
    /// 1750 rpm with the dither as a true signal.
    Signal(Waveform),
    /// The other core.
    SecondCore,
}

/// What the paper says of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Expected {
    /// A positive largest exponent.
    Chaos,
    /// That many maxima of the yaw rate in a cycle.
    Period(usize),
}

/// One run.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) id: String,
    pub(super) title: String,
    pub(super) role: Role,
    pub(super) expected: Expected,
    pub(super) machine: Machine,
    /// In f64; the firmware gets it rounded.
    pub(super) scenario: Scenario<f64>,
}

/// A case with all that was measured.
#[derive(Debug)]
pub(super) struct Outcome {
    pub(super) case: Case,
    pub(super) recording: Recording,
    pub(super) log: Vec<String>,
    /// A short run at the pace of the board's timer, which measures timing; the main run is at the
    /// host's pace.
    pub(super) timing: Recording,
    pub(super) timing_log: Vec<String>,
    /// Words of the timing run that differ from the main run, and words that are compared.
    pub(super) pace: Bits,
    pub(super) firmware: Trace,
    /// Index of the first state after the transient of the dither.
    pub(super) settled: usize,
    pub(super) bits: Bits,
    /// Levels 2 to 4, where they are asked for.
    pub(super) analysis: Option<Analysis>,
    /// Period of the firmware's motion.
    pub(super) period: Period,
    /// Exponent of the firmware's motion.
    pub(super) exponent: Option<Exponent>,
}

/// Levels 2 to 4.
#[derive(Debug)]
pub(super) struct Analysis {
    pub(super) one_step: OneStep,
    pub(super) divergence: Vec<(f64, f64)>,
    /// The host's long f64 run.
    pub(super) long: Trace,
    pub(super) long_period: Period,
    pub(super) long_exponent: Option<Exponent>,
}

/// All cases, the longest first.
pub(super) fn all(options: &Options) -> Vec<Case> {
    use Waveform::{None, Sine, Square};
    let second_core = Case {
        id: "1750-sine-m7".into(),
        title: "1750 rpm, sine 1.0 V, Cortex-M7".into(),
        role: Role::SecondCore,
        machine: Machine::Mps2An500,
        scenario: scenario(
            options,
            1750.0,
            Sine,
            Application::Averaged,
            SECOND_CORE_RUN_S,
        ),
        expected: Expected::Period(1),
    };
    let dithered = |waveform, application, role| {
        let (name, volts) = match waveform {
            Square => ("square", "0.1 V"),
            _ => ("sine", "1.0 V"),
        };
        let (suffix, way, longest_s) = match application {
            Application::Averaged => ("", "", f64::INFINITY),
            Application::Signal => ("-signal", ", true signal", SIGNAL_RUN_S),
        };
        Case {
            id: format!("1750-{name}{suffix}"),
            title: format!("1750 rpm, {name} {volts}{way}"),
            role,
            machine: Machine::Mps2An386,
            scenario: scenario(options, 1750.0, waveform, application, longest_s),
            expected: Expected::Period(1),
        }
    };
    let plain = |rpm: f64, role, expected| Case {
        id: format!("{rpm}"),
        title: format!("{rpm} rpm, no dither"),
        role,
        machine: Machine::Mps2An386,
        scenario: scenario(options, rpm, None, Application::Averaged, f64::INFINITY),
        expected,
    };
    vec![
        plain(1750.0, Role::Chaos, Expected::Chaos),
        dithered(Square, Application::Averaged, Role::Dithered(Square)),
        dithered(Sine, Application::Averaged, Role::Dithered(Sine)),
        plain(1600.0, Role::Region, Expected::Period(2)),
        plain(1845.0, Role::Region, Expected::Period(3)),
        plain(1880.0, Role::Region, Expected::Chaos),
        dithered(Square, Application::Signal, Role::Signal(Square)),
        dithered(Sine, Application::Signal, Role::Signal(Sine)),
        second_core,
    ]
}

fn scenario(
    options: &Options,
    wheel_speed_rpm: f64,
    waveform: Waveform,
    application: Application,
    longest_s: f64,
) -> Scenario<f64> {
    let mut scenario = options.base;
    scenario.run.wheel_speed_rpm = wheel_speed_rpm;
    scenario.run.duration_s = options.duration_s.min(longest_s);
    scenario.dither.application = application;
    scenario.dither.waveform = waveform;
    scenario.dither.amplitude_v = match waveform {
        Waveform::None => 0.0,
        Waveform::Square => 0.1,
        Waveform::Sine => 1.0,
    };
    scenario
}

/// Runs a case on the target and the host.
pub(super) fn run(
    mut case: Case,
    options: &Options,
    on_progress: &(impl Fn(Progress) + Sync),
) -> Result<Outcome, VerifyError> {
    // Both arithmetics start from the same state, so it is one of f32.
    let start = match settle(&case.scenario, TRANSIENT_S) {
        Err(Unsettled::EndsEarly(end)) => {
            let title = case.title;
            return Err(VerifyError::EndsEarly { title, end });
        }
        Err(Unsettled::Invalid(error)) => return Err(error.into()),
        Ok(state) => state.map(|value| f64::from(value as f32)),
    };
    case.scenario = started_at(&case.scenario, &start);
    let rounded = case.scenario.map(&|value| value as f32);
    let host = simulate(&rounded)?;
    if let Some(end) = early_end(&case.scenario, &host) {
        let title = case.title;
        return Err(VerifyError::EndsEarly { title, end });
    }
    let at_host_pace = [String::from("pace=host")];
    let (recording, log) = run_firmware(&case, &rounded, &at_host_pace, options, on_progress)?;
    let mut short = rounded;
    let timing_s = short.dither.start_time_s + TIMING_RUN_S as f32;
    short.run.duration_s = short.run.duration_s.min(timing_s);
    let (timing, timing_log) = run_firmware(&case, &short, &[], options, &|_| {})?;

    let firmware = trace_of(&recording);
    let pace = equivalence::bits(
        &trace_of(&timing),
        &beginning(&firmware, short.steps() as usize),
    );
    let settled = match case.scenario.dither.waveform {
        Waveform::None => 0,
        _ => firmware.index_after(case.scenario.dither.start_time_s + DITHER_TRANSIENT_S),
    };
    let all_levels = matches!(case.role, Role::Chaos | Role::Dithered(_) | Role::Region);
    let tolerance = match case.role {
        Role::Signal(_) => RIPPLE_TOLERANCE,
        _ => TOLERANCE,
    };
    let analysis = all_levels
        .then(|| analyse(&case.scenario, &firmware))
        .transpose()?;
    Ok(Outcome {
        bits: equivalence::bits(&firmware, &host),
        period: period(&firmware, settled, tolerance),
        exponent: lyapunov::largest(&case.scenario, &firmware, settled),
        analysis,
        settled,
        firmware,
        recording,
        log,
        timing,
        timing_log,
        pace,
        case,
    })
}

fn analyse(scenario: &Scenario<f64>, firmware: &Trace) -> Result<Analysis, VerifyError> {
    let mut longer = *scenario;
    longer.run.duration_s = LONG_RUN_S.max(10.0 * scenario.run.duration_s);
    let long = simulate(&longer)?;
    let from = long.index_after(scenario.dither.start_time_s + DITHER_TRANSIENT_S);
    Ok(Analysis {
        one_step: equivalence::one_step(scenario, firmware)?,
        divergence: equivalence::divergence(firmware, &long),
        long_period: period(&long, from, TOLERANCE),
        long_exponent: lyapunov::largest(&longer, &long, from),
        long,
    })
}

fn run_firmware(
    case: &Case,
    scenario: &Scenario<f32>,
    more: &[String],
    options: &Options,
    on_progress: &(impl Fn(Progress) + Sync),
) -> Result<(Recording, Vec<String>), VerifyError> {
    let folder = tempfile::tempdir().map_err(VerifyError::Folder)?;
    let telemetry = folder.path().join(TELEMETRY);
    let mut settings = settings::of(scenario);
    settings.push(format!("telemetry={TELEMETRY}"));
    settings.extend_from_slice(more);
    let (finish, finished) = mpsc::channel::<()>();
    let run = thread::scope(|scope| {
        let telemetry = &telemetry;
        scope.spawn(move || report_progress(telemetry, scenario, &finished, on_progress));
        let run = qemu::run(
            &options.image,
            case.machine,
            &settings,
            folder.path(),
            options.time_out,
            &|_| {},
        );
        drop(finish);
        run
    });
    let title = || case.title.clone();
    let Finished { exit_code, log } = run.map_err(|source| match source {
        RunError::Interrupted => VerifyError::Interrupted,
        source => VerifyError::Run {
            title: title(),
            source,
        },
    })?;
    // An overrun is a failed check, not a failed job: the telemetry up to it can be compared.
    if exit_code != 0 && exit_code != qemu::OVERRUN {
        return Err(VerifyError::Firmware {
            title: title(),
            exit_code,
            meaning: qemu::meaning(exit_code),
            last_line: log.last().cloned().unwrap_or_else(|| "(none)".into()),
        });
    }
    let recording = Recording::open(&telemetry).map_err(|source| VerifyError::Telemetry {
        title: title(),
        source,
    })?;
    Ok((recording, log))
}

/// Tells how far a run is by the length of its telemetry.
fn report_progress(
    telemetry: &Path,
    scenario: &Scenario<f32>,
    finished: &mpsc::Receiver<()>,
    on_progress: &(impl Fn(Progress) + Sync),
) {
    let a_second =
        f64::from(scenario.model_rate_hz()) * record_len(scenario.samples_per_step() as u16) as f64;
    let mut told = 0.0;
    loop {
        let waited = finished.recv_timeout(PROGRESS_POLL);
        let done = waited == Err(mpsc::RecvTimeoutError::Disconnected);
        let length = std::fs::metadata(telemetry).map_or(0, |file| file.len());
        let simulated = length as f64 / a_second;
        on_progress(Progress::Simulated(simulated - told));
        told = simulated;
        if done {
            return;
        }
    }
}

/// The first `steps` model steps of a run.
fn beginning(trace: &Trace, steps: usize) -> Trace {
    let states = steps.min(trace.states.len());
    let duties = (steps * trace.samples_per_step).min(trace.duties.len());
    Trace {
        states: trace.states[..states].to_vec(),
        duties: trace.duties[..duties].to_vec(),
        ..*trace
    }
}

impl Outcome {
    /// Instructions of both tasks: of the timing run, and of the control task also in the main run.
    pub(super) fn instructions(&self) -> Instructions {
        Instructions::of(&self.timing).with_control_of(&Instructions::of(&self.recording))
    }

    /// The deepest stack of both runs, bytes.
    pub(super) fn stack_bytes(&self) -> u32 {
        let runs = [&self.recording, &self.timing];
        runs.map(|run| run.trailer.stack_bytes)
            .into_iter()
            .max()
            .unwrap_or(u32::MAX)
    }

    /// The case and its motion in one line.
    pub(super) fn summary(&self) -> String {
        format!("{}: {}", self.case.title, self.period)
    }

    /// The exponent and its horizon from the host's long run, where the motion is chaotic.
    pub(super) fn horizon_s(&self) -> Option<[f64; 3]> {
        let analysis = self.analysis.as_ref()?;
        let exponent = analysis.long_exponent.filter(Exponent::is_positive)?;
        Some(equivalence::horizon_s(
            &exponent,
            analysis.one_step.relative_rms,
            self.firmware.step_s,
        ))
    }

    /// What the report shows of it.
    pub(super) fn report(&self) -> RunReport {
        let scenario = &self.case.scenario;
        let dithered = scenario.dither.waveform != Waveform::None;
        let (one_step_defect, divergence) = self.analysis.as_ref().map_or_else(
            || (Vec::new(), Vec::new()),
            |analysis| {
                (
                    analysis.one_step.ratios.clone(),
                    analysis.divergence.clone(),
                )
            },
        );
        let horizon_s = self.horizon_s();
        RunReport {
            id: self.case.id.clone(),
            title: self.case.title.clone(),
            trace: self.firmware.clone(),
            dither_start_s: dithered.then_some(scenario.dither.start_time_s),
            volts_per_count: Pwm::new(&scenario.servo, scenario.run.pwm_rate_hz).volts_per_count(),
            one_step_defect,
            divergence,
            divergence_limit: if horizon_s.is_some() {
                equivalence::PARTED
            } else {
                NEVER_PART
            },
            horizon_s,
            instructions: self.instructions(),
        }
    }
}
