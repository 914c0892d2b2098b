//! The ECU in the loop: does the firmware command what its program commands on the host, with a
//! vehicle that answers?

use super::checks::load;
use super::feedback;
use super::job::{Options, Progress, VerifyError};
use crate::report::DriveReport;
use pil::comparison::Comparison;
use pil::instructions::Instructions;
use pil::manoeuvre::Manoeuvre;
use pil::mil_sil_pil::{LoopError, MilSilPil, Target, run_all};
use plot::verdict::Check;
use qemu::session::LinkKind;
use qemu::{Machine, RunError};
use rayon::prelude::*;
use shared_model::dither::Waveform;
use shared_model::policy::Suppression;

/// Long enough for the dither, which sets in at 3 s, to take hold.
const DITHERED_S: f64 = 10.0;
/// Long enough for the delayed feedback, which sets in at 3 s, to capture the orbit.
const FEEDBACK_S: f64 = 40.0;

/// The manoeuvres, driven, with the checks over them.
pub(super) fn run(
    options: &Options,
    on_progress: &(impl Fn(Progress) + Sync),
) -> Result<(Vec<Check>, Vec<DriveReport>), VerifyError> {
    // The longest first.
    let driven: Vec<(Vec<Check>, DriveReport)> = [
        (Suppression::DelayedFeedback, Waveform::None),
        (Suppression::Dither, Waveform::Square),
        (Suppression::Dither, Waveform::Sine),
    ]
    .into_par_iter()
    .map(|of| one(of, options, on_progress))
    .collect::<Result<_, _>>()?;
    let (checks, mut reports): (Vec<_>, Vec<_>) = driven.into_iter().unzip();
    reports.rotate_left(1);
    Ok((checks.concat(), reports))
}

fn one(
    (suppression, waveform): (Suppression, Waveform),
    options: &Options,
    on_progress: &(impl Fn(Progress) + Sync),
) -> Result<(Vec<Check>, DriveReport), VerifyError> {
    let mut scenario = options.base;
    let base = &options.base;
    let rpm = base.run.wheel_speed_rpm;
    let mut manoeuvre = Manoeuvre::constant(rpm, base.steering.motor_current_a);
    let (name, what) = match waveform {
        Waveform::None => ("feedback", "delayed feedback"),
        Waveform::Square => ("square", "square dither as scheduled"),
        Waveform::Sine => ("sine", "sine dither as scheduled"),
    };
    scenario.dither.waveform = waveform;
    scenario.controller.suppression = suppression;
    scenario.run.duration_s = if suppression.has_feedback() {
        FEEDBACK_S
    } else {
        DITHERED_S
    };
    manoeuvre.name = format!("in the loop, {rpm} rpm, {what}");
    let target = Target {
        image: options.image.clone(),
        machine: Machine::Mps2An386,
        link: LinkKind::MeasuredTicks,
        time_out: options.time_out,
    };
    let failed = |source| {
        if matches!(source, LoopError::Run(RunError::Interrupted)) {
            return VerifyError::Interrupted;
        }
        VerifyError::InLoop {
            title: manoeuvre.name.clone(),
            source: Box::new(source),
        }
    };
    let levels = run_all(&scenario, &manoeuvre, &target, &mut || {}).map_err(failed)?;
    let id = format!("in-loop-{name}");
    let instructions = Instructions::in_loop(&levels.processor.costs, &scenario, target.machine);
    let mut checks = checks(&id, &levels);
    checks.push(load(format!("load/{id}"), &instructions));
    if suppression.has_feedback() {
        let run = &levels.processor.run;
        checks.extend(feedback::checks(&id, &scenario, &manoeuvre, run).map_err(failed)?);
    }
    on_progress(Progress::Done(format!("{}: driven", levels.name)));
    let report = DriveReport {
        id,
        title: levels.name,
        run: levels.processor.run,
        instructions,
    };
    Ok((checks, report))
}

fn checks(id: &str, levels: &MilSilPil) -> Vec<Check> {
    let equal = |what: &str, title: &str, comparison: &Comparison| {
        let different = comparison.different_duties + comparison.different_frames;
        let detail = match comparison.first {
            None => format!(
                "{} duty codes and {} actuator frames compared",
                comparison.duties, comparison.frames
            ),
            Some(period) => format!("the first in PWM period {period}"),
        };
        let measured = (different + comparison.unmatched) as f64;
        Check::equals(format!("{what}/{id}"), title, measured, 0.0).detail(detail)
    };
    vec![
        equal(
            "model-software",
            "Commands of model and software in the loop that differ",
            &levels.model_software,
        ),
        equal(
            "software-processor",
            "Commands of software and processor in the loop that differ",
            &levels.software_processor,
        ),
    ]
}
