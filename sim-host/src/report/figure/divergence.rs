//! Distance of the f32 and f64 runs against time.

use crate::report::input::RunReport;
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::canvas::{Area, Line};
use plot::figure::{Sample, figure};
use plot::number::four_digits;
use plot::reduce::{Point, maxima};
use plot::style::{INSTANT, LIMIT, RUNS};

const BUCKETS: usize = 400;
const PANEL: i32 = 340;
const ROOM: f64 = 1.2;

/// The figure: a panel for each chaotic run, and one for the runs that must stay together. Runs
/// without distances are left out.
pub fn draw(runs: &[RunReport]) -> String {
    let styled: Vec<(&RunReport, Line)> = runs
        .iter()
        .filter(|run| !run.divergence.is_empty())
        .zip(RUNS.into_iter().cycle())
        .collect();
    let mut legend: Vec<_> = styled
        .iter()
        .map(|(run, line)| (run.title.clone(), Sample::Line(*line)))
        .collect();
    legend.push(("limit".into(), Sample::Line(LIMIT)));
    let (parting, bounded): (Vec<_>, Vec<_>) = styled
        .into_iter()
        .partition(|(run, _)| run.horizon_s.is_some());
    if !parting.is_empty() {
        legend.push(("predicted horizon".into(), Sample::Band));
        legend.push(("expected".into(), Sample::Line(INSTANT)));
    }
    // Each horizon has a panel, which assigns it to its run.
    let mut groups: Vec<Group> = parting
        .into_iter()
        .map(|run| Group {
            caption: format!("chaotic: {}", run.0.title),
            remark: run.0.horizon_s.map_or(String::new(), horizon_text),
            runs: vec![run],
        })
        .collect();
    if !bounded.is_empty() {
        groups.push(Group {
            caption: "must stay below the limit".into(),
            remark: String::new(),
            runs: bounded,
        });
    }
    let heading = "Divergence of f32 and f64 against the predicted horizon";
    let height = stack_height(groups.len().max(1), PANEL);
    figure(heading, &legend, height, |area| {
        let curves = runs.iter().flat_map(|run| &run.divergence);
        let values = || {
            curves
                .clone()
                .copied()
                .filter(|p| p.0.is_finite() && p.1.is_finite())
        };
        let limits = runs.iter().map(|run| run.divergence_limit);
        // Room between the curves and the frame.
        let distances = values().map(|p| p.1).chain(limits);
        let y = Axis::decades(
            "relative distance",
            distances.flat_map(|distance| [distance / ROOM, distance * ROOM]),
            6,
        );
        let end_s = end_s(runs, values().map(|p| p.0).fold(0.0, f64::max));
        let rows = stack(area, groups.len(), PANEL, "time (s)");
        for ((area, time), group) in rows.iter().zip(&groups) {
            panel(area, group, Axis::linear(time, 0.0, end_s, 12), y.clone());
        }
        if groups.is_empty() {
            Axes::new(area, ("", ""), Axis::linear("time (s)", 0.0, 1.0, 5), y).no_data();
        }
    })
}

/// Runs that share a panel.
struct Group<'a> {
    caption: String,
    remark: String,
    runs: Vec<(&'a RunReport, Line)>,
}

fn horizon_text([least, expected, greatest]: [f64; 3]) -> String {
    let [least, expected, greatest] = [least, expected, greatest].map(four_digits);
    format!("predicted at {expected} s, {least} to {greatest} s")
}

/// End of the time axis: that of the runs, or somewhat later to include an expected separation.
fn end_s(runs: &[RunReport], data_end_s: f64) -> f64 {
    runs.iter()
        .filter_map(|run| run.horizon_s)
        .map(|horizon| (1.05 * horizon[1]).min(1.5 * data_end_s))
        .fold(data_end_s, f64::max)
}

fn panel(area: &Area, group: &Group, x: Axis, y: Axis) {
    let panel = Axes::new(area, (&group.caption, &group.remark), x, y);
    let runs = &group.runs;
    for horizon in runs.iter().filter_map(|(run, _)| run.horizon_s) {
        panel.band(horizon[0], horizon[2]);
    }
    for horizon in runs.iter().filter_map(|(run, _)| run.horizon_s) {
        panel.instant(horizon[1], INSTANT);
    }
    let mut limits: Vec<f64> = runs.iter().map(|(run, _)| run.divergence_limit).collect();
    limits.sort_by(f64::total_cmp);
    limits.dedup();
    for limit in limits.into_iter().filter(|limit| limit.is_finite()) {
        panel.level(limit, LIMIT);
    }
    let curves: Vec<(Vec<Point>, Line)> = runs
        .iter()
        .map(|(run, line)| (maxima(run.divergence.iter().copied(), BUCKETS), *line))
        .collect();
    let curves: Vec<(&[Point], Line)> = curves
        .iter()
        .map(|(points, line)| (points.as_slice(), *line))
        .collect();
    panel.lines(&curves)
}
