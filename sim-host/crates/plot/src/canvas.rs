//! Drawing in SVG: lines, rectangles, texts and rasters on an area of a figure, in whole units.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::cell::RefCell;
use std::fmt::Write;

/// Units of a drawing in a CSS pixel.
pub(crate) const UNITS_PER_PIXEL: i32 = 2;

/// A point of an area: units from its left and its upper end.
pub type Place = (i32, i32);

/// A colour: red, green, blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl std::fmt::Display for Colour {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{:02X}{:02X}{:02X}", self.0, self.1, self.2)
    }
}

/// The look of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line {
    /// Its colour.
    pub colour: Colour,
    /// Its width, units.
    pub width: u32,
    /// SVG's `stroke-dasharray`; empty for a solid line.
    pub dashes: &'static str,
}

impl Line {
    /// A solid line.
    pub const fn solid(colour: Colour, width: u32) -> Self {
        Self {
            colour,
            width,
            dashes: "",
        }
    }
}

/// The part of a text that stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

/// The look of a text, which is centred vertically on its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TextStyle {
    /// Height of the font, units.
    pub height: u32,
    /// Its colour.
    pub colour: Colour,
    /// What stands at the place.
    pub anchor: Anchor,
    /// Bold instead of regular.
    pub bold: bool,
}

impl TextStyle {
    /// A regular text whose left end stands at the place.
    pub const fn new(height: u32, colour: Colour) -> Self {
        Self {
            height,
            colour,
            anchor: Anchor::Start,
            bold: false,
        }
    }

    /// The same, anchored elsewhere.
    #[must_use]
    pub const fn anchored(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }
}

/// An SVG document in the making.
#[derive(Debug, Default)]
pub struct Canvas {
    body: RefCell<String>,
}

impl Canvas {
    /// The whole of it, of the given size.
    pub fn area(&self, width: i32, height: i32) -> Area<'_> {
        Area {
            canvas: self,
            left: 0,
            top: 0,
            width,
            height,
        }
    }

    /// The document, with a title for screen readers, on white ground.
    pub fn document(self, (width, height): (i32, i32), title: &str) -> String {
        format!(
            "<svg width=\"{}\" height=\"{}\" viewBox=\"0 0 {width} {height}\" role=\"img\" stroke-linejoin=\"round\" \
             font-family=\"sans-serif\" xmlns=\"http://www.w3.org/2000/svg\">\n<title>{}</title>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#FFFFFF\"/>\n{}</svg>\n",
            width / UNITS_PER_PIXEL,
            height / UNITS_PER_PIXEL,
            escaped(title),
            self.body.into_inner()
        )
    }

    fn add(&self, element: std::fmt::Arguments) {
        let mut body = self.body.borrow_mut();
        // A string takes everything.
        let _ = body.write_fmt(element);
        body.push('\n');
    }
}

/// A rectangle of a canvas. Places are relative to it; what lies beyond it is drawn all the same.
#[derive(Debug, Clone, Copy)]
pub struct Area<'a> {
    canvas: &'a Canvas,
    left: i32,
    top: i32,
    width: i32,
    height: i32,
}

impl Area<'_> {
    /// Its width, units.
    pub fn width(&self) -> i32 {
        self.width
    }

    /// Its height, units.
    pub fn height(&self) -> i32 {
        self.height
    }

    /// The part between two corners.
    #[must_use]
    pub fn part(&self, (left, top): Place, (right, bottom): Place) -> Self {
        Self {
            left: self.left + left,
            top: self.top + top,
            width: right - left,
            height: bottom - top,
            ..*self
        }
    }

    /// The parts above and below a height.
    pub fn split_below(&self, height: i32) -> (Self, Self) {
        let size = (self.width, self.height);
        (
            self.part((0, 0), (self.width, height)),
            self.part((0, height), size),
        )
    }

    /// The parts left and right of a width.
    pub fn split_right(&self, width: i32) -> (Self, Self) {
        let size = (self.width, self.height);
        (
            self.part((0, 0), (width, self.height)),
            self.part((width, 0), size),
        )
    }

    /// Columns of equal width.
    pub fn columns(&self, count: usize) -> impl Iterator<Item = Self> + '_ {
        let edge = move |k: usize| (self.width as usize * k / count.max(1)) as i32;
        (0..count).map(move |k| self.part((edge(k), 0), (edge(k + 1), self.height)))
    }

    fn x(&self, x: i32) -> i32 {
        self.left + x
    }

    fn y(&self, y: i32) -> i32 {
        self.top + y
    }

    /// A line through points.
    pub fn line(&self, points: impl IntoIterator<Item = Place>, line: Line) {
        let mut list = String::new();
        for (x, y) in points {
            let _ = write!(list, "{},{} ", self.x(x), self.y(y));
        }
        let Line {
            colour,
            width,
            dashes,
        } = line;
        let dashes = match dashes {
            "" => String::new(),
            dashes => format!(" stroke-dasharray=\"{dashes}\""),
        };
        self.canvas.add(format_args!(
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{dashes} points=\"{}\"/>",
            list.trim_end()
        ));
    }

    /// Vertical strokes with round ends, each a column with its first and last row: a dot where
    /// they coincide.
    pub(crate) fn strokes(&self, strokes: &[(i32, i32, i32)], line: Line) {
        let mut path = String::new();
        for &(x, from, to) in strokes {
            let (x, from, to) = (self.x(x), self.y(from), self.y(to));
            let _ = if from == to {
                write!(path, "M{x},{from}h0")
            } else {
                write!(path, "M{x},{from}V{to}")
            };
        }
        let Line { colour, width, .. } = line;
        self.canvas.add(format_args!(
            "<path fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linecap=\"round\" d=\"{path}\"/>"
        ));
    }

    /// A filled rectangle between two opposite corners.
    pub fn rectangle(&self, corners: [Place; 2], fill: Colour) {
        let rectangle = self.attributes(corners);
        self.canvas
            .add(format_args!("<rect {rectangle} fill=\"{fill}\"/>"));
    }

    /// The outline of a rectangle.
    pub fn frame(&self, corners: [Place; 2], line: Line) {
        let rectangle = self.attributes(corners);
        let Line { colour, width, .. } = line;
        self.canvas.add(format_args!(
            "<rect {rectangle} fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
        ));
    }

    fn attributes(&self, [a, b]: [Place; 2]) -> String {
        let (x, y) = (self.x(a.0.min(b.0)), self.y(a.1.min(b.1)));
        let (width, height) = ((b.0 - a.0).abs(), (b.1 - a.1).abs());
        format!("x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"")
    }

    /// A filled circle.
    pub fn circle(&self, centre: Place, radius: u32, fill: Colour) {
        let (x, y) = (self.x(centre.0), self.y(centre.1));
        self.canvas.add(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{fill}\"/>"
        ));
    }

    /// A text.
    pub fn text(&self, text: &str, place: Place, style: TextStyle) {
        self.turned_text(text, place, style, "");
    }

    /// A text from below upwards.
    pub(crate) fn upward_text(&self, text: &str, place: Place, style: TextStyle) {
        let (x, y) = (self.x(place.0), self.y(place.1));
        self.turned_text(
            text,
            place,
            style,
            &format!(" transform=\"rotate(-90,{x},{y})\""),
        );
    }

    fn turned_text(&self, text: &str, place: Place, style: TextStyle, turn: &str) {
        let (x, y) = (self.x(place.0), self.y(place.1));
        let TextStyle { height, colour, .. } = style;
        let anchor = match style.anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let weight = if style.bold {
            " font-weight=\"bold\""
        } else {
            ""
        };
        self.canvas.add(format_args!(
            "<text x=\"{x}\" y=\"{y}\" dy=\"0.35em\" font-size=\"{height}\"{anchor}{weight}{turn} fill=\"{colour}\">{}</text>",
            escaped(text)
        ));
    }

    /// A PNG image, stretched to a rectangle without smoothing.
    pub fn image(&self, corners: [Place; 2], png: &[u8]) {
        let rectangle = self.attributes(corners);
        let png = STANDARD.encode(png);
        self.canvas.add(format_args!(
            "<image {rectangle} preserveAspectRatio=\"none\" image-rendering=\"optimizeSpeed\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{png}\"/>"
        ));
    }
}

fn escaped(text: &str) -> String {
    maud::html!((text)).into_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(paint: impl FnOnce(&Area)) -> String {
        let canvas = Canvas::default();
        paint(&canvas.area(100, 60));
        canvas.document((100, 60), "a < b")
    }

    #[test]
    fn parts_share_their_edges_and_shift_what_is_drawn() {
        let svg = drawn(|area| {
            let (above, below) = area.split_below(20);
            assert_eq!((above.height(), below.height()), (20, 40));
            let widths = area.columns(3).map(|column| column.width());
            assert_eq!(widths.collect::<Vec<_>>(), [33, 33, 34]);
            below
                .split_right(30)
                .1
                .circle((1, 2), 3, Colour(0, 10, 255));
        });
        assert!(svg.contains("<circle cx=\"31\" cy=\"22\" r=\"3\" fill=\"#000AFF\"/>"));
    }

    #[test]
    fn texts_and_title_are_escaped() {
        let style = TextStyle::new(10, Colour(0, 0, 0));
        let svg = drawn(|area| area.text("x & <y>", (0, 0), style));
        assert!(svg.contains("<title>a &lt; b</title>") && svg.contains(">x &amp; &lt;y&gt;<"));
    }

    #[test]
    fn strokes_are_dots_where_they_have_no_length() {
        let line = Line::solid(Colour(0, 0, 0), 2);
        let svg = drawn(|area| area.strokes(&[(1, 2, 2), (4, 6, 10)], line));
        assert!(svg.contains("d=\"M1,2h0M4,6V10\""), "{svg}");
    }
}
