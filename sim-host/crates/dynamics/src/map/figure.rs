//! Exponent, period and extent of the motion over wheel speed and dither amplitude.

use crate::map::cell::{Cell, Kind};
use crate::map::curves::curves;
use crate::map::plan::{Grid, Plan, Sheet, Start};
use plot::axes::{Axes, CAPTION, TICKS_AND_NAME};
use plot::axis::{Axis, bounds};
use plot::canvas::{Area, Colour, Line, TextStyle};
use plot::colour_scale::{BAR, ColourScale, TICK};
use plot::figure::figure;
use plot::raster::Raster;
use plot::style::{INK, TICK_FONT, WIDTH};
use shared_model::dither::Waveform;
use shared_model::listed;

const PANEL_HEIGHT: i32 = 440;
const TICKS_ACROSS: usize = 6;
const TICKS_UP: usize = 6;
/// Room beside a row of panels for its scale or key.
const BESIDE: i32 = 184;
/// Distance of two shades in the key.
const KEY_STEP: usize = 46;
/// Curves of bifurcations, with a light edge on dark cells.
const CURVE: Line = Line::solid(Colour(0xc4, 0x14, 0x14), 4);
const CURVE_EDGE: Line = Line::solid(Colour(0xfe, 0xfd, 0xfd), 8);
/// Cells without the number that a panel shows.
const NONE: Colour = Colour(0x2a, 0x2a, 0x2b);
/// Exponents are drawn down to this multiple of the greatest: how fast a motion settles is not the
/// matter.
const LEAST_EXPONENT_SHARE: f64 = -1.0;
/// Share of exponents beyond the ends of their scale.
const BEYOND: f64 = 0.002;
/// Periods with a shade of their own.
const PERIODS: u32 = 4;

listed! {
    /// What a row of panels shows.
    #[derive(Clone, Copy)]
    enum Shown {
        Exponent => "exponent (1/s)",
        Period => "period",
        YawRate => "yaw rate (rad/s)",
    }
}

impl Shown {
    fn number(self, cell: &Cell) -> Option<f64> {
        match self {
            Self::Exponent => shown_exponent(cell),
            Self::Period => None,
            Self::YawRate => cell.yaw_rate_peak_to_peak_rad_per_s,
        }
    }

    /// The scale of its numbers; the period has classes instead.
    fn scale(self, cells: &[Cell]) -> Option<ColourScale> {
        let numbers = cells.iter().filter_map(|cell| self.number(cell));
        match self {
            Self::Period => None,
            Self::Exponent => {
                let mut numbers: Vec<f64> = numbers.collect();
                numbers.sort_by(f64::total_cmp);
                let last = numbers.len() as f64 * (1.0 - BEYOND);
                let high = numbers.get(last as usize).copied();
                let high = high.unwrap_or(0.0).max(1e-3);
                let axis = Axis::linear("", LEAST_EXPONENT_SHARE * high, high, TICKS_UP);
                let zero = axis.fraction(0.0);
                // Blue below zero, where motions repeat, from there on by red to dark.
                Some(ColourScale::new(
                    axis,
                    vec![
                        (0.0, Colour(0xfb, 0xfc, 0xfe)),
                        (0.8 * zero, Colour(0xc2, 0xd8, 0xee)),
                        (zero, Colour(0xa0, 0xc1, 0xe2)),
                        (zero + 0.04, Colour(0xd9, 0x82, 0x4a)),
                        (0.5 + 0.5 * zero, Colour(0xa8, 0x2f, 0x30)),
                        (1.0, Colour(0x35, 0x0a, 0x2c)),
                    ],
                ))
            }
            Self::YawRate => {
                let high = bounds(numbers).map_or(1.0, |(_, high)| high);
                let axis = Axis::linear("", 0.0, high, TICKS_UP);
                Some(ColourScale::new(
                    axis,
                    vec![
                        (0.0, Colour(0xfd, 0xfb, 0xe6)),
                        (0.25, Colour(0xc5, 0xe2, 0xb0)),
                        (0.5, Colour(0x5f, 0xb3, 0xa5)),
                        (0.75, Colour(0x2d, 0x74, 0x93)),
                        (1.0, Colour(0x1d, 0x1d, 0x52)),
                    ],
                ))
            }
        }
    }
}

/// The exponent, 1/s; at most zero unless it counts as positive, so that scatter about zero is not
/// taken for chaos.
fn shown_exponent(cell: &Cell) -> Option<f64> {
    let (exponent, threshold) = (cell.exponent_per_s?, cell.exponent_threshold_per_s?);
    let positive = exponent > threshold;
    Some(if positive {
        exponent
    } else {
        exponent.min(0.0)
    })
}

/// What the panel of the period tells apart, from light to dark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Rest,
    Period(u32),
    Higher,
    Undecided,
    Chaos,
    Diverges,
}

impl Class {
    fn of(cell: &Cell) -> Self {
        match (cell.kind, cell.period) {
            (Kind::Equilibrium, _) => Self::Rest,
            (Kind::Periodic, Some(period)) if period <= PERIODS => Self::Period(period),
            (Kind::Periodic, _) => Self::Higher,
            (Kind::Chaos, _) => Self::Chaos,
            (Kind::Undecided, _) => Self::Undecided,
            (Kind::Diverges, _) => Self::Diverges,
        }
    }

    fn all() -> impl Iterator<Item = Self> {
        let periods = (1..=PERIODS).map(Self::Period);
        let rest = std::iter::once(Self::Rest);
        let others = [Self::Higher, Self::Undecided, Self::Chaos, Self::Diverges];
        rest.chain(periods).chain(others)
    }

    fn name(self) -> String {
        match self {
            Self::Rest => "at rest".into(),
            Self::Period(period) => format!("period {period}"),
            Self::Higher => format!("period {}+", PERIODS + 1),
            Self::Undecided => "undecided".into(),
            Self::Chaos => "chaos".into(),
            Self::Diverges => "diverges".into(),
        }
    }

    fn colour(self) -> Colour {
        match self {
            Self::Rest => Colour(0xfb, 0xfb, 0xf2),
            Self::Period(1) => Colour(0xc7, 0xe0, 0xf5),
            Self::Period(2) => Colour(0x90, 0xcb, 0xa0),
            Self::Period(3) => Colour(0xd9, 0x8a, 0x30),
            Self::Period(_) => Colour(0x3f, 0x7f, 0xb5),
            Self::Higher => Colour(0x74, 0x48, 0x9a),
            Self::Undecided => Colour(0x47, 0x47, 0x43),
            Self::Chaos => Colour(0x4a, 0x10, 0x26),
            Self::Diverges => Colour(0x0c, 0x0c, 0x0c),
        }
    }
}

/// The map as an SVG document: a column of panels for each sheet side by side with that of another
/// waveform from the same start, the starts below each other. `cells` are all of the plan, in its
/// order. Over the periods are the period doublings and folds by continuation.
pub fn draw(plan: &Plan, cells: &[Cell]) -> String {
    let sheets: Vec<(&Sheet, &[Cell])> = plan
        .sheets
        .iter()
        .zip(cells.chunks(cells.len() / plan.sheets.len()))
        .collect();
    let blocks: Vec<_> = sheets.chunk_by(|a, b| a.0.start == b.0.start).collect();
    let rows = (blocks.len() * Shown::ALL.len()) as i32;
    let height = rows * (CAPTION + PANEL_HEIGHT + TICKS_AND_NAME);
    let heading = "Largest Lyapunov exponent, period, and peak-to-peak yaw rate";
    figure(heading, &[], height, |area| {
        let mut rest = *area;
        for block in &blocks {
            for shown in Shown::ALL {
                let (row, below) = rest.split_below(CAPTION + PANEL_HEIGHT + TICKS_AND_NAME);
                draw_row(&row, plan, block, shown, shown.scale(cells));
                rest = below;
            }
        }
    })
}

fn draw_row(
    row: &Area,
    plan: &Plan,
    sheets: &[(&Sheet, &[Cell])],
    shown: Shown,
    scale: Option<ColourScale>,
) {
    let (panels, beside) = row.split_right(WIDTH - BESIDE);
    for ((sheet, cells), area) in sheets.iter().zip(panels.columns(sheets.len())) {
        let (x, y) = axes(plan, sheet);
        let (from, to) = ((x.low, y.low), (x.high, y.high));
        let curves_too = match shown {
            Shown::Period => "; red: period doubling, fold",
            Shown::Exponent | Shown::YawRate => "",
        };
        let caption = format!("{}: {}{curves_too}", name(sheet), shown.name());
        let panel = Axes::new(&area, (&caption, ""), x, y);
        let colour = |cell: &Cell| match &scale {
            Some(scale) => shown
                .number(cell)
                .map_or(NONE, |number| scale.colour(number)),
            None => Class::of(cell).colour(),
        };
        panel.raster(from, to, &raster(sheet, cells, colour));
        if matches!(shown, Shown::Period) {
            for curve in curves(plan, sheet, cells) {
                panel.lines(&[(&curve, CURVE_EDGE), (&curve, CURVE)]);
            }
        }
    }
    let ends = (CAPTION, CAPTION + PANEL_HEIGHT);
    match &scale {
        Some(scale) => scale.bar(&beside, ends),
        None => key(&beside, ends.0),
    }
}

/// The shades of all classes at the left end of an area, from a height down.
fn key(area: &Area, top: i32) {
    for (class, y) in Class::all().zip((top..).step_by(KEY_STEP)) {
        let corners = [(0, y), (BAR, y + BAR)];
        area.rectangle(corners, class.colour());
        area.frame(corners, Line::solid(INK, 2));
        let place = (BAR + 2 * TICK, y + BAR / 2);
        area.text(&class.name(), place, TextStyle::new(TICK_FONT, INK));
    }
}

fn name(sheet: &Sheet) -> String {
    let waveform = match sheet.waveform {
        Waveform::Sine => "sine",
        Waveform::Square | Waveform::None => "square",
    };
    match sheet.start {
        Start::Given => waveform.into(),
        Start::Mirrored => format!("{waveform} mirrored"),
    }
}

/// Axes that end at the outer edges of the cells.
fn axes(plan: &Plan, sheet: &Sheet) -> (Axis, Axis) {
    let ends = |grid: &Grid| {
        // A single row or column has no neighbour to share the room with.
        let half = match grid.count {
            1 => (0.005 * grid.from.abs()).max(0.001),
            _ => 0.5 * grid.step(),
        };
        (grid.from - half, grid.to + half)
    };
    let (left, right) = ends(&plan.speeds_rpm);
    let (low, high) = ends(&sheet.amplitudes_v);
    (
        Axis::linear("wheel speed N (rpm)", left, right, TICKS_ACROSS),
        Axis::linear("amplitude W (V)", low, high, TICKS_UP),
    )
}

/// The cells of a sheet, which go up its columns, in rows from the top.
fn raster(sheet: &Sheet, cells: &[Cell], colour: impl Fn(&Cell) -> Colour) -> Raster {
    let rows = sheet.amplitudes_v.count;
    let width = cells.len() / rows;
    let row = |up: usize| (0..width).map(move |column| column * rows + up);
    let order = (0..rows).rev().flat_map(row);
    Raster {
        width,
        colours: order.map(|k| colour(&cells[k])).collect(),
    }
}
