//! The PWM's voltage around the dither's start.

use crate::report::input::RunReport;
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::canvas::Area;
use plot::figure::{Sample, figure};
use plot::number::four_digits;
use plot::reduce::Point;
use plot::style::{INSTANT, MAIN};

/// The time shown, ms from the dither's start.
const FROM_MS: f64 = -3.0;
const TO_MS: f64 = 12.0;
const PANEL: i32 = 260;

/// The figure: a panel for each run with dither.
pub fn draw(runs: &[RunReport]) -> String {
    let runs: Vec<(&RunReport, f64)> = runs
        .iter()
        .filter_map(|run| Some((run, run.dither_start_s?)))
        .collect();
    let legend = [
        ("voltage of each PWM period".into(), Sample::Line(MAIN)),
        ("dither on".into(), Sample::Line(INSTANT)),
    ];
    let heading = "PWM voltage at the start of the dither";
    let height = stack_height(runs.len(), PANEL);
    figure(heading, &legend, height, |area| {
        let rows = stack(area, runs.len(), PANEL, "time from the dither's start (ms)");
        for ((area, time), (run, start_s)) in rows.iter().zip(&runs) {
            panel(area, time, run, *start_s);
        }
    })
}

fn panel(area: &Area, time: &str, run: &RunReport, start_s: f64) {
    let steps = steps(run, start_s);
    let count = format!(
        "1 count = {} mV = {} % duty",
        four_digits(run.volts_per_count * 1e3),
        four_digits(100.0 / f64::from(run.trace.pwm_period)),
    );
    let panel = Axes::new(
        area,
        (&run.title, &count),
        Axis::linear(time, FROM_MS, TO_MS, 15),
        Axis::around("voltage (V)", steps.iter().map(|point| point.1), 5),
    );
    panel.lines(&[(&steps, MAIN)]);
    panel.instant(0.0, INSTANT)
}

/// Both ends of each PWM period that is shown: milliseconds and volts.
fn steps(run: &RunReport, start_s: f64) -> Vec<Point> {
    let trace = &run.trace;
    let middle = f64::from(trace.pwm_period) / 2.0;
    let time_ms = |n: usize| (trace.pwm_time_s(n) - start_s) * 1e3;
    trace
        .duties
        .iter()
        .enumerate()
        .map(|(n, code)| (time_ms(n), time_ms(n + 1), f64::from(*code) - middle))
        .skip_while(|(_, end_ms, _)| *end_ms <= FROM_MS)
        .take_while(|(begin_ms, _, _)| *begin_ms < TO_MS)
        .flat_map(|(begin_ms, end_ms, counts)| {
            let volts = counts * run.volts_per_count;
            [(begin_ms, volts), (end_ms, volts)]
        })
        .filter(|(_, volts)| volts.is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn shows_every_period_of_the_window_as_a_step() {
        let run = sample::runs().remove(1);
        let start_s = run.dither_start_s.unwrap();
        let steps = steps(&run, start_s);
        assert_eq!(steps.len(), 2 * 150);
        for step in steps.chunks(2) {
            assert_eq!(step[0].1, step[1].1);
            assert!((step[1].0 - step[0].0 - 0.1).abs() < 1e-6);
        }
    }
}
