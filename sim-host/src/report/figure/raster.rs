//! A raster of equal cells within a figure, as one embedded PNG: a map of many cells stays small.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use plotters::prelude::RGBColor;

/// Colours in rows from the top.
#[derive(Debug, Clone)]
pub struct Raster {
    /// Cells of a row.
    pub width: usize,
    /// The colours; as many as rows times width.
    pub colours: Vec<RGBColor>,
}

impl Raster {
    /// Puts the raster into a drawing, in the place of the rectangle filled with this colour.
    ///
    /// # Errors
    /// If the drawing has no such rectangle, or the raster is empty.
    pub fn put_into(&self, svg: &str, place: RGBColor) -> anyhow::Result<String> {
        let RGBColor(r, g, b) = place;
        let fill = format!("fill=\"#{r:02X}{g:02X}{b:02X}\"");
        let missing = || anyhow::anyhow!("the drawing has no rectangle with {fill}");
        let at = svg.find(&fill).ok_or_else(missing)?;
        let begin = svg[..at].rfind("<rect ").ok_or_else(missing)?;
        let end = at + svg[at..].find("/>").ok_or_else(missing)?;
        let place = svg[begin + "<rect ".len()..at].trim_end();
        let png = STANDARD.encode(self.png()?);
        Ok(format!(
            "{}<image {place} preserveAspectRatio=\"none\" image-rendering=\"optimizeSpeed\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{png}\"{}",
            &svg[..begin],
            &svg[end..]
        ))
    }

    fn png(&self) -> anyhow::Result<Vec<u8>> {
        anyhow::ensure!(!self.colours.is_empty(), "a raster without cells");
        let rows = self.colours.len() / self.width;
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, self.width as u32, rows as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let colours = self.colours.iter().flat_map(|&RGBColor(r, g, b)| [r, g, b]);
        let bytes: Vec<u8> = colours.collect();
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&bytes)?;
        writer.finish()?;
        Ok(png)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_place_of_its_rectangle() {
        let svg = "<svg><rect x=\"1\" y=\"2\" width=\"3\" height=\"4\" fill=\"#010203\" stroke=\"none\"/><g/></svg>";
        let raster = Raster {
            width: 2,
            colours: vec![RGBColor(9, 9, 9); 4],
        };
        let svg = raster.put_into(svg, RGBColor(1, 2, 3)).unwrap();
        assert!(svg.starts_with("<svg><image x=\"1\" y=\"2\" width=\"3\" height=\"4\" "));
        assert!(svg.ends_with("\"/><g/></svg>"), "{svg}");
        assert!(raster.put_into(&svg, RGBColor(1, 2, 3)).is_err());
    }
}
