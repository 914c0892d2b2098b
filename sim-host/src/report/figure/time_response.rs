//! Sideslip angle and yaw rate against time, with and without dither.

use crate::report::input::RunReport;
use dynamics::trace::Trace;
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::figure::{Sample, figure};
use plot::number::four_digits;
use plot::reduce::{Point, extremes};
use plot::style::{INSTANT, MAIN, OTHER};
use shared_model::vehicle::{SIDESLIP, YAW_RATE};

/// End of the time axis, s: the oscillation's single periods are still seen.
const END_S: f64 = 15.0;
const BUCKETS: usize = 2000;
const PANEL: i32 = 330;

/// The figure for a run without dither and one with it from the same start.
pub fn draw(title: &str, before: &RunReport, after: &RunReport) -> String {
    let legend = [
        (format!("with dither: {}", after.title), Sample::Line(MAIN)),
        (format!("without: {}", before.title), Sample::Line(OTHER)),
    ];
    let heading = format!("Time response \u{2013} {title}");
    let panels = [
        (SIDESLIP, "sideslip angle \u{3b2} (rad)"),
        (YAW_RATE, "yaw rate \u{3b3} (rad/s)"),
    ];
    let height = stack_height(panels.len(), PANEL);
    figure(&heading, &legend, height, |area| {
        let end_s = end(&before.trace).max(end(&after.trace));
        let rows = stack(area, panels.len(), PANEL, "time (s)");
        for ((area, time), (component, name)) in rows.into_iter().zip(panels) {
            let with = curve(&after.trace, component);
            let without = curve(&before.trace, component);
            let values = with.iter().chain(&without).map(|point| point.1);
            let panel = Axes::new(
                &area,
                ("", ""),
                Axis::linear(time, 0.0, end_s, 15),
                Axis::around(name, values, 6),
            );
            panel.lines(&[(&without, OTHER), (&with, MAIN)]);
            if let Some(start_s) = after.dither_start_s {
                panel.instant(start_s, INSTANT);
                if component == SIDESLIP {
                    let label = format!("dither on at {} s", four_digits(start_s));
                    panel.instant_label(start_s, &label);
                }
            }
        }
    })
}

fn end(trace: &Trace) -> f64 {
    (trace.states.len() as f64 * trace.step_s).min(END_S)
}

fn curve(trace: &Trace, component: usize) -> Vec<Point> {
    let start = (0.0, trace.initial.x[component]);
    let later = trace
        .component(component)
        .enumerate()
        .map(|(k, value)| (trace.time_s(k), value))
        .take_while(|point| point.0 <= END_S);
    if trace.states.is_empty() {
        return Vec::new();
    }
    extremes(std::iter::once(start).chain(later), BUCKETS)
}
