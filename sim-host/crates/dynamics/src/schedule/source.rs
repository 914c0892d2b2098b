//! The schedules as the Rust source that the ECU is built with.

use super::Analysis;
use super::choose::{Choice, Entry};
use crate::module_comment::module_comment;
use shared_model::dither::Waveform;
use std::fmt::Write;

/// What the remarks in the table mean.
const REMARKS: &str = "After each amplitude are its speed, and the range of amplitudes in which \
    trajectories from both initial states have period one or come to rest, there and at the \
    neighbouring speeds.";

/// Source of `shared_model::schedule_table` for schedules over the same speeds; `made_by` is the
/// command and what it was run on, a sentence each. The text is formatted as rustfmt does, and
/// depends on nothing else.
pub fn source(analyses: &[Analysis], made_by: &[String]) -> String {
    let points = analyses.first().map_or(0, |one| one.entries.len());
    let mut text = String::from("//! The ECU's dither schedules.\n//!\n");
    text += &module_comment(&made_by.join(" "));
    text += "//!\n";
    text += &module_comment(REMARKS);
    text += "\nuse crate::schedule::Schedule;\n\n/// Wheel speeds of a schedule.\n";
    text += &format!("pub const POINTS: usize = {points};\n");
    for analysis in analyses {
        text += &table(analysis);
    }
    text
}

fn table(analysis: &Analysis) -> String {
    let (name, word) = match analysis.waveform {
        Waveform::Sine => ("SINE", "sine"),
        Waveform::Square | Waveform::None => ("SQUARE", "square wave"),
    };
    let speeds: Vec<f64> = analysis.entries.iter().map(|e| e.wheel_speed_rpm).collect();
    let first_rpm = speeds.first().copied().unwrap_or(0.0);
    let step_rpm = speeds.get(1).map_or(1.0, |second| second - first_rpm);
    let mut text = format!(
        "\n/// The {word}'s amplitudes.\npub const {name}: Schedule<f32, POINTS> = Schedule {{\n    first_rpm: {first_rpm:?},\n    \
         step_rpm: {step_rpm:?},\n    amplitudes_v: [\n"
    );
    for entry in &analysis.entries {
        let remark = remark(entry);
        // All of one width, so that rustfmt leaves the remarks where they are.
        let _ = writeln!(text, "        {:.4}, // {remark}", entry.amplitude_v);
    }
    text + "    ],\n};\n"
}

/// Speed, and why this amplitude.
pub fn remark(entry: &Entry) -> String {
    let range = entry.range.map_or_else(String::new, |range| {
        format!(" from {:.4} to {:.4} V", range.from_v, range.to_v)
    });
    let why = match entry.choice {
        Choice::Undithered if entry.coexist_undithered => {
            "none needed: period one and rest coexist"
        }
        Choice::Undithered => "none needed",
        Choice::PeriodOne => "period one",
        Choice::Rest => "NO PERIOD ONE, but rest",
        Choice::Nothing => "NEITHER PERIOD ONE NOR REST at any amplitude, so none",
    };
    format!("{} rpm: {why}{range}", entry.wheel_speed_rpm)
}
