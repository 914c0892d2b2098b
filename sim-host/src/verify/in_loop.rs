//! The ECU in the loop: does the firmware command what its program commands on the host, with a
//! vehicle that answers?

use super::checks::load;
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

/// Long enough for the dither, which sets in at 3 s, to take hold.
const DURATION_S: f64 = 10.0;

/// The manoeuvres, driven, with the checks over them.
pub(super) fn run(
    options: &Options,
    on_progress: &(impl Fn(Progress) + Sync),
) -> Result<(Vec<Check>, Vec<DriveReport>), VerifyError> {
    let driven: Vec<(Vec<Check>, DriveReport)> = [Waveform::Square, Waveform::Sine]
        .into_par_iter()
        .map(|waveform| one(waveform, options, on_progress))
        .collect::<Result<_, _>>()?;
    let (checks, reports): (Vec<_>, Vec<_>) = driven.into_iter().unzip();
    Ok((checks.concat(), reports))
}

fn one(
    waveform: Waveform,
    options: &Options,
    on_progress: &(impl Fn(Progress) + Sync),
) -> Result<(Vec<Check>, DriveReport), VerifyError> {
    let mut scenario = options.base;
    scenario.run.duration_s = DURATION_S;
    scenario.dither.waveform = waveform;
    let base = &options.base;
    let rpm = base.run.wheel_speed_rpm;
    let mut manoeuvre = Manoeuvre::constant(rpm, base.steering.motor_current_a);
    let name = match waveform {
        Waveform::Sine => "sine",
        Waveform::Square | Waveform::None => "square",
    };
    manoeuvre.name = format!("in the loop, {rpm} rpm, {name} dither as scheduled");
    let target = Target {
        image: options.image.clone(),
        machine: Machine::Mps2An386,
        link: LinkKind::MeasuredTicks,
        time_out: options.time_out,
    };
    let levels = run_all(&scenario, &manoeuvre, &target, || {}).map_err(|source| {
        if matches!(source, LoopError::Run(RunError::Interrupted)) {
            return VerifyError::Interrupted;
        }
        VerifyError::InLoop {
            title: manoeuvre.name.clone(),
            source: Box::new(source),
        }
    })?;
    let id = format!("in-loop-{name}");
    let instructions = Instructions::in_loop(&levels.processor.costs, &scenario, target.machine);
    let mut checks = checks(&id, &levels);
    checks.push(load(format!("load/{id}"), &instructions));
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
