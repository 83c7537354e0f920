//! Light from everywhere: a picture of it by latitude and longitude, and what shading makes of it.
//!
//! The picture is taken literally, texel by texel: radiance is constant over a texel, and a texel has its
//! exact solid angle. y is up; the middle of the picture is seen looking along -z, and x is on its right.
//!
//! [`Environment`] is the light itself, for truths. [`FilteredEnvironment`] is what shading looks up: small
//! bright sources apart (`sun.rs`), spherical harmonics (`harmonics.rs`), cubes that are filtered wider and
//! wider (`cube.rs`, `prefilter.rs`), and Han et al.'s light over half-vectors (`half_vectors.rs`).

pub mod builtin;
mod cube;
mod filtered;
mod half_vectors;
mod harmonics;
mod prefilter;
mod sampling;
mod sun;

pub use cube::{Cube, cube_direction};
pub use filtered::{FilteredEnvironment, SceneEnvironment, Technique};
pub use half_vectors::{HALF_VECTOR_ORDER, HalfVectors, VIEWS};
pub use harmonics::{Harmonics, IRRADIANCE_ORDER, Irradiance, zonal_of_normals};
pub use sampling::EnvironmentSampler;
pub use sun::{Suns, without_suns};

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use crate::grid::{Grid, Size};

/// A picture of light by latitude and longitude.
#[derive(Clone, Debug)]
pub struct Environment {
    radiance: Grid<Vec3>,
}

/// Radiance that is negative or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("radiance must be finite and not below 0, which that of texel ({x}, {y}) is not")]
pub struct BadRadiance {
    x: usize,
    y: usize,
}

impl Environment {
    /// A picture, linear RGB, row 0 around the zenith.
    ///
    /// # Errors
    /// [`BadRadiance`] names the first texel that is negative or not finite.
    pub fn new(radiance: Grid<Vec3>) -> Result<Self, BadRadiance> {
        let width = radiance.size().width;
        let bad = |v: &Vec3| !v.is_finite() || v.min_element() < 0.0;
        match radiance.texels().iter().position(bad) {
            Some(i) => Err(BadRadiance { x: i % width, y: i / width }),
            None => Ok(Self { radiance }),
        }
    }

    /// Width and height in texels.
    #[must_use]
    pub fn size(&self) -> Size {
        self.radiance.size()
    }

    /// The picture.
    #[must_use]
    pub fn picture(&self) -> &Grid<Vec3> {
        &self.radiance
    }

    /// Radiance that comes from a direction.
    #[must_use]
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let (x, y) = self.texel(direction);
        self.radiance.row(y)[x].as_dvec3()
    }

    /// The texel that a direction is in.
    #[must_use]
    pub fn texel(&self, direction: DVec3) -> (usize, usize) {
        let Size { width, height } = self.size();
        let u = 0.5 + direction.x.atan2(-direction.z) / TAU;
        let v = direction.y.clamp(-1.0, 1.0).acos() / PI;
        let at = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
        (at(u, width), at(v, height))
    }

    /// Unit direction to a point of the picture, in texels from its upper left corner.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        let Size { width, height } = self.size();
        let (sin_phi, cos_phi) = (TAU * (x / width as f64 - 0.5)).sin_cos();
        let (sin, cos) = (PI * y / height as f64).sin_cos();
        DVec3::new(sin * sin_phi, cos, -sin * cos_phi)
    }

    /// Solid angle of each texel of a row.
    #[must_use]
    pub fn solid_angle(&self, y: usize) -> f64 {
        let [from, to] = self.heights(y);
        TAU / self.size().width as f64 * (from - to)
    }

    /// Cosines to the zenith of a row's upper and lower edge.
    fn heights(&self, y: usize) -> [f64; 2] {
        [y, y + 1].map(|y| (PI * y as f64 / self.size().height as f64).cos())
    }

    /// Mean radiance over the sphere.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        let row = |y: usize| {
            let sum: DVec3 = self.radiance.row(y).iter().map(|v| v.as_dvec3()).sum();
            sum * self.solid_angle(y)
        };
        (0..self.size().height).map(row).sum::<DVec3>() / (4.0 * PI)
    }

    /// Light as beams: for every texel a direction, and radiance times solid angle, of the picture
    /// [`Self::reduced`] to about `width` texels around.
    pub(super) fn beams(&self, width: usize) -> Vec<(DVec3, DVec3)> {
        let few = self.reduced(width);
        let Size { width, height } = few.size();
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let beam = |(x, y): (usize, usize)| {
            let power = few.radiance.row(y)[x].as_dvec3() * few.solid_angle(y);
            (few.direction(x as f64 + 0.5, y as f64 + 0.5), power)
        };
        texels.map(beam).collect()
    }

    /// Light in fewer texels, each the mean, by solid angle, of those it covers. Sides are halved as long as
    /// the width stays at `width` or above. Of odd sides the last row or column stays alone, but then is as
    /// wide as the others: directions stray by a texel of the larger.
    fn reduced(&self, width: usize) -> Self {
        let mut all = self.clone();
        while all.size().width / 2 >= width {
            let Size { width, height } = all.size();
            let half = Size { width: width.div_ceil(2), height: height.div_ceil(2) };
            let mean = |x: usize, y: usize| {
                let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
                for row in 2 * y..(2 * y + 2).min(height) {
                    for texel in &all.radiance.row(row)[2 * x..(2 * x + 2).min(width)] {
                        sum += texel.as_dvec3() * all.solid_angle(row);
                        weight += all.solid_angle(row);
                    }
                }
                (sum / weight).as_vec3()
            };
            all = Self { radiance: Grid::from_fn(half, mean) };
        }
        all
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A smooth sky: order 2 in spherical harmonics, positive.
    pub(crate) fn smooth(size: Size) -> Environment {
        let blank = Environment { radiance: Grid::from_fn(size, |_, _| Vec3::ZERO) };
        let at =
            |x: usize, y: usize| smooth_radiance(blank.direction(x as f64 + 0.5, y as f64 + 0.5)).as_vec3();
        Environment::new(Grid::from_fn(size, at)).unwrap()
    }

    pub(crate) fn smooth_radiance(w: DVec3) -> DVec3 {
        DVec3::new(1.0 + 0.5 * w.y, 1.0 + 0.3 * w.x + 0.4 * w.z * w.z, 0.8 + 0.2 * w.x * w.y)
    }

    #[test]
    fn directions_and_texels_agree() {
        let e = smooth(Size { width: 32, height: 16 });
        for y in 0..16 {
            for x in 0..32 {
                assert_eq!(e.texel(e.direction(x as f64 + 0.5, y as f64 + 0.5)), (x, y));
            }
        }
        // The middle is straight ahead, a quarter to its right is on the right, and the first row is above.
        assert!((e.direction(16.0, 8.0) - DVec3::NEG_Z).length() < 1e-15);
        assert!((e.direction(24.0, 8.0) - DVec3::X).length() < 1e-15);
        assert!((e.direction(3.0, 0.0) - DVec3::Y).length() < 1e-15);
        for w in [DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::new(-1e-300, 0.0, 1.0)] {
            let (x, y) = e.texel(w);
            assert!(x < 32 && y < 16);
        }
    }

    #[test]
    fn solid_angles_make_a_sphere() {
        let e = smooth(Size { width: 7, height: 5 });
        let sum: f64 = (0..5).map(|y| 7.0 * e.solid_angle(y)).sum();
        assert!((sum - 4.0 * PI).abs() < 1e-13);
    }

    #[test]
    fn fewer_texels_hold_the_same_light() {
        let e = smooth(Size { width: 64, height: 32 });
        let few = e.reduced(8);
        assert_eq!(few.size(), Size { width: 8, height: 4 });
        // Single floats.
        assert!((few.mean() - e.mean()).length() < 1e-6);
        assert_eq!(e.reduced(65).size(), e.size());
        // Odd sides too are reduced, else what is done with few texels might never end. Directions stray by
        // pi/255 at most, halfway to the last row, of light that changes by less than its mean a radian.
        let odd = smooth(Size { width: 511, height: 255 });
        let few = odd.reduced(64);
        assert_eq!(few.size(), Size { width: 64, height: 32 });
        assert!((few.mean() - odd.mean()).length() < PI / 255.0 / 2.0 * odd.mean().length());
    }

    #[test]
    fn what_is_no_radiance_is_named() {
        let mut texels = vec![Vec3::ONE; 8];
        texels[5].y = -1.0;
        let grid = Grid::from_vec(Size { width: 4, height: 2 }, texels).unwrap();
        assert_eq!(Environment::new(grid).unwrap_err(), BadRadiance { x: 1, y: 1 });
    }
}
