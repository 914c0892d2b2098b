//! What all figures have in common: size, colours, lines, fonts, heading and legend.

use crate::report::text::wrap;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width of a figure in units of the drawing; its coordinates are whole units, so there are two a pixel.
pub const WIDTH: u32 = 1600;
/// Units of the drawing in a CSS pixel.
pub const UNITS_PER_PIXEL: u32 = 2;

/// Where a figure or a part of it is drawn.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Height of an axis label.
pub const TICK_FONT: u32 = 24;
/// Height of other text.
pub const TEXT_FONT: u32 = 25;
const HEADING_FONT: u32 = 30;
/// Width of a character over the font's height, not less than common sans-serif fonts need.
const CHARACTER_WIDTH: f64 = 0.6;

/// Colour of text and axes.
pub const INK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
/// Colour of text that only helps.
pub const FAINT_INK: RGBColor = RGBColor(0x59, 0x59, 0x59);
/// Colour of grid lines.
pub const GRID: RGBColor = RGBColor(0xe3, 0xe3, 0xe3);
/// Colour of a shaded band.
pub const BAND: RGBColor = RGBColor(0xd5, 0xdc, 0xe8);

/// A line's look. A dashed one has a colour of its own, by which its dashes are set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Colour, which also differs in lightness.
    pub colour: RGBColor,
    /// Width in units of the drawing.
    pub width: u32,
    /// SVG's `stroke-dasharray`; empty for a solid line.
    pub dashes: &'static str,
}

const fn line(colour: RGBColor, width: u32, dashes: &'static str) -> Line {
    Line {
        colour,
        width,
        dashes,
    }
}

/// The motion with dither, and any single curve.
pub const MAIN: Line = line(RGBColor(0x12, 0x3f, 0x8c), 3, "");
/// The motion without dither beside one with it.
pub const OTHER: Line = line(RGBColor(0x8a, 0x86, 0x82), 3, "3 5");
/// The motion without dither in a panel of its own.
pub const ALONE: Line = line(RGBColor(0x6b, 0x68, 0x66), 2, "");
/// A limit.
pub const LIMIT: Line = line(RGBColor(0xb3, 0x1b, 0x1b), 3, "18 8");
/// An instant.
pub const INSTANT: Line = line(RGBColor(0x40, 0x40, 0x41), 2, "10 5 3 5");
/// Runs that share a panel.
pub const RUNS: [Line; 6] = [
    line(RGBColor(0x10, 0x2a, 0x5c), 3, ""),
    line(RGBColor(0xc2, 0x6a, 0x00), 3, "14 6"),
    line(RGBColor(0x2e, 0x8b, 0x57), 3, "4 5"),
    line(RGBColor(0x7a, 0x4f, 0xb5), 3, "20 6 4 6"),
    line(RGBColor(0x59, 0xa5, 0xd8), 4, ""),
    line(RGBColor(0x5e, 0x5e, 0x60), 3, "8 4"),
];

/// A level to compare with.
pub const LEVEL: Line = line(RGBColor(0x77, 0x77, 0x7a), 2, "");
/// Series of dots that share a panel. A line of this look is drawn as a piece between each two of its points, as long as a dot
/// where they coincide.
pub const DOTS: [Line; 4] = [
    line(RGBColor(0x10, 0x2b, 0x5d), 3, ""),
    line(RGBColor(0xc9, 0x6f, 0x04), 3, ""),
    line(RGBColor(0x2f, 0x8c, 0x58), 3, ""),
    line(RGBColor(0x7b, 0x50, 0xb6), 3, ""),
];

impl From<Line> for ShapeStyle {
    fn from(line: Line) -> Self {
        ShapeStyle {
            color: line.colour.to_rgba(),
            filled: false,
            stroke_width: line.width,
        }
    }
}

/// What a legend shows of an entry.
#[derive(Debug, Clone, Copy)]
pub enum Sample {
    /// A piece of line.
    Line(Line),
    /// A dot.
    Dot(Line),
    /// A piece of shaded band.
    Band,
    /// A piece of an area of this colour.
    Shade(RGBColor),
}

/// Text of the given height and colour, placed by its left end and middle height.
pub fn text(height: u32, colour: RGBColor) -> TextStyle<'static> {
    // The SVG backend divides the height by 1.24.
    ("sans-serif", f64::from(height) * 1.24)
        .into_font()
        .color(&colour)
        .pos(Pos::new(HPos::Left, VPos::Center))
}

/// Width of a text of the given height, rather too great than too small.
pub fn text_width(text: &str, height: u32) -> i32 {
    (text.chars().count() as f64 * f64::from(height) * CHARACTER_WIDTH).ceil() as i32
}

const MARGIN: i32 = 12;
const HEADING_STEP: i32 = 38;
const LEGEND_STEP: i32 = 36;
const SAMPLE_WIDTH: i32 = 76;

/// A figure: heading and legend, and below them an area of the given height, on which `paint` draws.
pub fn figure(
    heading: &str,
    legend: &[(String, Sample)],
    height: u32,
    paint: impl FnOnce(&Area) -> anyhow::Result<()>,
) -> anyhow::Result<String> {
    let usable = WIDTH as i32 - 2 * MARGIN;
    let characters = f64::from(usable) / (f64::from(HEADING_FONT) * CHARACTER_WIDTH);
    let heading_lines = wrap(heading, characters as usize);
    let places = legend_places(legend, usable);
    let rows = places.last().map_or(0, |(_, row)| row + 1);
    let legend_top = MARGIN + HEADING_STEP * heading_lines.len() as i32;
    let top = legend_top + LEGEND_STEP * rows + MARGIN / 2;
    let size = (WIDTH, top as u32 + height);

    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let mut heading_style = text(HEADING_FONT, INK);
        heading_style.font = heading_style.font.style(FontStyle::Bold);
        for (n, line) in heading_lines.iter().enumerate() {
            let middle = MARGIN + HEADING_STEP * n as i32 + HEADING_STEP / 2;
            root.draw_text(line, &heading_style, (MARGIN, middle))?;
        }
        for ((label, sample), (x, row)) in legend.iter().zip(places) {
            let at = (MARGIN + x, legend_top + LEGEND_STEP * row + LEGEND_STEP / 2);
            legend_entry(&root, label, *sample, at)?;
        }
        paint(&root.margin(top, 0, 0, 0))?;
        root.present()?;
    }
    Ok(finish(&svg, size, heading))
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

fn legend_entry(
    area: &Area,
    label: &str,
    sample: Sample,
    (x, y): (i32, i32),
) -> anyhow::Result<()> {
    match sample {
        Sample::Line(line) => {
            area.draw(&PathElement::new([(x, y), (x + SAMPLE_WIDTH, y)], line))?;
        }
        Sample::Dot(line) => {
            let style = ShapeStyle::from(line).filled();
            area.draw(&Circle::new((x + SAMPLE_WIDTH - 12, y), 5, style))?;
        }
        Sample::Band => shade(area, (x, y), BAND)?,
        Sample::Shade(colour) => shade(area, (x, y), colour)?,
    }
    let style = text(TEXT_FONT, INK);
    area.draw_text(label, &style, (x + SAMPLE_WIDTH + 12, y))?;
    Ok(())
}

fn shade(area: &Area, (x, y): (i32, i32), colour: RGBColor) -> anyhow::Result<()> {
    let corners = [(x, y - 12), (x + SAMPLE_WIDTH, y + 12)];
    area.draw(&Rectangle::new(corners, colour.filled()))?;
    Ok(())
}

/// What the backend cannot write: size in pixels, title for screen readers, dashes.
fn finish(svg: &str, (width, height): (u32, u32), title: &str) -> String {
    let body = svg.split_once('>').map_or("", |(_, body)| body);
    let title = maud::html!(title { (title) }).into_string();
    let mut out = format!(
        "<svg width=\"{}\" height=\"{}\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
         stroke-linejoin=\"round\" xmlns=\"http://www.w3.org/2000/svg\">\n{title}{}",
        width / UNITS_PER_PIXEL,
        height / UNITS_PER_PIXEL,
        body.replace(" opacity=\"1\"", "")
    );
    for line in [OTHER, LIMIT, INSTANT].iter().chain(&RUNS) {
        if !line.dashes.is_empty() {
            let RGBColor(r, g, b) = line.colour;
            let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\"");
            let dashed = format!("{stroke} stroke-dasharray=\"{}\"", line.dashes);
            out = out.replace(&stroke, &dashed);
        }
    }
    for line in DOTS {
        out = dotted(&out, line);
    }
    out
}

/// The drawing with each polyline of a look turned into pieces between each two of its points, with round ends.
fn dotted(svg: &str, line: Line) -> String {
    let RGBColor(r, g, b) = line.colour;
    let start = format!("<polyline fill=\"none\" stroke=\"#{r:02X}{g:02X}{b:02X}\"");
    let mut parts = svg.split(&start);
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (width, rest) = part.split_once(" points=\"").unwrap_or((part, ""));
        let (points, rest) = rest.split_once('"').unwrap_or(("", rest));
        let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\"{width}");
        out += &format!("<path fill=\"none\" {stroke} stroke-linecap=\"round\" d=\"");
        let mut points = points.split_ascii_whitespace();
        while let (Some(from), Some(to)) = (points.next(), points.next()) {
            match to.split_once(',') {
                Some((_, y)) if from != to => out += &format!("M{from}V{y}"),
                _ => out += &format!("M{from}h0"),
            }
        }
        out += "\"";
        out += rest;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_lines_have_the_same_colour() {
        let lines: Vec<Line> = [MAIN, OTHER, ALONE, LIMIT, INSTANT, LEVEL]
            .into_iter()
            .chain(RUNS)
            .chain(DOTS)
            .collect();
        for (n, line) in lines.iter().enumerate() {
            assert!(lines[..n].iter().all(|other| other.colour != line.colour));
            assert!([INK, FAINT_INK, GRID].iter().all(|c| *c != line.colour));
        }
    }

    #[test]
    fn a_dashed_line_is_dashed_in_legend_and_figure() {
        let legend = [("limit".to_owned(), Sample::Line(LIMIT))];
        let svg = figure("heading", &legend, 100, |area| {
            area.draw(&PathElement::new([(0, 0), (9, 9)], LIMIT))?;
            Ok(())
        })
        .unwrap();
        assert_eq!(svg.matches("stroke-dasharray=\"18 8\"").count(), 2);
    }

    #[test]
    fn dots_are_pieces_of_a_path() {
        let svg = figure("heading", &[], 100, |area| {
            area.draw(&PathElement::new(
                [(1, 2), (1, 2), (4, 6), (4, 10)],
                DOTS[0],
            ))?;
            Ok(())
        })
        .unwrap();
        assert!(!svg.contains("<polyline"), "{svg}");
        let path = svg.split("d=\"").nth(1).unwrap();
        let pieces = path.split('"').next().unwrap();
        assert_eq!(pieces.matches("h0M").count(), 1, "{pieces}");
        assert_eq!(pieces.matches('V').count(), 1, "{pieces}");
    }

    #[test]
    fn a_long_legend_takes_several_rows() {
        let entry = |_| ("w".repeat(40), Sample::Band);
        let legend: Vec<_> = (0..5).map(entry).collect();
        let places = legend_places(&legend, 1576);
        assert_eq!(places.last().unwrap().1, 2);
    }
}
