//! A picture in 8-bit RGB with rectangles, cells of floats and 8×8 text, written as PNG.

use font8x8::{BASIC_FONTS, LATIN_FONTS, UnicodeFonts};

use crate::Failure;

/// An RGB colour.
pub(super) type Rgb = [u8; 3];

pub(super) const PAPER: Rgb = [250, 250, 248];
pub(super) const INK: Rgb = [40, 40, 44];

/// Width of a letter, and height of a line of text with its gap.
pub(super) const LETTER: usize = 8;
pub(super) const LINE: usize = 12;

/// A picture being drawn.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// A blank picture.
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![PAPER; width * height] }
    }

    /// Sets a pixel; outside is ignored.
    pub(super) fn set(&mut self, x: usize, y: usize, colour: Rgb) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    /// Writes a line of text with its upper left corner at `(x, y)`.
    pub(super) fn text(&mut self, x: usize, y: usize, text: &str) {
        for (at, letter) in text.chars().enumerate() {
            let glyph = BASIC_FONTS.get(letter).or_else(|| LATIN_FONTS.get(letter)).unwrap_or_default();
            for (row, bits) in glyph.iter().enumerate() {
                for column in (0..8).filter(|c| bits >> c & 1 == 1) {
                    self.set(x + at * LETTER + column, y + row, INK);
                }
            }
        }
    }

    /// The picture as a PNG file.
    pub(super) fn to_png(&self) -> Result<Vec<u8>, Failure> {
        let failed = |e: png::EncodingError| Failure::Failed(format!("cannot write a picture: {e}"));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(self.pixels.as_flattened()).map_err(failed)?;
        writer.finish().map_err(failed)?;
        Ok(bytes)
    }
}

/// Linear light as a display value: sRGB's curve, clipped.
pub(super) fn display(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}
