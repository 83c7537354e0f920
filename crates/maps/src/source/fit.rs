//! Scale of a height map, fitted to the slopes of the normal map beside it.

use std::path::Path;

use glam::DVec2;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::surface::{HeightField, Surface, SurfaceRow, slope_of_normal};

use super::{PictureKind, SourceOptions, identify, read_source};
use crate::formats::{read_file, read_image};
use crate::{Image, MapError, SourceKind};

/// Scale at which heights have the slopes of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightFit {
    /// Texture widths of one unit of height, above 0.
    pub scale: f64,
    /// White is deep.
    pub invert: bool,
    /// Correlation of the two maps' slopes, from 0 to 1, at the size where it is largest.
    pub correlation: f64,
}

/// Least correlation of maps that belong together: real pairs have 0.55 and more through 8 bits and JPEG, two
/// surfaces at most 0.15.
const TOGETHER: f64 = 0.3;

/// Smallest side at which slopes are compared: fewer would agree by chance.
const LEAST_SIDE: usize = 16;

/// Fits the scale of a height map to a normal map of the same surface, by least squares of their slopes.
///
/// Slopes are compared at several sizes, each half of the one before: heights of 8 bits have noise in the
/// finest. The size at which the maps agree most decides.
///
/// # Errors
/// [`MapError`] for files that cannot be read, and for maps that do not belong together.
pub fn fit_height_scale(
    heights: &Path,
    normals: &Path,
    options: &SourceOptions,
) -> Result<HeightFit, MapError> {
    let image = read_image(heights, &read_file(heights)?)?;
    if identify(heights, &image).kind == PictureKind::Normal {
        return Err(MapError::unsupported(
            heights,
            "is a normal map: it has no heights, whose scale could be fitted",
        ));
    }
    let field = gentle_heights(heights, &image, options)?;
    let normal_options = SourceOptions {
        kind: Some(SourceKind::Normal),
        height_scale: None,
        invert: false,
        ..options.clone()
    };
    let normals_map = read_source(normals, &normal_options)?.surface;
    let [h, n] = [field.heights.size(), normals_map.size()];
    if h.width * n.height != h.height * n.width {
        return Err(MapError::unsupported(
            heights,
            format!(
                "is {} × {} and {} is {} × {}: maps of one surface have sides in one ratio",
                h.width,
                h.height,
                normals.display(),
                n.width,
                n.height
            ),
        ));
    }
    let mut size = Size { width: h.width.min(n.width), height: h.height.min(n.height) };
    let mut best: Option<(f64, f64)> = None;
    while size.width.min(size.height) >= LEAST_SIDE {
        let (gentle, due) = (mean_slopes(&field, size), mean_slopes(&*normals_map, size));
        let (mut gg, mut dd, mut gd) = (0.0, 0.0, 0.0);
        for (g, d) in gentle.iter().zip(&due) {
            (gg, dd, gd) = (gg + g.length_squared(), dd + d.length_squared(), gd + g.dot(*d));
        }
        let correlation = gd / (gg * dd).sqrt();
        if correlation.is_finite() && best.is_none_or(|(_, most)| correlation.abs() > most.abs()) {
            best = Some((gd / gg, correlation));
        }
        size = Size { width: size.width / 2, height: size.height / 2 };
    }
    let together = best.filter(|(_, correlation)| correlation.abs() >= TOGETHER);
    let Some((ratio, correlation)) = together else {
        let agree = best.map_or(0.0, |(_, correlation)| correlation.abs());
        return Err(MapError::unsupported(
            heights,
            format!(
                "and {} do not show one surface: their slopes correlate by {agree:.2}, at least {TOGETHER} is due",
                normals.display()
            ),
        ));
    };
    Ok(HeightFit {
        scale: ratio.abs() * f64::from(gentle_scale(&image)),
        invert: ratio < 0.0,
        correlation: correlation.abs(),
    })
}

/// Scale at which the heights span a thousandth of the map's width: slopes are then well inside what normals
/// can hold.
fn gentle_scale(image: &Image) -> f32 {
    let sample = |i: usize| image.samples.get(i * image.channels);
    let finite = (0..image.size.area()).map(sample).filter(|h| h.is_finite());
    let (low, high) = finite.fold((f32::MAX, f32::MIN), |(low, high), h| (low.min(h), high.max(h)));
    1e-3 / (high - low).max(f32::MIN_POSITIVE)
}

/// Heights of a picture at the gentle scale, 0 where they are no numbers.
fn gentle_heights(path: &Path, image: &Image, options: &SourceOptions) -> Result<HeightField, MapError> {
    let scale = gentle_scale(image);
    if !scale.is_finite() || scale > 1e30 {
        return Err(MapError::unsupported(path, "is flat: no scale gives it slopes"));
    }
    let height = |x: usize, y: usize| {
        let h = image.samples.get((y * image.size.width + x) * image.channels) * scale;
        if h.is_finite() { h } else { 0.0 }
    };
    let heights = Grid::from_fn(image.size, height);
    Ok(HeightField { heights, wraps: options.wraps, filter: options.slope_filter })
}

/// Mean slopes of a surface over the cells of a smaller grid.
fn mean_slopes(surface: &dyn Surface, cells: Size) -> Vec<DVec2> {
    let size = surface.size();
    let mut sums = vec![(DVec2::ZERO, 0.0); cells.area()];
    let mut row = SurfaceRow::flat(size.width);
    for y in 0..size.height {
        surface.read_row(y, &mut row);
        let first = y * cells.height / size.height * cells.width;
        for x in 0..size.width {
            let (sum, count) = &mut sums[first + x * cells.width / size.width];
            *sum += slope_of_normal(row.normal(x)).as_dvec2();
            *count += 1.0;
        }
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}
