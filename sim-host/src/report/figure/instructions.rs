//! Histograms of the instructions that the tasks took.

use pil::instructions::{Histogram, Instructions, most};
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::canvas::Area;
use plot::figure::figure;
use plot::style::{MAIN, WIDTH};

/// About the number of bars across a panel.
const BARS: f64 = 100.0;
const PANEL: i32 = 190;
/// Where the count axis begins, so that a count of 1 has a bar.
const LEAST: f64 = 0.5;

/// Left end, right end and height of a bar.
type Bar = (f64, f64, f64);

/// The figure: a row for each run, named on the left; there the control task, on the right the PWM
/// task.
pub fn draw(runs: &[(&str, &Instructions)]) -> String {
    let heading = "Instructions of the control task (left) and of the PWM task (right)";
    figure(heading, &[], stack_height(runs.len(), PANEL), |area| {
        let (left, right) = area.split_right(WIDTH / 2);
        let control: Vec<Row> = runs
            .iter()
            .map(|(title, run)| Row {
                caption: (*title).to_owned(),
                histogram: &run.control,
            })
            .collect();
        column(&left, "instructions of a control task", &control);
        let pwm: Vec<Row> = runs
            .iter()
            .map(|(_, run)| Row {
                caption: format!(
                    "greatest: {} (left), {} (right)",
                    most(&run.control),
                    most(&run.pwm)
                ),
                histogram: &run.pwm,
            })
            .collect();
        column(&right, "instructions of a PWM task", &pwm)
    })
}

struct Row<'a> {
    caption: String,
    histogram: &'a Histogram,
}

/// The histograms of one task on common axes.
fn column(area: &Area, name: &str, rows: &[Row]) {
    let all = rows.iter().flat_map(|row| row.histogram);
    let x = Axis::around(name, all.map(|entry| f64::from(entry.0)), 9);
    let width = ((x.high - x.low) / BARS).floor().max(1.0);
    let bars: Vec<Vec<Bar>> = rows.iter().map(|row| bars(row.histogram, width)).collect();
    let counts = bars.iter().flatten().map(|bar| bar.2);
    let y = Axis::decades("count", counts.chain([LEAST, 1.0]), 4);
    let panels = stack(area, rows.len(), PANEL, name);
    for (((area, name), row), bars) in panels.iter().zip(rows).zip(&bars) {
        let panel = Axes::new(area, (&row.caption, ""), x.named(name), y.clone());
        panel.bars(bars, MAIN.colour);
    }
}

/// The histogram in bins of the given width: bars around the values, and their counts.
fn bars(histogram: &[(u32, u64)], width: f64) -> Vec<Bar> {
    let mut bars: Vec<Bar> = Vec::new();
    for &(value, count) in histogram {
        let left = (f64::from(value) / width).floor() * width - 0.5;
        match bars.last_mut() {
            Some(bar) if bar.0 == left => bar.2 += count as f64,
            _ => bars.push((left, left + width, count as f64)),
        }
    }
    bars
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_keep_the_counts() {
        let histogram = [(10, 3), (11, 1), (14, 5), (20, 2)];
        assert_eq!(bars(&histogram, 1.0).len(), 4);
        assert_eq!(
            bars(&histogram, 4.0),
            [(7.5, 11.5, 4.0), (11.5, 15.5, 5.0), (19.5, 23.5, 2.0)]
        );
    }
}
