//! The one-step defect over its bound against time.

use crate::report::input::RunReport;
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::figure::{Sample, figure};
use plot::number::four_digits;
use plot::reduce::{Point, maxima};
use plot::style::{LIMIT, MAIN};

/// About one for each pixel.
const BUCKETS: usize = 700;
const PANEL: i32 = 190;
/// Lower end of the axis. Smaller defects lie on it.
const LEAST: f64 = 1e-4;

/// The figure: a panel for each run of which there are defects.
pub fn draw(runs: &[RunReport]) -> String {
    let legend = [
        ("greatest defect over its bound".into(), Sample::Line(MAIN)),
        ("limit".into(), Sample::Line(LIMIT)),
    ];
    let mut curves: Vec<(&str, Vec<Point>)> = runs
        .iter()
        .filter(|run| !run.one_step_defect.is_empty())
        .map(|run| {
            let points = run.one_step_defect.iter().copied();
            (run.title.as_str(), maxima(points, BUCKETS))
        })
        .collect();
    if curves.is_empty() {
        curves.push(("", Vec::new()));
    }
    let heading = "One-step defect of the firmware against the host's f64 step";
    let height = stack_height(curves.len(), PANEL);
    figure(heading, &legend, height, |area| {
        let times = runs.iter().flat_map(|run| &run.one_step_defect);
        let end_s = times.map(|point| point.0).fold(0.0, f64::max);
        let all = curves.iter().flat_map(|(_, points)| points);
        let values = all.map(|point| point.1.max(LEAST)).chain([0.1, 10.0]);
        let y = Axis::decades("defect / bound", values, 4);
        let rows = stack(area, curves.len(), PANEL, "time (s)");
        for ((area, time), (title, points)) in rows.iter().zip(&curves) {
            let greatest = points.iter().map(|point| point.1).reduce(f64::max);
            let remark = greatest.map_or(String::new(), |most| {
                format!("greatest {}", four_digits(most))
            });
            let x = Axis::linear(time, 0.0, end_s, 12);
            let panel = Axes::new(area, (title, &remark), x, y.clone());
            if greatest.is_some() {
                panel.level(1.0, LIMIT);
            }
            panel.lines(&[(points, MAIN)]);
        }
    })
}
