//! Text in Inter, a face under the Open Font License, whose outlines come with the library.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};
use plotters::style::{FontStyle, register_font};

/// The face, in its usual weight.
const REGULAR: &[u8] = include_bytes!("../../fonts/Inter-Regular.otf");

/// The face, heavier, for heads.
const SEMIBOLD: &[u8] = include_bytes!("../../fonts/Inter-SemiBold.otf");

/// Family that plots ask for.
pub(super) const FAMILY: &str = "sans-serif";

struct Faces {
    regular: FontRef<'static>,
    semibold: FontRef<'static>,
}

static FACES: LazyLock<Faces> = LazyLock::new(|| {
    let face = |bytes| FontRef::try_from_slice(bytes).unwrap_or_else(|e| unreachable!("our own face: {e}"));
    Faces { regular: face(REGULAR), semibold: face(SEMIBOLD) }
});

/// Hands the face to the library of plots.
pub(super) static FOR_PLOTS: LazyLock<()> = LazyLock::new(|| {
    register_font(FAMILY, FontStyle::Normal, REGULAR).unwrap_or_else(|_| unreachable!("our own face"));
});

/// Style of a line of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Height of a line in pixels.
    pub pixels: f32,
    /// True for heads.
    pub heavy: bool,
    /// True for what is read last: drawn nearer to the paper's colour.
    pub faint: bool,
}

impl Style {
    /// Title of a sheet.
    pub const TITLE: Self = Self { pixels: 22.0, heavy: true, faint: false };
    /// Head of a row or a column.
    pub const HEAD: Self = Self { pixels: 16.0, heavy: true, faint: false };
    /// Caption under a panel.
    pub const CAPTION: Self = Self { pixels: 15.0, heavy: false, faint: true };

    /// Height of a line with its gap, in pixels.
    #[must_use]
    pub fn line(self) -> usize {
        (self.pixels * 1.25).ceil() as usize
    }

    fn face(self) -> &'static FontRef<'static> {
        if self.heavy { &FACES.semibold } else { &FACES.regular }
    }
}

/// Width of a line of text, in whole pixels.
#[must_use]
pub fn width(text: &str, style: Style) -> usize {
    let (_, end) = glyphs(text, style);
    end.ceil() as usize
}

/// Calls `paint` with place and coverage, from 0 to 1, of every pixel that the text touches; the line's upper
/// left corner is (0, 0).
pub(super) fn rasterise(text: &str, style: Style, mut paint: impl FnMut(i64, i64, f32)) {
    for glyph in glyphs(text, style).0 {
        let Some(outline) = style.face().outline_glyph(glyph) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|x, y, coverage| {
            paint(corner.x as i64 + i64::from(x), corner.y as i64 + i64::from(y), coverage.min(1.0));
        });
    }
}

/// Glyphs of a line, in their places, and where the line ends.
fn glyphs(text: &str, style: Style) -> (Vec<Glyph>, f32) {
    let face = style.face().as_scaled(PxScale::from(style.pixels));
    let (mut all, mut x) = (Vec::new(), 0.0);
    let mut before = None;
    for letter in text.chars() {
        let id = face.glyph_id(letter);
        x += before.map_or(0.0, |before| face.kern(before, id));
        all.push(id.with_scale_and_position(style.pixels, point(x, face.ascent())));
        x += face.h_advance(id);
        before = Some(id);
    }
    (all, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_has_a_width_and_stays_in_its_line() {
        for style in [Style::TITLE, Style::HEAD, Style::CAPTION] {
            assert_eq!(width("", style), 0);
            let (one, two) = (width("vmf:4", style), width("vmf:4 vmf:4", style));
            assert!(2 * one < two && two < 3 * one, "{one} {two}");
            let mut pixels = 0;
            rasterise("Ångström, λ² ≤ ½", style, |_, y, coverage| {
                assert!((-1..=style.line() as i64).contains(&y) && (0.0..=1.0).contains(&coverage), "{y}");
                pixels += usize::from(coverage > 0.5);
            });
            assert!(pixels > 50, "{pixels}");
        }
    }

    #[test]
    fn the_face_has_what_our_captions_say() {
        let missing = FACES.regular.glyph_id('\u{fffd}');
        for letter in ('!'..='~').chain("×·±−√≤≥∞→°²½αγθκλμπσφω–—…′".chars())
        {
            assert_ne!(FACES.regular.glyph_id(letter), missing, "{letter}");
            assert_ne!(FACES.semibold.glyph_id(letter), missing, "{letter}");
        }
    }
}
