//! A picture in 8-bit RGB with 8×8 text, written as PNG.

use font8x8::{BASIC_FONTS, LATIN_FONTS, UnicodeFonts};

use ndfmap_core::grid::Size;
use ndfmap_maps::formats::png;

use crate::Error;

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

    /// Sets a pixel; ignores pixels outside the picture.
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
    pub(super) fn to_png(&self) -> Result<Vec<u8>, Error> {
        let size = Size { width: self.width, height: self.height };
        png::encode(&self.pixels, size).map_err(|e| Error::Failed(format!("cannot write a picture: {e}")))
    }
}

/// Colour of a heat map, from dark to light in one order of hues: readable in grey and by the colour-blind.
pub(super) fn heat(t: f64) -> Rgb {
    const STOPS: [Rgb; 5] = [INK, [60, 40, 120], [190, 55, 90], [250, 150, 60], PAPER];
    let at = t * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    let mix = |c: usize| {
        let (a, b) = (f64::from(STOPS[i][c]), f64::from(STOPS[i + 1][c]));
        (a + (b - a) * (at - i as f64)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}
