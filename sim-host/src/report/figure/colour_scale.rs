//! Colours for numbers: light for small, dark for great, so that they also tell in grey.

use super::axis::Axis;
use super::style::{Area, INK, TICK_FONT, text};
use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;

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
    stops: Vec<(f64, RGBColor)>,
}

impl ColourScale {
    /// A scale through colours at ascending shares of the axis.
    pub fn new(axis: Axis, stops: Vec<(f64, RGBColor)>) -> Self {
        Self { axis, stops }
    }

    /// The colour of a number; that of the nearer end beyond the axis.
    pub fn colour(&self, value: f64) -> RGBColor {
        self.at(self.axis.fraction(value))
    }

    fn at(&self, share: f64) -> RGBColor {
        let above = self.stops.iter().position(|stop| stop.0 >= share);
        let above = above.unwrap_or(self.stops.len() - 1).max(1);
        let ((from, RGBColor(r, g, b)), (to, RGBColor(red, green, blue))) =
            (self.stops[above - 1], self.stops[above]);
        let part = ((share - from) / (to - from).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let mix =
            |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
        RGBColor(mix(r, red), mix(g, green), mix(b, blue))
    }

    /// Draws the scale as a bar with its numbers, at the left end of an area, between two heights.
    pub fn bar(&self, area: &Area, (top, bottom): (i32, i32)) -> anyhow::Result<()> {
        let height = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
        for shade in 0..SHADES {
            let share = |k: f64| k / f64::from(SHADES);
            // Up to the top, so that no seam is left between two shades.
            let corners = [(0, top), (BAR, height(share(f64::from(shade))))];
            let colour = self.at(share(f64::from(shade) + 0.5));
            area.draw(&Rectangle::new(corners, colour.filled()))?;
        }
        let frame = Rectangle::new([(0, top), (BAR, bottom)], INK.stroke_width(2));
        area.draw(&frame)?;
        for tick in &self.axis.ticks {
            let y = height(self.axis.fraction(*tick));
            area.draw(&PathElement::new(
                [(BAR, y), (BAR + TICK, y)],
                INK.stroke_width(2),
            ))?;
            let label = self.axis.format_ext(tick);
            area.draw_text(&label, &text(TICK_FONT, INK), (BAR + 2 * TICK, y))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_mixed_between_stops() {
        let stops = vec![
            (0.0, RGBColor(0, 0, 0)),
            (0.5, RGBColor(100, 0, 0)),
            (1.0, RGBColor(100, 200, 0)),
        ];
        let scale = ColourScale::new(Axis::linear("", -1.0, 1.0, 4), stops);
        assert_eq!(scale.colour(-9.0), RGBColor(0, 0, 0));
        assert_eq!(scale.colour(-0.5), RGBColor(50, 0, 0));
        assert_eq!(scale.colour(0.5), RGBColor(100, 100, 0));
        assert_eq!(scale.colour(9.0), RGBColor(100, 200, 0));
    }
}
