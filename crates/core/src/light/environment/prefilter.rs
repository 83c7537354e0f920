//! Cubes that microfacets have blurred: what a rough mirror of each width shows, seen straight on.
//!
//! The split of Karis 2013 that engines have: light is averaged by the lobe as if normal, eye and mirror
//! direction were one, and what the lobe reflects in all comes from a table (`split_sum.rs`). Level k of n is
//! perceptual roughness k/(n-1), so level 0 is the environment. Each texel is a sum over directions that
//! stand for equal shares of the lobe, each looked up as wide as its share of solid angle (Krivanek and
//! Colbert 2008): nothing is drawn at random, and nothing is missed between directions.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::Cube;
use crate::brdf::Microfacets;
use crate::sphere::frame;
use crate::units::SlopeVariance;

/// Directions, from the lobe's middle out and around.
const RINGS: usize = 16;
const SPOKES: usize = 12;

/// Rings of a length's integral, which costs little.
const FINE_RINGS: usize = 256;

impl Microfacets {
    /// Perceptual roughness of a lobe: the root of alpha, alpha² being twice the variance.
    #[must_use]
    pub fn roughness(width: SlopeVariance) -> f64 {
        (2.0 * width.get()).powf(0.25).min(1.0)
    }

    /// Level that is `times` as rough as a lobe, of a cube with so many levels.
    #[must_use]
    pub fn level(width: SlopeVariance, times: f64, levels: usize) -> f64 {
        (times * Self::roughness(width)).min(1.0) * (levels - 1) as f64
    }

    /// Perceptual roughness of the blur whose light comes from directions of this mean length.
    #[must_use]
    pub fn roughness_of(self, length: f64) -> f64 {
        // The length falls as roughness rises: halved thirty times.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = (low + high) / 2.0;
            if self.length(middle) > length {
                low = middle;
            } else {
                high = middle;
            }
        }
        (low + high) / 2.0
    }

    /// Length of the mean of the directions that a blur takes light from.
    fn length(self, roughness: f64) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for ring in 0..FINE_RINGS {
            let share = (ring as f64 + 0.5) / FINE_RINGS as f64;
            let tan_squared = self.quantile(roughness.powi(4), share);
            let cos = (1.0 - tan_squared) / (1.0 + tan_squared);
            if cos > 0.0 {
                sum += cos * cos;
                weight += cos;
            }
        }
        sum / weight
    }

    /// Filters a cube.
    #[must_use]
    pub fn filter(self, radiance: &Cube) -> Cube {
        let levels = radiance.levels();
        let texel = 4.0 * PI / (6 * radiance.side() * radiance.side()) as f64;
        let directions = |level: usize| {
            let alpha_squared = (level as f64 / (levels - 1) as f64).powi(4);
            let mut directions = Vec::with_capacity(RINGS * SPOKES);
            for ring in 0..RINGS {
                let tan_squared = self.quantile(alpha_squared, (ring as f64 + 0.5) / RINGS as f64);
                let cos_squared = 1.0 / (1.0 + tan_squared);
                // The mirror direction is at twice the angle; its density, D/4.
                let (cos, sin) = (2.0 * cos_squared - 1.0, 2.0 * (cos_squared * (1.0 - cos_squared)).sqrt());
                if cos <= 0.0 {
                    continue;
                }
                let share = 4.0 / ((RINGS * SPOKES) as f64 * self.d_of_tangent(alpha_squared, tan_squared));
                let lod = 0.5 * (share / texel).log2();
                for spoke in 0..SPOKES {
                    // Each ring turned by the golden ratio, so that spokes do not line up.
                    let turn = (spoke as f64 + 0.618_033_988_749_895 * ring as f64) / SPOKES as f64;
                    let (y, x) = (TAU * turn).sin_cos();
                    directions.push((DVec3::new(sin * x, sin * y, cos), lod));
                }
            }
            directions
        };
        let all: Vec<Vec<(DVec3, f64)>> = (0..levels).map(directions).collect();
        radiance.with_levels(|level, w| {
            let (x, y) = frame(w);
            let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
            for (d, lod) in &all[level] {
                sum += radiance.lookup(x * d.x + y * d.y + w * d.z, *lod) * d.z;
                weight += d.z;
            }
            sum / weight
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Environment;
    use super::super::tests::{smooth, smooth_radiance};
    use super::*;
    use crate::grid::{Grid, Size};
    use crate::sphere::gauss_legendre;
    use glam::Vec3;

    #[test]
    fn roughness_nought_is_the_map_and_a_constant_stays_one() {
        let radiance = Cube::of(&smooth(Size { width: 128, height: 64 }));
        for microfacets in [Microfacets::Beckmann, Microfacets::Ggx] {
            assert!(microfacets.filter(&radiance).texels(0) == radiance.texels(0));
            let one =
                Environment::new(Grid::from_fn(Size { width: 64, height: 32 }, |_, _| Vec3::splat(2.0)))
                    .unwrap();
            let cube = microfacets.filter(&Cube::of(&one));
            for level in 0..cube.levels() {
                assert!(cube.texels(level).iter().all(|v| (*v - Vec3::splat(2.0)).length() < 1e-5));
            }
        }
    }

    #[test]
    fn rough_levels_are_the_integral() {
        let radiance = Cube::of(&smooth(Size { width: 512, height: 256 }));
        let up = DVec3::new(0.36, 0.8, 0.48);
        let (x, y) = frame(up);
        for microfacets in [Microfacets::Beckmann, Microfacets::Ggx] {
            let cube = microfacets.filter(&radiance);
            for level in 1..cube.levels() {
                let alpha_squared = (level as f64 / (cube.levels() - 1) as f64).powi(4);
                let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
                // Over the mirror's cosine to the normal, sixty-four nodes to a panel that halves towards the
                // peak.
                let mut end = 1.0;
                for panel in 0..24 {
                    let start = if panel == 23 { 0.0 } else { end / 2.0 };
                    for (node, w) in gauss_legendre(32) {
                        let fall = start + (end - start) * (node + 1.0) / 2.0;
                        let cos = 1.0 - fall;
                        let tan_squared = (1.0 - cos) / (1.0 + cos);
                        let density =
                            microfacets.d_of_tangent(alpha_squared, tan_squared) * cos * w * (end - start);
                        for k in 0..16 {
                            let (s, c) = (TAU * f64::from(k) / 16.0).sin_cos();
                            let sin = (1.0 - cos * cos).sqrt();
                            sum += smooth_radiance(x * sin * c + y * sin * s + up * cos) * density;
                            weight += density;
                        }
                    }
                    end = start;
                }
                let (got, expected) = (cube.lookup(up, level as f64), sum / weight);
                // Sixteen rings, and what look-ups blur besides.
                assert!((got - expected).length() < 0.02, "{microfacets:?} {level}: {got} {expected}");
            }
        }
    }
}
