//! Directions drawn from an environment, in proportion to the light that comes from them.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::Environment;
use crate::grid::Size;

/// Draws directions from an environment.
#[derive(Clone, Debug)]
pub struct EnvironmentSampler {
    size: Size,
    /// For each row, the light of all rows up to its end, with one more at the front, 0.
    rows: Vec<f64>,
    /// For each row, the running sums of its own texels likewise.
    texels: Vec<f64>,
}

impl EnvironmentSampler {
    /// Adds up the light. A black environment has nothing to draw from, and draws evenly.
    #[must_use]
    pub fn new(environment: &Environment) -> Self {
        let size = environment.size();
        let black = environment.mean() == DVec3::ZERO;
        let (mut rows, mut texels) = (vec![0.0], Vec::with_capacity(size.height * (size.width + 1)));
        let mut all = 0.0;
        for y in 0..size.height {
            let solid_angle = environment.solid_angle(y);
            let mut sum = 0.0;
            texels.push(0.0);
            for radiance in environment.picture().row(y) {
                sum += if black { 1.0 } else { f64::from(radiance.element_sum()) } * solid_angle;
                texels.push(sum);
            }
            all += sum;
            rows.push(all);
        }
        Self { size, rows, texels }
    }

    fn row(&self, y: usize) -> &[f64] {
        &self.texels[y * (self.size.width + 1)..][..=self.size.width]
    }

    /// A direction from two numbers in [0, 1), and its density per solid angle.
    #[must_use]
    pub fn draw(&self, environment: &Environment, random: DVec2) -> (DVec3, f64) {
        let (y, v) = pick(&self.rows, random.y);
        let (x, u) = pick(self.row(y), random.x);
        // Evenly over the texel: in longitude, and in the cosine to the zenith.
        let [from, to] = environment.heights(y);
        let cos = from + (to - from) * v;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * ((x as f64 + u) / self.size.width as f64 - 0.5)).sin_cos();
        (DVec3::new(sin * sin_phi, cos, -sin * cos_phi), self.density_of(environment, x, y))
    }

    /// Density with which a direction is drawn, per solid angle.
    #[must_use]
    pub fn density(&self, environment: &Environment, direction: DVec3) -> f64 {
        let (x, y) = environment.texel(direction);
        self.density_of(environment, x, y)
    }

    fn density_of(&self, environment: &Environment, x: usize, y: usize) -> f64 {
        let row = self.row(y);
        (row[x + 1] - row[x]) / self.rows[self.size.height] / environment.solid_angle(y)
    }
}

/// Interval of a running sum that a share of it falls into, and the place within it.
fn pick(sums: &[f64], share: f64) -> (usize, f64) {
    let at = share * sums[sums.len() - 1];
    let i = sums.partition_point(|sum| *sum <= at).clamp(1, sums.len() - 1) - 1;
    let width = sums[i + 1] - sums[i];
    (i, if width > 0.0 { ((at - sums[i]) / width).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::super::tests::smooth;
    use super::*;
    use crate::grid::Grid;
    use glam::Vec3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn drawn_directions_add_up_to_the_light() {
        let mut e = smooth(Size { width: 24, height: 12 });
        e.radiance.row_mut(3)[5] = Vec3::splat(1000.0);
        e.radiance.row_mut(7)[1] = Vec3::ZERO;
        let sampler = EnvironmentSampler::new(&e);
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let (mut light, mut inside) = (DVec3::ZERO, 0);
        let count = 20_000;
        for _ in 0..count {
            let [u, v]: [f64; 2] = random.random();
            let (w, density) = sampler.draw(&e, DVec2::new(u, v));
            assert!((w.length() - 1.0).abs() < 1e-12);
            assert!((density - sampler.density(&e, w)).abs() < 1e-9 * density, "{w}");
            light += e.radiance(w) / density;
            inside += u32::from(w.y > 0.0);
        }
        // Light over density is constant but for colour: the mean of the colours' sum is exact, that of one
        // is off by noise, whose deviation here is at most the mean itself over the root of 20 000, thrice of
        // which is 2 %.
        let expected = e.mean() * 2.0 * TAU;
        let mean = light / f64::from(count);
        assert!((mean.element_sum() - expected.element_sum()).abs() < 1e-9 * expected.element_sum());
        assert!((mean - expected).length() < 0.02 * expected.length(), "{mean} {expected}");
        assert!(inside > 0);
    }

    #[test]
    fn black_draws_evenly() {
        let size = Size { width: 4, height: 2 };
        let e = Environment::new(Grid::from_fn(size, |_, _| Vec3::ZERO)).unwrap();
        let (_, density) = EnvironmentSampler::new(&e).draw(&e, DVec2::new(0.3, 0.9));
        assert!((density - 1.0 / (2.0 * TAU)).abs() < 1e-12);
    }
}
