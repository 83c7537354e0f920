//! Height maps: samples as heights in texture widths, and slopes that no surface has.

use std::path::Path;

use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::surface::HeightField;

use super::{DEFAULT_HEIGHT_SCALE, SourceOptions};
use crate::{Image, MapError, Samples};

/// Heights beyond this many texture widths are not real: NaN, infinity, or a "no data" that no tag names.
const ABSURD_HEIGHT: f32 = 1e6;

/// Root mean square slope beyond which heights are in other units: 76 degrees. Normal maps have at most 1.1.
const ABSURD_SLOPE: f64 = 4.0;

/// Root mean square slope of a usual map: 27 degrees.
const USUAL_SLOPE: f64 = 0.5;

/// Heights of a picture.
///
/// # Errors
/// [`MapError`] where there is no height, and where no scale was given and the default one is absurd.
pub(super) fn height_field(
    path: &Path,
    image: &Image,
    options: &SourceOptions,
    warnings: &mut Vec<String>,
) -> Result<HeightField, MapError> {
    // Scaling by the full range keeps depth positive for integers; measurements are only negated.
    let one = if matches!(image.samples, Samples::F32(_)) { 0.0 } else { 1.0 };
    let scale = options.height_scale.unwrap_or(DEFAULT_HEIGHT_SCALE) as f32;
    let mut bad = 0;
    let height = |x: usize, y: usize| {
        let h = image.samples.get((y * image.size.width + x) * image.channels);
        let h = if options.invert { one - h } else { h } * scale;
        if h.abs() < ABSURD_HEIGHT {
            h
        } else {
            bad += 1;
            0.0
        }
    };
    let heights = Grid::from_fn(image.size, height);
    if bad == image.size.area() {
        return Err(MapError::invalid(
            path,
            "holds no height: all are NaN, infinite or beyond a million texture widths",
        ));
    }
    if bad > 0 {
        warnings.push(format!(
            "{bad} texels are NaN, infinite or beyond a million texture widths and take height 0"
        ));
    }
    let field = HeightField { heights, wraps: options.wraps, filter: options.slope_filter };
    check_slopes(path, &field, options, warnings)?;
    Ok(field)
}

/// Refuses slopes that no surface has at the default scale; of a scale that was asked for it warns.
fn check_slopes(
    path: &Path,
    field: &HeightField,
    options: &SourceOptions,
    warnings: &mut Vec<String>,
) -> Result<(), MapError> {
    let slope = root_mean_square_slope(field);
    if slope <= ABSURD_SLOPE {
        return Ok(());
    }
    let scale = options.height_scale.unwrap_or(DEFAULT_HEIGHT_SCALE);
    let usual = scale * USUAL_SLOPE / slope;
    let degrees = slope.atan().to_degrees();
    let reason = format!(
        "has slopes of {slope:.3} ({degrees:.1} degrees, root mean square) where one unit of height is {scale} \
         texture widths, as no surface has: a usual map would have `--height-scale {usual:.1e}`, and \
         `--height-scale auto --normal-map FILE` fits one"
    );
    match options.height_scale {
        None => Err(MapError::unsupported(path, reason)),
        Some(_) => {
            warnings.push(reason);
            Ok(())
        }
    }
}

/// Root of the mean of the squares of all slopes, of both axes together, however steep.
fn root_mean_square_slope(field: &HeightField) -> f64 {
    let Size { width, height } = field.heights.size();
    let mut sum = 0.0;
    for y in 0..height {
        let line = |dy: isize| field.heights.row(field.wraps.y.index(y as isize + dy, height));
        let (above, here, below) = (line(-1), line(0), line(1));
        for x in 0..width {
            let at = |dx: isize| field.wraps.x.index(x as isize + dx, width);
            let across = f64::from(here[at(1)] - here[at(-1)]);
            let down = f64::from(below[x] - above[x]);
            sum += across * across + down * down;
        }
    }
    // Central differences over two texels, each 1/width of the map.
    (sum / (width * height) as f64).sqrt() * width as f64 / 2.0
}
