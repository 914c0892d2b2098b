//! Figures of delayed feedback.

use super::feedback::Feedback;
use super::over_speed::Point;
use super::region::Cell;
use super::simulation::Held;
use crate::sweep::Parameter;
use plot::chart::{AxisSpec, Chart, Look, Panel, Series, large_dots};

/// A torque, root mean square, that is small, as with an exact delay, N m.
const SMALL_NM: f64 = 0.05;

/// The cells of each speed by what they hold, over the error of the delay and the gain.
pub fn region_chart(cells: &[Cell], feedback: &Feedback) -> Chart {
    let of_speed = cells.chunk_by(|a, b| a.wheel_speed_rpm == b.wheel_speed_rpm);
    let panel = |cells: &[Cell]| Panel {
        caption: format!("{} rpm", cells[0].wheel_speed_rpm),
        x: AxisSpec::linear("delay less period (ms)"),
        y: AxisSpec::linear(format!("gain (N m per {})", feedback.component.unit)),
        series: region_series(cells),
        ..Panel::default()
    };
    Chart {
        heading: "Delayed feedback: gain and delay that hold the orbit, by simulation".into(),
        panels: of_speed.map(panel).collect(),
    }
}

fn region_series(cells: &[Cell]) -> Vec<Series> {
    type Holds = fn(&Cell) -> bool;
    let groups: [(&str, Holds); 3] = [
        ("periodic, torque less than 0.05 N m rms", |cell| {
            cell.held.maxima.is_some() && cell.held.torque_rms_nm < SMALL_NM
        }),
        ("periodic, more torque", |cell| {
            cell.held.maxima.is_some() && cell.held.torque_rms_nm >= SMALL_NM
        }),
        ("not periodic", |cell| cell.held.maxima.is_none()),
    ];
    let series = groups.iter().enumerate().flat_map(|(n, (label, holds))| {
        let of_group = cells.iter().filter(|cell| holds(cell));
        let points = of_group.map(|cell| (1e3 * cell.delay_error_s, cell.gain));
        large_dots(label, n, points.collect())
    });
    series.collect()
}

fn captures(label: &str, n: usize, of: fn(&Point) -> &Held, points: &[Point]) -> Vec<Series> {
    let captured = |point: &Point| Some((point.wheel_speed_rpm, of(point).capture_s?));
    large_dots(label, n, points.iter().filter_map(captured).collect())
}

/// Multipliers without and with feedback, the torque that is left, and the times of capture, over the wheel speed.
pub fn chart(points: &[Point]) -> Chart {
    let line = |label: &str, n, of: fn(&Point) -> f64| Series {
        label: label.into(),
        points: points
            .iter()
            .map(|point| (point.wheel_speed_rpm, of(point)))
            .collect(),
        look: Look::Line(n),
    };
    let x = || AxisSpec::linear(Parameter::Speed.name());
    let panel = |caption: &str, y: AxisSpec, series, levels| Panel {
        caption: caption.into(),
        x: x(),
        y,
        series,
        levels,
        ..Panel::default()
    };
    Chart {
        heading: "Delayed feedback: the orbit of one cycle over the wheel speed".into(),
        panels: vec![
            panel(
                "greatest modulus of a multiplier",
                AxisSpec::linear("modulus"),
                vec![
                    line("without feedback", 1, |point| point.free_multiplier.abs()),
                    line("with the best gain", 0, |point| point.best.multiplier),
                ],
                vec![1.0],
            ),
            panel(
                "torque of the last minute, beside the motor's constant one",
                AxisSpec::logarithmic("torque (N m)"),
                vec![
                    line("peak", 1, |point| point.held.torque_peak_nm),
                    line("root mean square", 0, |point| point.held.torque_rms_nm),
                ],
                Vec::new(),
            ),
            panel(
                "time from switching on to capture, where captured",
                AxisSpec::linear("time (s)"),
                [
                    captures("orbit, by delayed feedback", 0, |point| &point.held, points),
                    captures(
                        "orbit, by impulses",
                        1,
                        |point| &point.under_impulses,
                        points,
                    ),
                    captures(
                        "rest, by the whole state",
                        2,
                        |point| &point.to_rest,
                        points,
                    ),
                ]
                .concat(),
                Vec::new(),
            ),
        ],
    }
}
