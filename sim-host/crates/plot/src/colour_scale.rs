//! Colours for numbers: light for small, dark for great, so that the order remains in greyscale.

use crate::axis::Axis;
use crate::canvas::{Area, Colour, Line, TextStyle};
use crate::style::{INK, TICK_FONT};

/// Width of a bar.
pub const BAR: i32 = 34;
/// Length of its ticks.
pub const TICK: i32 = 7;
const SHADES: i32 = 64;

/// A scale of colours along an axis.
#[derive(Debug, Clone)]
pub struct ColourScale {
    axis: Axis,
    /// Colours at ascending shares of the axis from 0 to 1.
    stops: Vec<(f64, Colour)>,
}

impl ColourScale {
    /// A scale through colours at ascending shares of the axis.
    pub fn new(axis: Axis, stops: Vec<(f64, Colour)>) -> Self {
        Self { axis, stops }
    }

    /// The colour of a number; that of the nearer end beyond the axis.
    pub fn colour(&self, value: f64) -> Colour {
        self.at(self.axis.fraction(value))
    }

    fn at(&self, share: f64) -> Colour {
        let above = self.stops.iter().position(|stop| stop.0 >= share);
        let above = above.unwrap_or(self.stops.len() - 1).max(1);
        let ((from, Colour(r, g, b)), (to, Colour(red, green, blue))) =
            (self.stops[above - 1], self.stops[above]);
        let part = ((share - from) / (to - from).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let mix =
            |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
        Colour(mix(r, red), mix(g, green), mix(b, blue))
    }

    /// Draws the scale as a bar with its numbers, at the left end of an area, between two heights.
    pub fn bar(&self, area: &Area, (top, bottom): (i32, i32)) {
        let height = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
        for shade in 0..SHADES {
            let share = |k: f64| k / f64::from(SHADES);
            // Up to the top, so that no seam is left between two shades.
            let corners = [(0, top), (BAR, height(share(f64::from(shade))))];
            area.rectangle(corners, self.at(share(f64::from(shade) + 0.5)));
        }
        let line = Line::solid(INK, 2);
        area.frame([(0, top), (BAR, bottom)], line);
        for tick in &self.axis.ticks {
            let y = height(self.axis.fraction(*tick));
            area.line([(BAR, y), (BAR + TICK, y)], line);
            let style = TextStyle::new(TICK_FONT, INK);
            area.text(&self.axis.label(*tick), (BAR + 2 * TICK, y), style);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_mixed_between_stops() {
        let stops = vec![
            (0.0, Colour(0, 0, 0)),
            (0.5, Colour(100, 0, 0)),
            (1.0, Colour(100, 200, 0)),
        ];
        let scale = ColourScale::new(Axis::linear("", -1.0, 1.0, 4), stops);
        assert_eq!(scale.colour(-9.0), Colour(0, 0, 0));
        assert_eq!(scale.colour(-0.5), Colour(50, 0, 0));
        assert_eq!(scale.colour(0.5), Colour(100, 100, 0));
        assert_eq!(scale.colour(9.0), Colour(100, 200, 0));
    }
}
