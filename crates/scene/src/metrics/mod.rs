//! Metrics of pictures: how far two are apart, and how much a moving one sparkles.
//!
//! Pictures are linear RGB, high dynamic range; a *display value* is one of them times the exposure, clipped
//! to 0..1 and encoded as sRGB.

mod flip;

pub use flip::{FlipTruth, PixelsPerDegree, flip, flip_map};

use glam::Vec3;
use ndfmap_core::grid::{Grid, Size};
use rayon::prelude::*;

/// A picture in linear RGB.
pub type Picture = Grid<Vec3>;

/// sRGB's curve over linear light, clipped to 0..1 (IEC 61966-2-1).
#[must_use]
pub fn display_value(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Display values of a colour.
#[must_use]
pub fn display(colour: Vec3, exposure: f32) -> Vec3 {
    Vec3::from_array((colour * exposure).to_array().map(display_value))
}

/// Display values in 8 bits.
#[must_use]
pub fn to_bytes(picture: &Picture, exposure: f32) -> Grid<[u8; 3]> {
    let byte = |v: f32| (v * 255.0).round() as u8;
    by_rows(picture.size(), |y, row: &mut [[u8; 3]]| {
        for (bytes, colour) in row.iter_mut().zip(picture.row(y)) {
            *bytes = display(*colour, exposure).to_array().map(byte);
        }
    })
}

/// `|a - truth| / |truth|` over all pixels and channels of the linear pictures; `|a|` where the truth is
/// black.
///
/// # Panics
/// When the pictures differ in size, as in all metrics here.
#[must_use]
pub fn relative_l2(a: &Picture, truth: &Picture) -> f64 {
    let (mut difference, mut norm) = (0.0, 0.0);
    for (a, t) in pairs(a, truth) {
        difference += f64::from((a - t).length_squared());
        norm += f64::from(t.length_squared());
    }
    if norm > 0.0 { (difference / norm).sqrt() } else { difference.sqrt() }
}

/// Mean over pixels of the distance of display values in RGB, divided by sqrt 3, so between 0 and 1.
///
/// Our reading of Tan et al.'s "normalized Euclidean color error per pixel".
#[must_use]
pub fn color_error(a: &Picture, truth: &Picture, exposure: f32) -> f64 {
    let distance = |(a, t): (Vec3, Vec3)| f64::from(display(a, exposure).distance(display(t, exposure)));
    pairs(a, truth).map(distance).sum::<f64>() / 3.0_f64.sqrt() / a.texels().len() as f64
}

/// Mean absolute change of display values from frame to frame, over all pixels and channels.
///
/// Of two renderings of the same drift, the one that changes more sparkles. `sparkle` is a method's change
/// over the truth's.
#[must_use]
pub fn change(frames: &[Picture], exposure: f32) -> f64 {
    let mut sum = 0.0;
    for two in frames.windows(2) {
        for (a, b) in pairs(&two[0], &two[1]) {
            sum += f64::from((display(a, exposure) - display(b, exposure)).abs().element_sum());
        }
    }
    let pixels = frames.first().map_or(1, |f| f.texels().len());
    sum / (3 * pixels * frames.len().saturating_sub(1).max(1)) as f64
}

/// Grid whose rows are filled in parallel, each by itself, so the same for any number of threads.
fn by_rows<T: Clone + Default + Send>(size: Size, fill: impl Fn(usize, &mut [T]) + Sync) -> Grid<T> {
    let mut texels = vec![T::default(); size.area()];
    texels.par_chunks_mut(size.width).enumerate().for_each(|(y, row)| fill(y, row));
    Grid::from_vec(size, texels).unwrap_or_else(|| unreachable!("rows are as wide as the grid"))
}

/// Pixels of two pictures of one size.
fn pairs<'a>(a: &'a Picture, b: &'a Picture) -> impl Iterator<Item = (Vec3, Vec3)> + 'a {
    assert_eq!(a.size(), b.size(), "pictures that are compared have one size");
    a.texels().iter().copied().zip(b.texels().iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f32) -> Picture {
        Grid::from_fn(Size { width: 3, height: 2 }, |_, _| Vec3::splat(value))
    }

    #[test]
    fn metrics_have_their_closed_forms() {
        // The scale is 0 to 1: black against white is 1, in every metric, whatever is brighter than white.
        assert!((color_error(&flat(0.0), &flat(1.0), 1.0) - 1.0).abs() < 1e-7);
        assert!((color_error(&flat(0.0), &flat(7.0), 1.0) - 1.0).abs() < 1e-7);
        assert!((relative_l2(&flat(0.0), &flat(7.0)) - 1.0).abs() < 1e-7);
        assert!((relative_l2(&flat(7.7), &flat(7.0)) - 0.1).abs() < 1e-6);
        // sRGB of 0.5 is 0.7354 (IEC 61966-2-1).
        assert!((display_value(0.5) - 0.735_357).abs() < 1e-5);
        let frames = [flat(0.0), flat(1.0), flat(1.0)];
        assert!((change(&frames, 1.0) - 0.5).abs() < 1e-7);
        assert_eq!(change(&frames[..1], 1.0), 0.0);
    }
}
