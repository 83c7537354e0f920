//! A picture in 8-bit RGB, with text, on light or on dark paper.

use ndfmap_core::grid::{Grid, Size};
use ndfmap_maps::formats::png;

use super::text::{Style, rasterise};
use crate::Error;

/// An RGB colour of a display.
pub type Rgb = [u8; 3];

/// Paper that a drawing is made on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// Dark ink on light paper.
    #[default]
    Light,
    /// Light ink on dark paper.
    Dark,
}

impl Theme {
    /// Every theme.
    pub const ALL: [Self; 2] = [Self::Light, Self::Dark];

    /// Colour of the paper.
    #[must_use]
    pub const fn paper(self) -> Rgb {
        match self {
            Self::Light => [252, 252, 250],
            Self::Dark => [22, 23, 27],
        }
    }

    /// Colour of the ink; fainter for what is read last.
    #[must_use]
    pub const fn ink(self, faint: bool) -> Rgb {
        match (self, faint) {
            (Self::Light, false) => [28, 28, 32],
            (Self::Light, true) => [88, 88, 96],
            (Self::Dark, false) => [236, 236, 238],
            (Self::Dark, true) => [164, 166, 174],
        }
    }
}

/// A picture being drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    size: Size,
    theme: Theme,
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// A blank picture of at least one pixel.
    #[must_use]
    pub fn new(size: Size, theme: Theme) -> Self {
        let size = Size { width: size.width.max(1), height: size.height.max(1) };
        Self { size, theme, pixels: vec![theme.paper(); size.area()] }
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> Size {
        self.size
    }

    /// Paper it is drawn on.
    #[must_use]
    pub fn theme(&self) -> Theme {
        self.theme
    }

    /// Sets a pixel; ignores pixels outside the picture.
    pub fn set(&mut self, x: usize, y: usize, colour: Rgb) {
        if x < self.size.width && y < self.size.height {
            self.pixels[y * self.size.width + x] = colour;
        }
    }

    /// Writes a line of text with its upper left corner at `(x, y)`.
    pub fn text(&mut self, (x, y): (usize, usize), text: &str, style: Style) {
        let ink = self.theme.ink(style.faint);
        let Size { width, height } = self.size;
        rasterise(text, style, |i, j, coverage| {
            let (Ok(x), Ok(y)) = (usize::try_from(x as i64 + i), usize::try_from(y as i64 + j)) else {
                return;
            };
            if x < width && y < height {
                let pixel = &mut self.pixels[y * width + x];
                for (value, ink) in pixel.iter_mut().zip(ink) {
                    let (paper, ink) = (f32::from(*value), f32::from(ink));
                    *value = (paper + (ink - paper) * coverage).round() as u8;
                }
            }
        });
    }

    /// Lays a picture down with its upper left corner at `(x, y)`.
    pub fn picture(&mut self, (x, y): (usize, usize), picture: &Grid<Rgb>) {
        for j in 0..picture.size().height {
            for (i, colour) in picture.row(j).iter().enumerate() {
                self.set(x + i, y + j, *colour);
            }
        }
    }

    /// The pixels.
    #[must_use]
    pub fn into_grid(self) -> Grid<Rgb> {
        Grid::from_vec(self.size, self.pixels).unwrap_or_else(|| unreachable!("as many pixels as it has"))
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// [`Error::Failed`] for a picture that cannot be encoded.
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        png::encode(&self.pixels, self.size)
            .map_err(|e| Error::Failed(format!("cannot write a picture: {e}")))
    }
}
