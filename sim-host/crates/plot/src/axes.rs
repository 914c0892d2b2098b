//! A pair of axes and what is drawn between them.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Colour, Line, Place, TextStyle, UNITS_PER_PIXEL};
use crate::raster::Raster;
use crate::reduce::Point;
use crate::style::{BAND, FAINT_INK, GRID, INK, TEXT_FONT, TICK_FONT, text_width};
use std::collections::BTreeSet;

/// Height of the line above the axes that holds their caption.
pub const CAPTION: i32 = 42;
/// Height below the axes that their tick labels need.
pub const TICKS: i32 = 50;
/// Height below the axes that their tick labels and the name of the horizontal axis need.
pub const TICKS_AND_NAME: i32 = 90;
/// Room left of the axes, for tick labels and the name of the vertical axis.
pub const BESIDE: i32 = 140;
/// Room right of the axes.
pub const RIGHT: i32 = 36;
const TICK: i32 = 7;
/// Distance of a tick's label from the tick.
const LABEL_GAP: i32 = 8;
const FEW_DOTS: usize = 1500;

/// Height of a stack of axes of the given height, only the last of which name their horizontal
/// axis.
pub fn stack_height(panels: usize, height: i32) -> i32 {
    (CAPTION + height + TICKS) * panels as i32 + (TICKS_AND_NAME - TICKS)
}

/// The areas of a stack of axes from the top, and the name of the horizontal axis for each.
pub fn stack<'a, 'n>(
    area: &Area<'a>,
    panels: usize,
    height: i32,
    name: &'n str,
) -> Vec<(Area<'a>, &'n str)> {
    let mut rest = *area;
    let mut rows = Vec::with_capacity(panels);
    for _ in 1..panels {
        let (row, below) = rest.split_below(CAPTION + height + TICKS);
        rows.push((row, ""));
        rest = below;
    }
    if panels > 0 {
        rows.push((rest, name));
    }
    rows
}

/// A pair of axes. Points are given as values; what lies beyond the axes is drawn on their ends.
#[derive(Debug)]
pub struct Axes<'a> {
    /// Between the axes.
    area: Area<'a>,
    x: Axis,
    y: Axis,
}

impl<'a> Axes<'a> {
    /// Axes and grid on the area; above them a caption, shortened if it must be, and at the right
    /// end a fainter remark.
    pub fn new(area: &Area<'a>, (caption, remark): (&str, &str), x: Axis, y: Axis) -> Self {
        let below = if x.name.is_empty() {
            TICKS
        } else {
            TICKS_AND_NAME
        };
        let corner = (area.width() - RIGHT, area.height() - below);
        let axes = Self {
            area: area.part((BESIDE, CAPTION), corner),
            x,
            y,
        };
        axes.draw_grid();
        let names = TextStyle::new(TEXT_FONT, INK).anchored(Anchor::Middle);
        let centre = (axes.area.width() / 2, axes.area.height() / 2);
        let name_middle = axes.area.height() + TICKS_AND_NAME - 8 - TEXT_FONT as i32 / 2;
        axes.area.text(&axes.x.name, (centre.0, name_middle), names);
        let name_middle = -BESIDE + 6 + TEXT_FONT as i32 / 2;
        axes.area
            .upward_text(&axes.y.name, (name_middle, centre.1), names);

        let width = axes.area.width();
        let caption = shortened(caption, width - text_width(remark, TICK_FONT));
        axes.text_above(0, &caption, TextStyle::new(TEXT_FONT, INK));
        let style = TextStyle::new(TICK_FONT, FAINT_INK).anchored(Anchor::End);
        axes.text_above(width, remark, style);
        axes
    }

    fn draw_grid(&self) {
        let (width, height) = (self.area.width(), self.area.height());
        let (grid, ink) = (Line::solid(GRID, 1), Line::solid(INK, 2));
        let labels = TextStyle::new(TICK_FONT, INK);
        let columns = self.x.ticks.iter().map(|tick| (*tick, self.across(*tick)));
        let rows = self.y.ticks.iter().map(|tick| (*tick, self.down(*tick)));
        for (_, x) in columns.clone() {
            self.area.line([(x, 0), (x, height)], grid);
        }
        for (_, y) in rows.clone() {
            self.area.line([(0, y), (width, y)], grid);
        }
        self.area.line([(0, 0), (0, height), (width, height)], ink);
        for (tick, x) in columns {
            self.area.line([(x, height), (x, height + TICK)], ink);
            let middle = height + TICK + LABEL_GAP + TICK_FONT as i32 / 2;
            let style = labels.anchored(Anchor::Middle);
            self.area.text(&self.x.label(tick), (x, middle), style);
        }
        for (tick, y) in rows {
            self.area.line([(-TICK, y), (0, y)], ink);
            let style = labels.anchored(Anchor::End);
            let place = (-TICK - LABEL_GAP, y);
            self.area.text(&self.y.label(tick), place, style);
        }
    }

    fn across(&self, value: f64) -> i32 {
        self.x.unit(value, (0, self.area.width()))
    }

    fn down(&self, value: f64) -> i32 {
        self.y.unit(value, (self.area.height(), 0))
    }

    fn place(&self, point: Point) -> Place {
        (self.across(point.0), self.down(point.1))
    }

    /// Width and height of the axes over their extents: in their values, or decades on a
    /// logarithmic axis.
    pub fn units_per_place(&self) -> Point {
        let extent = |axis: &Axis| axis.ends().1 - axis.ends().0;
        (
            f64::from(self.area.width()) / extent(&self.x),
            f64::from(self.area.height()) / extent(&self.y),
        )
    }

    /// Dots, those in the same pixel once: as small as the line is wide, or twice as large where
    /// they are few.
    pub(crate) fn dots(&self, points: &[Point], line: Line) {
        let runs = pixel_runs(points.iter().map(|point| self.place(*point)));
        if runs.is_empty() {
            return;
        }
        let width = if runs.len() < FEW_DOTS {
            2 * line.width
        } else {
            line.width
        };
        self.area.strokes(&runs, Line { width, ..line });
    }

    /// Lines through the points of each curve, or `no data` if none has two of them.
    pub fn lines(&self, curves: &[(&[Point], Line)]) {
        if curves.iter().all(|(points, _)| points.len() < 2) {
            self.no_data();
        }
        for (points, line) in curves.iter().filter(|(points, _)| points.len() > 1) {
            self.area
                .line(points.iter().map(|point| self.place(*point)), *line);
        }
    }

    /// A dot.
    pub fn dot(&self, point: Point, line: Line) {
        self.area.circle(self.place(point), 9, line.colour);
    }

    /// A line across at a value of the vertical axis.
    pub fn level(&self, value: f64, line: Line) {
        let y = self.down(value);
        self.area.line([(0, y), (self.area.width(), y)], line);
    }

    /// A line down at a value of the horizontal axis, if it lies within.
    pub fn instant(&self, value: f64, line: Line) {
        if self.x.holds(value) {
            let x = self.across(value);
            self.area.line([(x, 0), (x, self.area.height())], line);
        }
    }

    /// A text above at a value of the horizontal axis, if it lies within.
    pub fn instant_label(&self, value: f64, label: &str) {
        if self.x.holds(value) {
            let style = TextStyle::new(TEXT_FONT, INK).anchored(Anchor::Middle);
            self.text_above(self.across(value), label, style);
        }
    }

    /// A shaded band over a range of the horizontal axis.
    pub fn band(&self, from: f64, to: f64) {
        self.block((from, self.y.low), (to, self.y.high), BAND);
    }

    /// Filled rectangles from the lower end of the vertical axis up: left, right, value.
    pub fn bars(&self, bars: &[(f64, f64, f64)], colour: Colour) {
        if bars.is_empty() {
            self.no_data();
        }
        for &(left, right, value) in bars {
            self.block((left, self.y.low), (right, value), colour);
        }
    }

    fn text_above(&self, x: i32, text: &str, style: TextStyle) {
        if !text.is_empty() {
            self.area.text(text, (x, -CAPTION / 2), style);
        }
    }

    /// `no data` in the middle.
    pub fn no_data(&self) {
        let style = TextStyle::new(TEXT_FONT, FAINT_INK).anchored(Anchor::Middle);
        let middle = (self.area.width() / 2, self.area.height() / 2);
        self.area.text("no data", middle, style);
    }

    /// A filled rectangle between two points, cut at the ends of the horizontal axis.
    pub fn block(&self, from: Point, to: Point, colour: Colour) {
        if let Some(corners) = self.corners(from, to) {
            self.area.rectangle(corners, colour);
        }
    }

    /// A raster between two points.
    pub fn raster(&self, from: Point, to: Point, raster: &Raster) {
        if let Some(corners) = self.corners(from, to) {
            self.area.image(corners, &raster.png());
        }
    }

    fn corners(&self, from: Point, to: Point) -> Option<[Place; 2]> {
        let (left, right) = (from.0.max(self.x.low), to.0.min(self.x.high));
        let corners = [self.place((left, from.1)), self.place((right, to.1))];
        (left <= right).then_some(corners)
    }
}

/// Vertical runs of pixels with a place in them: column, first row, last row.
fn pixel_runs(places: impl Iterator<Item = (i32, i32)>) -> Vec<(i32, i32, i32)> {
    let unit = UNITS_PER_PIXEL;
    let pixels: BTreeSet<(i32, i32)> = places
        .map(|(x, y)| (x.div_euclid(unit) * unit, y.div_euclid(unit) * unit))
        .collect();
    let mut runs: Vec<(i32, i32, i32)> = Vec::new();
    for (x, y) in pixels {
        match runs.last_mut() {
            Some(run) if run.0 == x && run.2 + unit == y => run.2 = y,
            _ => runs.push((x, y, y)),
        }
    }
    runs
}

/// The text with as many of its characters as the width takes, and an ellipsis for the others.
pub fn shortened(text: &str, width: i32) -> String {
    if text_width(text, TEXT_FONT) <= width {
        return text.into();
    }
    let mut short: Vec<char> = text.chars().collect();
    while !short.is_empty() {
        short.pop();
        let candidate: String = short.iter().chain(['\u{2026}'].iter()).collect();
        if text_width(&candidate, TEXT_FONT) <= width {
            return candidate;
        }
    }
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_in_one_pixel_count_once_and_neighbours_make_runs() {
        let places = [(4, 4), (5, 5), (4, 6), (4, 12), (8, 6), (4, 4)];
        assert_eq!(
            pixel_runs(places.into_iter()),
            [(4, 4, 6), (4, 12, 12), (8, 6, 6)]
        );
    }

    #[test]
    fn only_long_captions_are_shortened() {
        assert_eq!(shortened("caption", 200), "caption");
        assert_eq!(shortened("caption", 75), "cap\u{2026}");
        assert_eq!(shortened("caption", 0), "");
    }
}
