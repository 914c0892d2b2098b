//! Size, colours, lines and fonts of all figures.

use crate::canvas::{Colour, Line};

/// Width of a figure, units of the drawing.
pub const WIDTH: i32 = 1600;

/// Height of an axis label.
pub const TICK_FONT: u32 = 24;
/// Height of other text.
pub const TEXT_FONT: u32 = 25;
/// Height of a heading.
pub(crate) const HEADING_FONT: u32 = 30;
/// Greatest mean width of a character over the font's height in a bold text.
pub(crate) const CHARACTER_WIDTH: f64 = 0.6;

/// Colour of text and axes.
pub const INK: Colour = Colour(0x1a, 0x1a, 0x1a);
/// Colour of text that only helps.
pub const FAINT_INK: Colour = Colour(0x59, 0x59, 0x59);
/// Colour of grid lines.
pub const GRID: Colour = Colour(0xe3, 0xe3, 0xe3);
/// Colour of a shaded band.
pub const BAND: Colour = Colour(0xd5, 0xdc, 0xe8);

const fn line(colour: Colour, width: u32, dashes: &'static str) -> Line {
    Line {
        colour,
        width,
        dashes,
    }
}

/// The motion with dither, and any single curve.
pub const MAIN: Line = line(Colour(0x12, 0x3f, 0x8c), 3, "");
/// The motion without dither beside one with it.
pub const OTHER: Line = line(Colour(0x8a, 0x86, 0x82), 3, "3 5");
/// The motion without dither in its own panel.
pub const ALONE: Line = line(Colour(0x6b, 0x68, 0x66), 2, "");
/// A limit.
pub const LIMIT: Line = line(Colour(0xb3, 0x1b, 0x1b), 3, "18 8");
/// An instant.
pub const INSTANT: Line = line(Colour(0x40, 0x40, 0x41), 2, "10 5 3 5");
/// Runs that share a panel.
pub const RUNS: [Line; 6] = [
    line(Colour(0x10, 0x2a, 0x5c), 3, ""),
    line(Colour(0xc2, 0x6a, 0x00), 3, "14 6"),
    line(Colour(0x2e, 0x8b, 0x57), 3, "4 5"),
    line(Colour(0x7a, 0x4f, 0xb5), 3, "20 6 4 6"),
    line(Colour(0x59, 0xa5, 0xd8), 4, ""),
    line(Colour(0x5e, 0x5e, 0x60), 3, "8 4"),
];

/// A level to compare with.
pub(crate) const LEVEL: Line = line(Colour(0x77, 0x77, 0x7a), 2, "");
/// Series of dots that share a panel.
pub(crate) const DOTS: [Line; 4] = [
    line(Colour(0x10, 0x2b, 0x5d), 3, ""),
    line(Colour(0xc9, 0x6f, 0x04), 3, ""),
    line(Colour(0x2f, 0x8c, 0x58), 3, ""),
    line(Colour(0x7b, 0x50, 0xb6), 3, ""),
];

/// Width of a text of the given height in a wide sans-serif font (DejaVu Sans); others are
/// narrower.
pub fn text_width(text: &str, height: u32) -> i32 {
    let width: f64 = text.chars().map(character_width).sum();
    (width * f64::from(height)).ceil() as i32
}

/// Width of a character over the font's height.
fn character_width(character: char) -> f64 {
    match character {
        'i' | 'j' | 'l' | '\'' | '|' | 'I' => 0.3,
        ' ' | '.' | ',' | ':' | ';' | 'f' | 't' | 'r' | '(' | ')' | '[' | ']' | '/' => 0.41,
        'm' | 'w' | 'M' | 'W' | '%' | '@' | '\u{2026}' => 1.0,
        '+' | '<' | '=' | '>' | '\u{2212}' | '\u{b1}' => 0.84,
        'A'..='Z' => 0.79,
        _ => 0.64,
    }
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
}
