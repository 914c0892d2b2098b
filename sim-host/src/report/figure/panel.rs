//! One pair of axes and what is drawn between them.

use super::axis::Axis;
use super::reduce::Point;
use super::style::{
    Area, BAND, FAINT_INK, GRID, INK, Line, TEXT_FONT, TICK_FONT, UNITS_PER_PIXEL, text, text_width,
};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::collections::BTreeSet;

/// Height of the line above a panel that holds its caption.
pub const CAPTION: u32 = 42;
/// Height below a panel that its tick labels need.
pub const TICKS: u32 = 44;
/// Height below a panel that its tick labels and its axis name need.
pub const TICKS_AND_NAME: u32 = 86;
/// Room at the left that accents of the axis name may need.
const MARGIN: u32 = 12;
const LEFT: u32 = 128;
/// Room left of a panel's axes.
pub const BESIDE: u32 = MARGIN + LEFT;
/// Room right of a panel's axes.
pub const RIGHT: u32 = 36;
const TICK: i32 = 7;
const FEW_DOTS: usize = 1500;

/// Height of a stack of panels of the given height, only the last of which names its horizontal axis.
pub fn stack_height(panels: usize, height: u32) -> u32 {
    (CAPTION + height + TICKS) * panels as u32 + (TICKS_AND_NAME - TICKS)
}

/// The areas of a stack of panels from the top, and the horizontal axis' name for each.
pub fn stack<'a, 'n>(
    area: &Area<'a>,
    panels: usize,
    height: u32,
    name: &'n str,
) -> Vec<(Area<'a>, &'n str)> {
    let mut rest = area.clone();
    let mut rows = Vec::with_capacity(panels);
    for _ in 1..panels {
        let (row, below) = rest.split_vertically(CAPTION + height + TICKS);
        rows.push((row, ""));
        rest = below;
    }
    if panels > 0 {
        rows.push((rest, name));
    }
    rows
}

/// A pair of axes. Points are given as values; what lies beyond the axes is drawn on their ends.
pub struct Panel<'a> {
    chart: ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>,
    x: Axis,
    y: Axis,
}

impl<'a> Panel<'a> {
    /// Axes and grid on the area; above them a caption, shortened if it must be, and at the right end
    /// a fainter remark.
    pub fn new(
        area: &Area<'a>,
        (caption, remark): (&str, &str),
        x: Axis,
        y: Axis,
    ) -> anyhow::Result<Self> {
        let below = if x.name.is_empty() {
            TICKS
        } else {
            TICKS_AND_NAME
        };
        let mut chart = ChartBuilder::on(area)
            .margin_top(CAPTION)
            .margin_left(MARGIN)
            .margin_right(RIGHT)
            .y_label_area_size(LEFT)
            .x_label_area_size(below)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        if !x.name.is_empty() {
            mesh.x_desc(&x.name);
        }
        mesh.y_desc(&y.name)
            .label_style(text(TICK_FONT, INK))
            .axis_desc_style(text(TEXT_FONT, INK))
            .axis_style(INK.stroke_width(2))
            .bold_line_style(GRID.stroke_width(1))
            .set_all_tick_mark_size(TICK)
            .draw()?;
        let panel = Self { chart, x, y };
        let width = panel.chart.plotting_area().dim_in_pixel().0 as i32;
        let remark_width = text_width(remark, TICK_FONT);
        let caption = shortened(caption, width - remark_width);
        panel.text_above(panel.x.low, HPos::Left, &caption, text(TEXT_FONT, INK))?;
        let style = text(TICK_FONT, FAINT_INK);
        panel.text_above(panel.x.high, HPos::Right, remark, style)?;
        Ok(panel)
    }

    /// Width and height of the axes over their extents: in their values, or decades on a logarithmic axis.
    pub fn units_per_place(&self) -> Point {
        let (width, height) = self.chart.plotting_area().dim_in_pixel();
        let extent = |axis: &Axis| axis.ends().1 - axis.ends().0;
        (
            f64::from(width) / extent(&self.x),
            f64::from(height) / extent(&self.y),
        )
    }

    /// Dots, those in the same pixel once: as small as the line is wide, or twice as large where they are few.
    pub fn dots(&self, points: &[Point], line: Line) -> anyhow::Result<()> {
        let area = self.chart.plotting_area();
        let places = points.iter().map(|point| area.map_coordinate(point));
        let runs = pixel_runs(places);
        if !runs.is_empty() {
            let (left, top) = area.get_base_pixel();
            let ends: Vec<(i32, i32)> = runs
                .iter()
                .flat_map(|&(x, from, to)| [(x - left, from - top), (x - left, to - top)])
                .collect();
            let width = if runs.len() < FEW_DOTS {
                2 * line.width
            } else {
                line.width
            };
            area.strip_coord_spec()
                .draw(&PathElement::new(ends, Line { width, ..line }))?;
        }
        Ok(())
    }

    /// Lines through the points of each curve; says "no data" if none has two of them.
    pub fn lines(&self, curves: &[(&[Point], Line)]) -> anyhow::Result<()> {
        let area = self.chart.plotting_area();
        if curves.iter().all(|(points, _)| points.len() < 2) {
            return self.no_data();
        }
        for (points, line) in curves {
            if points.len() > 1 {
                area.draw(&PathElement::new(*points, *line))?;
            }
        }
        Ok(())
    }

    /// A dot.
    pub fn dot(&self, point: Point, line: Line) -> anyhow::Result<()> {
        let style = ShapeStyle::from(line).filled();
        let area = self.chart.plotting_area();
        area.draw(&Circle::new(point, 9, style))?;
        Ok(())
    }

    /// A line across the panel at a value of the vertical axis.
    pub fn level(&self, value: f64, line: Line) -> anyhow::Result<()> {
        let area = self.chart.plotting_area();
        let ends = [(self.x.low, value), (self.x.high, value)];
        area.draw(&PathElement::new(ends, line))?;
        Ok(())
    }

    /// A line down the panel at a value of the horizontal axis, if it lies within.
    pub fn instant(&self, value: f64, line: Line) -> anyhow::Result<()> {
        if value >= self.x.low && value <= self.x.high {
            let area = self.chart.plotting_area();
            let ends = [(value, self.y.low), (value, self.y.high)];
            area.draw(&PathElement::new(ends, line))?;
        }
        Ok(())
    }

    /// A text above the panel at a value of the horizontal axis, if it lies within.
    pub fn instant_label(&self, value: f64, label: &str) -> anyhow::Result<()> {
        if value < self.x.low || value > self.x.high {
            return Ok(());
        }
        self.text_above(value, HPos::Center, label, text(TEXT_FONT, INK))
    }

    /// A shaded band over a range of the horizontal axis.
    pub fn band(&self, from: f64, to: f64) -> anyhow::Result<()> {
        self.block((from, self.y.low), (to, self.y.high), BAND)
    }

    /// Filled rectangles from the lower end of the vertical axis up: left, right, value.
    pub fn bars(&self, bars: &[(f64, f64, f64)], colour: RGBColor) -> anyhow::Result<()> {
        if bars.is_empty() {
            return self.no_data();
        }
        for &(left, right, value) in bars {
            self.block((left, self.y.low), (right, value), colour)?;
        }
        Ok(())
    }

    fn text_above(
        &self,
        value: f64,
        anchor: HPos,
        text: &str,
        style: TextStyle,
    ) -> anyhow::Result<()> {
        if text.is_empty() {
            return Ok(());
        }
        let area = self.chart.plotting_area();
        let x = area.map_coordinate(&(value, self.y.high)).0 - area.get_base_pixel().0;
        let style = style.pos(Pos::new(anchor, VPos::Center));
        let at = (x, -(CAPTION as i32) / 2);
        area.strip_coord_spec().draw_text(text, &style, at)?;
        Ok(())
    }

    /// Says in the panel's middle that there is nothing to show.
    pub fn no_data(&self) -> anyhow::Result<()> {
        let style = text(TEXT_FONT, FAINT_INK).pos(Pos::new(HPos::Center, VPos::Center));
        let area = self.chart.plotting_area().strip_coord_spec();
        let (width, height) = area.dim_in_pixel();
        let middle = (width as i32 / 2, height as i32 / 2);
        area.draw_text("no data", &style, middle)?;
        Ok(())
    }

    /// A filled rectangle between two points, cut at the horizontal axis' ends.
    pub fn block(&self, from: Point, to: Point, colour: RGBColor) -> anyhow::Result<()> {
        let (left, right) = (from.0.max(self.x.low), to.0.min(self.x.high));
        if left <= right {
            let area = self.chart.plotting_area();
            let corners = [(left, from.1), (right, to.1)];
            area.draw(&Rectangle::new(corners, colour.filled()))?;
        }
        Ok(())
    }
}

/// Vertical runs of pixels with a place in them: column, first row, last row.
fn pixel_runs(places: impl Iterator<Item = (i32, i32)>) -> Vec<(i32, i32, i32)> {
    let unit = UNITS_PER_PIXEL as i32;
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
        assert_eq!(shortened("caption", 60), "cap\u{2026}");
        assert_eq!(shortened("caption", 0), "");
    }
}
