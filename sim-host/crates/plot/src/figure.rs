//! A figure: heading, legend, and the area below them.

use crate::canvas::{Area, Canvas, Colour, Line, Place, TextStyle};
use crate::style::{BAND, CHARACTER_WIDTH, HEADING_FONT, INK, TEXT_FONT, WIDTH, text_width};
use crate::text::wrap;

/// What a legend shows of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sample {
    /// A piece of line.
    Line(Line),
    /// A dot.
    Dot(Line),
    /// A piece of shaded band.
    Band,
    /// A piece of an area of this colour.
    Shade(Colour),
}

const MARGIN: i32 = 12;
const HEADING_STEP: i32 = 38;
const LEGEND_STEP: i32 = 36;
const SAMPLE_WIDTH: i32 = 76;

/// A figure as an SVG document: heading and legend, and below them an area of the given height, on
/// which `paint` draws.
pub fn figure(
    heading: &str,
    legend: &[(String, Sample)],
    height: i32,
    paint: impl FnOnce(&Area),
) -> String {
    let usable = WIDTH - 2 * MARGIN;
    let characters = f64::from(usable) / (f64::from(HEADING_FONT) * CHARACTER_WIDTH);
    let heading_lines = wrap(heading, characters as usize);
    let legend_top = MARGIN + HEADING_STEP * heading_lines.len() as i32;
    let top = legend_top + legend_height(legend) + MARGIN / 2;
    let size = (WIDTH, top + height + MARGIN / 2);

    let canvas = Canvas::default();
    let whole = canvas.area(size.0, size.1);
    let style = TextStyle {
        bold: true,
        ..TextStyle::new(HEADING_FONT, INK)
    };
    for (n, line) in heading_lines.iter().enumerate() {
        let middle = MARGIN + HEADING_STEP * n as i32 + HEADING_STEP / 2;
        whole.text(line, (MARGIN, middle), style);
    }
    draw_legend(&whole, legend, legend_top);
    paint(&whole.split_below(top).1);
    canvas.document(size, heading)
}

/// Height of a legend across a figure.
pub(crate) fn legend_height(legend: &[(String, Sample)]) -> i32 {
    let places = legend_places(legend, WIDTH - 2 * MARGIN);
    LEGEND_STEP * places.last().map_or(0, |(_, row)| row + 1)
}

/// Draws a legend across a figure from a height down.
pub(crate) fn draw_legend(area: &Area, legend: &[(String, Sample)], top: i32) {
    let places = legend_places(legend, WIDTH - 2 * MARGIN);
    for ((label, sample), (x, row)) in legend.iter().zip(places) {
        let place = (MARGIN + x, top + LEGEND_STEP * row + LEGEND_STEP / 2);
        legend_entry(area, label, *sample, place);
    }
}

/// Offset and row of each legend entry.
fn legend_places(legend: &[(String, Sample)], usable: i32) -> Vec<(i32, i32)> {
    let (mut x, mut row) = (0, 0);
    legend
        .iter()
        .map(|(label, _)| {
            let width = SAMPLE_WIDTH + 12 + text_width(label, TEXT_FONT) + 24;
            if x > 0 && x + width > usable {
                (x, row) = (0, row + 1);
            }
            let place = (x, row);
            x += width;
            place
        })
        .collect()
}

fn legend_entry(area: &Area, label: &str, sample: Sample, (x, y): Place) {
    let shade = |colour| area.rectangle([(x, y - 12), (x + SAMPLE_WIDTH, y + 12)], colour);
    match sample {
        Sample::Line(line) => area.line([(x, y), (x + SAMPLE_WIDTH, y)], line),
        Sample::Dot(line) => area.circle((x + SAMPLE_WIDTH - 12, y), 5, line.colour),
        Sample::Band => shade(BAND),
        Sample::Shade(colour) => shade(colour),
    }
    let style = TextStyle::new(TEXT_FONT, INK);
    area.text(label, (x + SAMPLE_WIDTH + 12, y), style);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::LIMIT;

    #[test]
    fn a_dashed_line_is_dashed_in_legend_and_figure() {
        let legend = [("limit".to_owned(), Sample::Line(LIMIT))];
        let svg = figure("heading", &legend, 100, |area| {
            area.line([(0, 0), (9, 9)], LIMIT);
        });
        assert_eq!(svg.matches("stroke-dasharray=\"18 8\"").count(), 2);
    }

    #[test]
    fn a_long_legend_takes_several_rows() {
        let entry = |_| ("n".repeat(40), Sample::Band);
        let legend: Vec<_> = (0..5).map(entry).collect();
        let places = legend_places(&legend, 1576);
        assert_eq!(places.last().unwrap().1, 2);
    }
}
