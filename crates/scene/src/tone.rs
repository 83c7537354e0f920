//! Tone mapping: from light of any brightness to a screen's range, before the screen's own curve.

use glam::Vec3;
use ndfmap_core::words;

/// Tone mapping, which brings light into a screen's range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Cut off at 1. Errors are always measured so.
    #[default]
    Clip,
    /// Reinhard et al. 2002, equation 4, over luminance: highlights up to [`WHITE`] keep their differences.
    Reinhard,
}

/// The luminance that becomes 1.
pub const WHITE: f32 = 4.0;

/// Luminance of linear RGB (ITU-R BT.709).
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

words!(Tone { Clip => "clip", Reinhard => "reinhard" });

impl Tone {
    /// Colour to show for one that is exposed already; hue and saturation stay.
    #[must_use]
    pub fn map(self, colour: Vec3) -> Vec3 {
        let luminance = colour.dot(LUMINANCE);
        match self {
            Self::Reinhard if luminance > 0.0 && luminance < f32::INFINITY => {
                colour * ((1.0 + luminance / (WHITE * WHITE)) / (1.0 + luminance))
            }
            Self::Clip | Self::Reinhard => colour,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_white_and_dark_stays() {
        let white = Tone::Reinhard.map(Vec3::splat(WHITE));
        // Weights of luminance sum to 1 within a rounding.
        assert!((white - Vec3::ONE).abs().max_element() < 1e-6, "{white}");
        let dark = Vec3::new(0.001, 0.002, 0.0005);
        // To first order L/(1 + L): off by L, 0.0017 here.
        assert!((Tone::Reinhard.map(dark) / dark - 1.0).abs().max_element() < 0.0018);
        assert_eq!(Tone::Reinhard.map(Vec3::ZERO), Vec3::ZERO);
        assert_eq!(Tone::Clip.map(dark), dark);
        assert_eq!(Tone::Reinhard.map(Vec3::INFINITY), Vec3::INFINITY);
    }

    #[test]
    fn brighter_stays_brighter() {
        let shown: Vec<f32> = (0..400).map(|i| Tone::Reinhard.map(Vec3::splat(i as f32 / 100.0)).x).collect();
        assert!(shown.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
