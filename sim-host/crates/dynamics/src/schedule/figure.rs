//! The kinds of motion over wheel speed and dither amplitude, and the schedule through them.

use crate::schedule::Analysis;
use crate::schedule::cells::{Cell, Class, Column};
use plot::axes::{Axes, stack, stack_height};
use plot::axis::Axis;
use plot::canvas::{Colour, Line};
use plot::figure::{Sample, figure};
use plot::reduce::Point;
use shared_model::dither::Waveform;

const PANEL_HEIGHT: i32 = 480;
const TICKS_ACROSS: usize = 11;
const TICKS_UP: usize = 8;
/// Dark against all shades, on an edge that is light against them.
const SCHEDULE: Line = Line::solid(Colour(0xa3, 0x12, 0x12), 6);
const EDGE: Line = Line::solid(Colour(0xfe, 0xfe, 0xfe), 12);
/// Dashed, so that it is no edge of a shade.
const BOUND: Line = Line {
    colour: Colour(0x1f, 0x4e, 0x9c),
    width: 3,
    dashes: "18 8",
};
const COEXIST: Line = Line::solid(Colour(0x0a, 0x0a, 0x0a), 2);

/// Also grey in steps of lightness.
fn shade(class: Class) -> Colour {
    match class {
        Class::Rest => Colour(0xf6, 0xf6, 0xf1),
        Class::PeriodOne => Colour(0xc3, 0xdd, 0xf4),
        Class::PeriodN => Colour(0x9a, 0xa4, 0xb4),
        Class::NoPeriod => Colour(0x6a, 0x62, 0x70),
        Class::Diverges => Colour(0x2c, 0x2c, 0x2c),
    }
}

/// The map of each analysis with its schedule, as an SVG document.
pub fn draw(analyses: &[Analysis]) -> String {
    let heading = "Regime over wheel speed and dither amplitude, and the schedule";
    let height = stack_height(analyses.len(), PANEL_HEIGHT);
    figure(heading, &legend(analyses), height, |area| {
        let rows = stack(area, analyses.len(), PANEL_HEIGHT, "wheel speed (rpm)");
        for (analysis, (row, name)) in analyses.iter().zip(rows) {
            let caption = match analysis.waveform {
                Waveform::Sine => "sine: the worse regime of both initial states",
                Waveform::Square | Waveform::None => {
                    "square wave: the worse regime of both initial states"
                }
            };
            let (x, y) = axes(analysis, name);
            let panel = Axes::new(&row, (caption, ""), x, y);
            map(&panel, analysis);
            let [lower, upper] = bounds(analysis);
            panel.lines(&[(&lower, BOUND), (&upper, BOUND)]);
            let steps = steps(analysis);
            panel.lines(&[(&steps, EDGE), (&steps, SCHEDULE)]);
        }
    })
}

fn legend(analyses: &[Analysis]) -> Vec<(String, Sample)> {
    let cells = || analyses.iter().flat_map(cells);
    let seen = |class: &Class| cells().any(|cell| cell.class() == *class);
    let classes = Class::ALL.into_iter().filter(seen);
    let mut legend: Vec<_> = classes
        .map(|class| (class.name().to_owned(), Sample::Shade(shade(class))))
        .collect();
    if cells().any(Cell::coexist) {
        let label = "from one initial state to rest, not from the other";
        legend.push((label.into(), Sample::Line(COEXIST)));
    }
    if analyses.iter().any(|one| !one.margins.is_empty()) {
        let label = "bound of the multipliers";
        legend.push((label.into(), Sample::Line(BOUND)));
    }
    legend.push(("schedule".into(), Sample::Line(SCHEDULE)));
    legend
}

fn cells(analysis: &Analysis) -> impl Iterator<Item = &Cell> {
    analysis.columns.iter().flat_map(|column| &column.cells)
}

/// Half the distance of two columns, rpm.
fn half_column_rpm(analysis: &Analysis) -> f64 {
    match &analysis.columns[..] {
        [first, second, ..] => 0.5 * (second.wheel_speed_rpm - first.wheel_speed_rpm),
        _ => 0.5,
    }
}

fn axes(analysis: &Analysis, name: &str) -> (Axis, Axis) {
    let half = half_column_rpm(analysis);
    let speeds = || analysis.columns.iter().map(|column| column.wheel_speed_rpm);
    let first = speeds().fold(f64::INFINITY, f64::min);
    let last = speeds().fold(f64::NEG_INFINITY, f64::max);
    let top = cells(analysis).map(|cell| cell.amplitude_v);
    let top = top.fold(f64::MIN_POSITIVE, f64::max);
    (
        Axis::linear(name, first - half, last + half, TICKS_ACROSS),
        Axis::linear("dither amplitude (V)", 0.0, top, TICKS_UP),
    )
}

fn map(panel: &Axes, analysis: &Analysis) {
    let half = half_column_rpm(analysis);
    for column in &analysis.columns {
        let rpm = column.wheel_speed_rpm;
        for (from, to, class) in stretches(column, Cell::class) {
            panel.block((rpm - half, from), (rpm + half, to), shade(class));
        }
        for (from, to, coexist) in stretches(column, Cell::coexist) {
            if coexist && from < to {
                panel.lines(&[(&[(rpm, from), (rpm, to)], COEXIST)]);
            }
        }
    }
}

/// The stretches of a column in which its cells are alike; each cell reaches half way to its
/// neighbours.
fn stretches<K: PartialEq>(column: &Column, of: impl Fn(&Cell) -> K) -> Vec<(f64, f64, K)> {
    let cells = &column.cells;
    let mut stretches = Vec::new();
    let mut begin = 0;
    for end in 1..=cells.len() {
        if end < cells.len() && of(&cells[end]) == of(&cells[begin]) {
            continue;
        }
        let between =
            |above: usize| 0.5 * (cells[above - 1].amplitude_v + cells[above].amplitude_v);
        let from = if begin == 0 {
            cells[0].amplitude_v
        } else {
            between(begin)
        };
        let to = if end == cells.len() {
            cells[end - 1].amplitude_v
        } else {
            between(end)
        };
        stretches.push((from, to, of(&cells[begin])));
        begin = end;
    }
    stretches
}

/// Least and greatest amplitude at which the multipliers keep their bound, over the speed.
fn bounds(analysis: &Analysis) -> [Vec<Point>; 2] {
    let kept = |margin: &super::Margin| Some((margin.wheel_speed_rpm, margin.kept?));
    let kept: Vec<_> = analysis.margins.iter().filter_map(kept).collect();
    [
        kept.iter()
            .map(|(rpm, range)| (*rpm, range.from_v))
            .collect(),
        kept.iter().map(|(rpm, range)| (*rpm, range.to_v)).collect(),
    ]
}

/// The schedule as it is looked up: between two speeds the larger of their amplitudes.
fn steps(analysis: &Analysis) -> Vec<Point> {
    let pairs = analysis.entries.windows(2);
    let step = |pair: &[crate::schedule::choose::Entry]| {
        let amplitude_v = pair[0].amplitude_v.max(pair[1].amplitude_v);
        pair.iter()
            .map(|entry| (entry.wheel_speed_rpm, amplitude_v))
            .collect::<Vec<_>>()
    };
    pairs.flat_map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attractor::Kind;

    #[test]
    fn cells_reach_half_way_to_their_neighbours() {
        let cell = |(k, given)| Cell {
            wheel_speed_rpm: 1.0,
            amplitude_v: f64::from(k),
            given,
            mirrored: Kind::Equilibrium,
        };
        let (rest, one) = (Kind::Equilibrium, Kind::Periodic(1));
        let kinds = [(0, rest), (1, rest), (2, one), (4, one), (5, rest)];
        let column = Column {
            wheel_speed_rpm: 1.0,
            cells: kinds.map(cell).to_vec(),
        };
        assert_eq!(
            stretches(&column, Cell::coexist),
            [(0.0, 1.5, false), (1.5, 4.5, true), (4.5, 5.0, false)]
        );
    }
}
