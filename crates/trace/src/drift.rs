//! A drift of the camera smaller than a pixel, over which sparkle is measured.

use glam::{DVec2, DVec3};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_scene::Camera;
use ndfmap_scene::metrics::Picture;

/// Steps of the drift, each a sixteenth of a pixel to the right and down.
pub(crate) const STEPS: usize = 16;

/// Cells of a pixel.
pub(crate) const CELLS: usize = STEPS * STEPS;

/// Rows of pixels whose cells are worked out together: cells are many, and those between two bands are worked
/// out twice.
pub(crate) const BAND: usize = 8;

/// Frames of a drift, from the camera where it is to a whole pixel on.
pub const DRIFT_FRAMES: usize = STEPS + 1;

/// The camera in a frame of the drift, 0 to [`DRIFT_FRAMES`] - 1.
#[must_use]
pub fn drifted(camera: &Camera, frame: usize) -> Camera {
    Camera { shift: camera.shift - DVec2::splat(frame as f64 / STEPS as f64), ..*camera }
}

/// The cells that pixels of all frames are made of: [`STEPS`] a pixel on each axis, and a pixel more than the
/// picture.
pub(crate) fn cells(size: Size) -> Size {
    Size { width: (size.width + 1) * STEPS, height: (size.height + 1) * STEPS }
}

/// Camera whose pixels are the [`cells`].
pub(crate) fn cell_camera(camera: &Camera, size: Size) -> Camera {
    // The angle of view grows by the added pixel; the middle moves by half of it, and the eye looks where it
    // looked.
    let tangent = (camera.degrees.to_radians() / 2.0).tan() * (size.height + 1) as f64 / size.height as f64;
    let half = STEPS as f64 / 2.0;
    let shift = camera.shift * STEPS as f64 - DVec2::splat(half);
    Camera { degrees: 2.0 * tangent.atan().to_degrees(), shift, ..*camera }
}

/// Every frame from the cells' radiance: a pixel is the mean of the cells it covers, so frames differ only by
/// the cells that enter and leave, and not by mere chance in between.
pub(crate) fn frames(cells: &[DVec3], size: Size) -> Vec<Picture> {
    let width = (size.width + 1) * STEPS;
    // Sums over everything above and to the left: any rectangle is four of them.
    let mut sums = vec![DVec3::ZERO; (width + 1) * ((size.height + 1) * STEPS + 1)];
    for (y, row) in cells.chunks_exact(width).enumerate() {
        let mut along = DVec3::ZERO;
        for (x, cell) in row.iter().enumerate() {
            along += *cell;
            sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + along;
        }
    }
    let at = |x: usize, y: usize| sums[y * (width + 1) + x];
    let frame = |step: usize| {
        Grid::from_fn(size, |x, y| {
            let (x, y) = (x * STEPS + step, y * STEPS + step);
            let (right, below) = (x + STEPS, y + STEPS);
            let sum = at(right, below) - at(x, below) - at(right, y) + at(x, y);
            (sum / CELLS as f64).as_vec3()
        })
    };
    (0..DRIFT_FRAMES).map(frame).collect()
}
