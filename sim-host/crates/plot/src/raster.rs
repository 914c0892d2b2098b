//! A raster of equal cells, as one embedded PNG: a map of many cells stays small.

use crate::canvas::Colour;

/// Colours in rows from the top.
#[derive(Debug, Clone)]
pub struct Raster {
    /// Cells of a row, at least 1.
    pub width: usize,
    /// The colours; as many as rows times width, at least one row.
    pub colours: Vec<Colour>,
}

impl Raster {
    /// The raster as a PNG file.
    pub(crate) fn png(&self) -> Vec<u8> {
        let rows = self.colours.len() / self.width;
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, self.width as u32, rows as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let colours = self.colours.iter().flat_map(|&Colour(r, g, b)| [r, g, b]);
        let bytes: Vec<u8> = colours.collect();
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(&bytes)?;
            writer.finish()
        });
        written.expect("a vector takes every image that has a cell");
        png
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decoder_reads_what_was_written() {
        let colours = vec![
            Colour(1, 2, 3),
            Colour(4, 5, 6),
            Colour(7, 8, 9),
            Colour(0, 0, 0),
        ];
        let png = Raster { width: 2, colours }.png();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png))
            .read_info()
            .unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((frame.width, frame.height), (2, 2));
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6, 7, 8, 9, 0, 0, 0]);
    }
}
