//! The periods and gains that the ECU carries.

use super::feedback::Feedback;
use super::linearised::{Best, Linearised};
use super::orbit::{branch_over_speed, orbit_on};
use crate::module_comment::module_comment;
use crate::settled::VehicleOrbit;
use crate::sweep::{Parameter, RunControl, SweepError, Values, scenarios};
use shared_model::Scenario;
use shared_model::delayed_feedback::{InvalidOrbits, OrbitSchedule, SHORTEST_LINE_S};
use shared_model::dither::Waveform;
use shared_model::ecu_schedule::Table;
use std::fmt::Write;

/// The orbit of one cycle at a wheel speed and the best gain for it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Entry {
    /// Wheel speed N, rpm.
    pub wheel_speed_rpm: f64,
    /// Period of the orbit, s.
    pub period_s: f64,
    /// Its greatest multiplier beside 1 without feedback.
    pub free_multiplier: f64,
    /// The best gain.
    pub best: Best,
}

/// Gain under dither, N m s/rad. The dither holds the orbit by itself, a greater gain makes its multiplier hardly less,
/// and the ramps of a greater torque leak into the dither of the servo.
const DITHERED_GAIN: f64 = 1.0;

/// The entries at equally spaced wheel speeds without dither, with the best of the gains, and under the ECU's square
/// dither with a small gain. `None` where no orbit of one cycle is found; speeds that were not begun before a request
/// to stop are left out.
///
/// # Errors
/// If a scenario is not valid.
pub fn entries(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    feedback: &Feedback,
    gains: &Values,
    control: RunControl,
) -> Result<Vec<[Option<Entry>; 2]>, SweepError> {
    let mut undithered = *scenario;
    undithered.dither.waveform = Waveform::None;
    let undithered = scenarios(&undithered, Parameter::Speed, speeds_rpm)?;
    let dithered: Vec<_> = undithered.iter().map(under_square).collect();
    let [branch, other_branch] = [&undithered, &dithered]
        .map(|of| interrupt::catch(|| branch_over_speed(of)).unwrap_or_default());
    let both: Vec<_> = undithered.into_iter().zip(dithered).collect();
    let entries = control.points(&both, |(scenario, dithered)| {
        let best = |orbit: &Linearised| orbit.best_gain(&held_by(feedback, orbit, 0.0), gains);
        let entry = entry(&branch, scenario, best);
        let small = |orbit: &Linearised| {
            let gain = DITHERED_GAIN;
            let multiplier = orbit.greatest_multiplier(&held_by(feedback, orbit, gain));
            Best {
                gain,
                multiplier,
                holding: (multiplier < 1.0).then_some((gain, gain)),
            }
        };
        [entry, self::entry(&other_branch, dithered, small)]
    });
    Ok(entries.into_iter().flatten().collect())
}

/// The same under the square dither of the ECU's schedule.
fn under_square(scenario: &Scenario<f64>) -> Scenario<f64> {
    let mut scenario = *scenario;
    scenario.dither.waveform = Waveform::Square;
    let schedule = Table::of(Waveform::Square);
    scenario.dither.amplitude_v = schedule.amplitude_v(scenario.run.wheel_speed_rpm);
    scenario
}

fn held_by(feedback: &Feedback, orbit: &Linearised, gain: f64) -> Feedback {
    Feedback {
        delay_s: orbit.period_s,
        gain,
        ..*feedback
    }
}

fn entry(
    branch: &[VehicleOrbit],
    scenario: &Scenario<f64>,
    best: impl FnOnce(&Linearised) -> Best,
) -> Option<Entry> {
    let orbit = Linearised::at(scenario, &orbit_on(branch, scenario)?)?;
    Some(Entry {
        wheel_speed_rpm: scenario.run.wheel_speed_rpm,
        period_s: orbit.period_s,
        free_multiplier: orbit.free_multiplier,
        best: best(&orbit),
    })
}

/// Speeds of a schedule without one for the ECU.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScheduleError {
    /// There is an entry at fewer speeds than two.
    #[error("a schedule needs at least two wheel speeds")]
    OneSpeed,
    /// There is no orbit of one cycle at a speed.
    #[error("no orbit of one cycle at {0} rpm: the ECU's table cannot have a gap")]
    Gap(f64),
    /// No gain that was tried holds the orbit at a speed.
    #[error("no gain that was tried holds the orbit at {0} rpm")]
    NotHeld(f64),
    /// The ECU would refuse it.
    #[error(transparent)]
    Invalid(#[from] InvalidOrbits),
}

/// Source of `shared_model::delayed_feedback::table` for the entries without and with dither over the same speeds,
/// at the scenario's motor current; `made_by` is the command and what it was run on, a sentence each. The text is
/// formatted as rustfmt does.
///
/// # Errors
/// If a speed has no entry, or the ECU's delay line is too short for one.
pub fn source(
    scenario: &Scenario<f64>,
    speeds_rpm: &Values,
    entries: &[[Option<Entry>; 2]],
    made_by: &[String],
) -> Result<String, ScheduleError> {
    let mut text = String::from("//! The ECU's delayed feedback.\n//!\n");
    text += &module_comment(&made_by.join(" "));
    text += "//!\n";
    text += &module_comment(REMARKS);
    let points = speeds_rpm.count();
    let _ = write!(
        text,
        "\nuse super::schedule::OrbitSchedule;\n\n/// Wheel speeds of a schedule.\npub const POINTS: usize = {points};\n"
    );
    for (place, (name, about)) in TABLES.into_iter().enumerate() {
        let one = |both: &[Option<Entry>; 2]| both[place];
        let entries: Vec<_> = entries.iter().map(one).collect();
        let motor_current_a = scenario.steering.motor_current_a;
        text += &table(name, about, motor_current_a, &whole(speeds_rpm, &entries)?)?;
    }
    Ok(text)
}

/// Name and documentation of each table.
const TABLES: [(&str, &str); 2] = [
    ("UNDITHERED", "Without dither."),
    (
        "DITHERED",
        "Under the square dither of the ECU's schedule, which holds the orbit by itself.",
    ),
];
/// What the remarks in the tables mean.
const REMARKS: &str = "After each period is its speed, after each gain the orbit's greatest multiplier beside 1 \
    without and with feedback.";

/// The entries, one at each speed.
fn whole(speeds_rpm: &Values, entries: &[Option<Entry>]) -> Result<Vec<Entry>, ScheduleError> {
    if speeds_rpm.count() < 2 {
        return Err(ScheduleError::OneSpeed);
    }
    let mut whole = Vec::with_capacity(entries.len());
    for (k, rpm) in speeds_rpm.iter().enumerate() {
        let entry = entries.get(k).copied().flatten();
        let entry = entry.ok_or(ScheduleError::Gap(rpm))?;
        if entry.best.multiplier >= 1.0 {
            return Err(ScheduleError::NotHeld(rpm));
        }
        whole.push(entry);
    }
    Ok(whole)
}

fn table(
    name: &str,
    about: &str,
    motor_current_a: f64,
    entries: &[Entry],
) -> Result<String, ScheduleError> {
    let [first, second, ..] = entries else {
        return Err(ScheduleError::OneSpeed);
    };
    let (first_rpm, step_rpm) = (
        first.wheel_speed_rpm,
        second.wheel_speed_rpm - first.wheel_speed_rpm,
    );
    for entry in entries {
        // The schedule's own check, a speed at a time: their number is known only at run time.
        let one = OrbitSchedule {
            motor_current_a,
            first_rpm: entry.wheel_speed_rpm,
            step_rpm,
            periods_s: [entry.period_s],
            gains: [entry.best.gain],
        };
        one.validate(SHORTEST_LINE_S)?;
    }
    let mut text = format!(
        "\n/// {about}\npub const {name}: OrbitSchedule<f32, POINTS> = OrbitSchedule {{\n    \
         motor_current_a: {motor_current_a:?},\n    first_rpm: {first_rpm:?},\n    \
         step_rpm: {step_rpm:?},\n    periods_s: [\n"
    );
    for entry in entries {
        let _ = writeln!(
            text,
            "        {:.5}, // {} rpm",
            entry.period_s, entry.wheel_speed_rpm
        );
    }
    text += "    ],\n    gains: [\n";
    for entry in entries {
        let _ = writeln!(
            text,
            "        {:.2}, // {} rpm: {:.2} to {:.2}",
            entry.best.gain, entry.wheel_speed_rpm, entry.free_multiplier, entry.best.multiplier
        );
    }
    Ok(text + "    ],\n};\n")
}
