//! Chart of a manoeuvre in the loop over time: states of the vehicle and commands of the ECU.

use crate::closed_loop::Run;
use crate::record::Record;
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::figure::{Sample, figure};
use plot::reduce::{Point, extremes};
use plot::style::{BAND, MAIN};
use shared_model::signal::Mode;

const BUCKETS: usize = 2000;
const PANEL: i32 = 230;

/// The figure of a run.
pub fn draw(title: &str, run: &Run) -> String {
    let mut legend = vec![("vehicle and ECU".into(), Sample::Line(MAIN))];
    let safe = safe_from_s(run);
    if safe.is_some() {
        legend.push(("safe state".into(), Sample::Shade(BAND)));
    }
    let of_record = |value: fn(&Record) -> f64| -> Vec<Point> {
        let records = run.records.iter();
        records
            .map(|record| (record.time_s, value(record)))
            .collect()
    };
    let amplitude = run.records.iter().zip(&run.actuations);
    let amplitude = amplitude.filter_map(|(record, actuation)| {
        Some((
            record.time_s,
            f64::from(actuation.as_ref()?.dither_amplitude_v),
        ))
    });
    let mut curves = vec![
        (
            "wheel speed (rpm)",
            of_record(|record| record.wheel_speed_rpm),
        ),
        (
            "yaw rate \u{3b3} (rad/s)",
            of_record(|record| record.yaw_rate_rad_per_s),
        ),
        (
            "steering angle \u{3b4} (rad)",
            of_record(|record| record.steering_angle_rad),
        ),
        (
            "motor current (A)",
            of_record(|record| record.motor_current_a),
        ),
    ];
    let amplitude: Vec<Point> = amplitude.collect();
    if amplitude.iter().any(|point| point.1 > 0.0) {
        curves.push(("dither amplitude (V)", amplitude));
    }
    let end_s = run.records.last().map_or(1.0, |record| record.time_s);
    let heading = format!("In the loop \u{2013} {title}");
    figure(
        &heading,
        &legend,
        stack_height(curves.len(), PANEL),
        |area| {
            let rows = stack(area, curves.len(), PANEL, "time (s)");
            for ((area, time), (name, curve)) in rows.into_iter().zip(curves) {
                let curve = extremes(curve, BUCKETS);
                let panel = Axes::new(
                    &area,
                    ("", ""),
                    Axis::linear(time, 0.0, end_s, 15),
                    Axis::around(name, curve.iter().map(|point| point.1), 5),
                );
                if let Some(from_s) = safe {
                    panel.band(from_s, end_s);
                }
                panel.lines(&[(&curve, MAIN)]);
            }
        },
    )
}

/// The time at which the ECU entered its safe state, if it did.
fn safe_from_s(run: &Run) -> Option<f64> {
    let is_safe = |actuation: &Option<_>| {
        actuation.is_some_and(|actuation: shared_model::signal::Actuation<f32>| {
            actuation.mode == Mode::Safe
        })
    };
    let index = run.actuations.iter().position(is_safe)?;
    run.records.get(index).map(|record| record.time_s)
}
