//! Failure modes, effects and their detection as a table: a campaign's rows by failure mode.

use super::judge::Verdict;
use super::row::Row;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Names of detectors that a cell lists; the rest is counted.
const MAX_LISTED: usize = 4;

/// Heading of the table.
pub const HEADING: &str = "\
| class | failure mode | injected | undetected | detected by | worst latency, ticks | reaction | \
greatest steering angle, rad | without the fault, rad |
|---|---|---|---|---|---|---|---|---|
";

/// The table in Markdown, one line per failure mode.
///
/// The steering angles are the greatest of the run with the greatest increase over its fault-free
/// run, within 5 s from the injection.
pub fn table(rows: &[Row]) -> String {
    let mut modes: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        let mode = (row.class.name(), row.kind);
        if !modes.contains(&mode) {
            modes.push(mode);
        }
    }
    let mut table = String::from(HEADING);
    for (class, kind) in modes {
        let is_here = |row: &&Row| row.class.name() == class && row.kind == kind;
        let here: Vec<&Row> = rows.iter().filter(is_here).collect();
        line(&mut table, class, kind, &here);
    }
    table
}

fn line(table: &mut String, class: &str, kind: &str, rows: &[&Row]) {
    let undetected = rows
        .iter()
        .filter(|row| row.verdict == Verdict::Undetected)
        .count();
    let detectors = rows.iter().filter_map(|row| row.detected_by.as_deref());
    let latency = rows.iter().filter_map(|row| row.latency_ticks).max();
    let reactions = rows.iter().map(|row| row.reaction);
    let increase = |row: &&&Row| row.steering_angle_rad - row.fault_free_steering_angle_rad;
    let worst = rows
        .iter()
        .max_by(|a, b| increase(a).total_cmp(&increase(b)))
        .expect("a failure mode has rows");
    writeln!(
        table,
        "| {class} | {kind} | {} | {undetected} | {} | {} | {} | {:.2} | {:.2} |",
        rows.len(),
        listed(detectors),
        latency.map_or(String::from("-"), |ticks| ticks.to_string()),
        listed(reactions.filter(|reaction| *reaction != "none")),
        worst.steering_angle_rad,
        worst.fault_free_steering_angle_rad,
    )
    .expect("a string can be written");
}

/// The distinct names, sorted.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: BTreeSet<&str> = names.collect();
    let rest = names.len().saturating_sub(MAX_LISTED);
    let mut shown: Vec<String> = names
        .into_iter()
        .take(MAX_LISTED)
        .map(str::to_owned)
        .collect();
    if rest > 0 {
        shown.push(format!("{rest} more"));
    }
    if shown.is_empty() {
        return String::from("-");
    }
    shown.join("; ")
}
