//! The camera: a pinhole, whose rays through a picture's pixels are an affine function of the pixel.

use glam::{DVec2, DVec3};

use ndfmap_core::grid::Size;

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the eye.
    pub eye: DVec3,
    /// Point in the middle of the picture.
    pub target: DVec3,
    /// Up direction of the picture; must not point along the view.
    pub up: DVec3,
    /// Full angle of view from the bottom to the top of the picture, in degrees.
    pub degrees: f64,
    /// Shift of the picture's raster, in pixels: a drift of the camera smaller than a pixel.
    pub shift: DVec2,
}

impl Camera {
    /// A camera that is not shifted, with y up.
    #[must_use]
    pub fn new(eye: [f64; 3], target: [f64; 3], degrees: f64) -> Self {
        let (eye, target) = (DVec3::from(eye), DVec3::from(target));
        // Looking straight down, "up" is away from the eye along -z.
        let up = if (target - eye).cross(DVec3::Y).length() > 1e-9 { DVec3::Y } else { DVec3::NEG_Z };
        Self { eye, target, up, degrees, shift: DVec2::ZERO }
    }

    /// The camera at a multiple of its distance from what it looks at.
    #[must_use]
    pub fn at_distance(self, factor: f64) -> Self {
        Self { eye: self.target + (self.eye - self.target) * factor, ..self }
    }

    /// The rays of a picture of this size.
    #[must_use]
    pub fn rays(&self, size: Size) -> Rays {
        let forward = (self.target - self.eye).normalize_or(DVec3::NEG_Z);
        let right = forward.cross(self.up).normalize_or(DVec3::X);
        let up = right.cross(forward);
        let pixel = 2.0 * (self.degrees.to_radians() / 2.0).tan() / size.height as f64;
        let (right, down) = (right * pixel, -up * pixel);
        let middle = DVec2::new(size.width as f64, size.height as f64) / 2.0 + self.shift;
        Rays { eye: self.eye, corner: forward - right * middle.x - down * middle.y, right, down }
    }
}

/// Rays through the pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rays {
    /// Origin of every ray.
    pub eye: DVec3,
    /// Vector to the picture's upper left corner, on the plane at distance 1.
    pub corner: DVec3,
    /// Step of one pixel to the right, on that plane.
    pub right: DVec3,
    /// Step of one pixel down, on that plane.
    pub down: DVec3,
}

impl Rays {
    /// Unit direction through a place in the picture, in pixels from its upper left corner; centres lie at
    /// halves.
    #[inline]
    #[must_use]
    pub fn direction(&self, at: DVec2) -> DVec3 {
        (self.corner + self.right * at.x + self.down * at.y).normalize()
    }

    /// Movements of a hit on a plane of this normal as the pixel moves one to the right, and one down.
    ///
    /// To first order, so that a neighbour beyond the plane's horizon does no harm (Igehy 1999, "Tracing Ray
    /// Differentials", equations 10 and 12, for rays that start in one point).
    #[must_use]
    pub fn differentials(&self, at: DVec2, hit: DVec3, normal: DVec3) -> [DVec3; 2] {
        let ray = self.corner + self.right * at.x + self.down * at.y;
        let scale = ((hit - self.eye).length_squared() / ray.length_squared()).sqrt();
        let across = ray.dot(normal);
        // Seen edge on, the reach is as long as numbers go: the coarsest level.
        let across = if across.abs() > 1e-9 { across } else { 1e-9 };
        [self.right, self.down].map(|step| scale * (step - ray * (step.dot(normal) / across)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differentials_are_those_of_the_hit() {
        let size = Size { width: 64, height: 64 };
        let rays = Camera::new([0.2, 1.0, 3.0], [0.0, 0.0, 0.0], 50.0).rays(size);
        let hit = |at: DVec2| rays.eye - rays.direction(at) * (rays.eye.y / rays.direction(at).y);
        let (at, step) = (DVec2::new(30.5, 40.5), 1e-5);
        let exact = rays.differentials(at, hit(at), DVec3::Y);
        for (axis, d) in [DVec2::X, DVec2::Y].into_iter().zip(exact) {
            let numeric = (hit(at + axis * step) - hit(at - axis * step)) / (2.0 * step);
            // Central differences: step² of a curve of order one, and 1e-16 over the step.
            assert!((numeric - d).length() < 1e-9, "{numeric} {d}");
        }
    }

    #[test]
    fn rays_fill_the_angle_of_view() {
        let size = Size { width: 200, height: 100 };
        let camera = Camera::new([0.0, 0.0, 5.0], [0.0, 0.0, 0.0], 90.0);
        let rays = camera.rays(size);
        assert!((rays.direction(DVec2::new(100.0, 50.0)) - DVec3::NEG_Z).length() < 1e-15);
        let top = rays.direction(DVec2::new(100.0, 0.0));
        assert!((top - DVec3::new(0.0, 1.0, -1.0).normalize()).length() < 1e-15, "{top}");
        let left = rays.direction(DVec2::new(0.0, 50.0));
        assert!((left - DVec3::new(-2.0, 0.0, -1.0).normalize()).length() < 1e-15, "{left}");
        // A raster moved one pixel to the right shows the picture one pixel to the left.
        let moved = Camera { shift: DVec2::X, ..camera }.rays(size);
        assert!(
            (moved.direction(DVec2::new(11.0, 7.0)) - rays.direction(DVec2::new(10.0, 7.0))).length() < 1e-15
        );
    }
}
