//! Yaw rate against sideslip angle, without dither and with it.

use crate::report::input::RunReport;
use dynamics::trace::Trace;
use plot::axes::{Axes, CAPTION, TICKS_AND_NAME};
use plot::axis::Axis;
use plot::canvas::Line;
use plot::figure::figure;
use plot::reduce::{Point, curve};
use plot::style::{ALONE, MAIN, WIDTH};
use shared_model::vehicle::{SIDESLIP, YAW_RATE};

const MOST_POINTS: usize = 4000;
const PANEL: i32 = 560;
/// A trajectory that stays within this many units of the drawing is marked by a dot.
const DOT: f64 = 8.0;

/// The figure for a run without dither and one with it.
pub fn draw(title: &str, before: &RunReport, after: &RunReport) -> String {
    let heading = format!("Phase portrait of the settled motion \u{2013} {title}");
    figure(&heading, &[], CAPTION + PANEL + TICKS_AND_NAME, |area| {
        let (left, right) = area.split_right(WIDTH / 2);
        let states = [settled(&before.trace), settled(&after.trace)];
        let all = || {
            states
                .iter()
                .flatten()
                .filter(|p| p.0.is_finite() && p.1.is_finite())
        };
        let x = Axis::around("sideslip angle \u{3b2} (rad)", all().map(|p| p.0), 6);
        let y = Axis::around("yaw rate \u{3b3} (rad/s)", all().map(|p| p.1), 8);
        for (area, run, states, line, word) in [
            (left, before, &states[0], ALONE, "before"),
            (right, after, &states[1], MAIN, "after"),
        ] {
            let caption = format!("{word}: {}", run.title);
            let panel = Axes::new(&area, (&caption, ""), x.clone(), y.clone());
            orbit(&panel, states, line);
        }
    })
}

fn orbit(panel: &Axes, states: &[Point], line: Line) {
    let scale = panel.units_per_place();
    let points = curve(states.iter().copied(), scale, MOST_POINTS);
    panel.lines(&[(&points, line)]);
    if let Some(first) = points.first() {
        let near = |point: &Point| {
            (point.0 - first.0).abs() * scale.0 < DOT && (point.1 - first.1).abs() * scale.1 < DOT
        };
        if points.iter().all(near) {
            panel.dot(*first, line);
        }
    }
}

/// The states of the run's second half.
fn settled(trace: &Trace) -> Vec<Point> {
    trace.states[trace.states.len() / 2..]
        .iter()
        .map(|state| (state.x[SIDESLIP], state.x[YAW_RATE]))
        .collect()
}
