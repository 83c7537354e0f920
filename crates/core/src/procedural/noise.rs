//! Gaussian noise of a given slope deviation: the surface on which a Gaussian of slopes is the whole truth.
//!
//! A sum of 128 cosine waves of random direction and phase at whole wave numbers (so it tiles), whose
//! amplitudes give each axis the variance asked for exactly, in the mean over the map.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Row, aspect, height_field};
use crate::grid::Size;
use crate::surface::Surface;
use crate::units::SlopeVariance;

/// A tiling surface of nearly Gaussian slopes with these variances along x and y.
#[must_use]
pub fn gaussian_noise(size: Size, x: SlopeVariance, y: SlopeVariance, seed: u64) -> Box<dyn Surface> {
    const WAVES: usize = 128;
    let aspect = aspect(size);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let waves: Vec<(f64, f64, f64)> = (0..WAVES)
        .map(|_| {
            let (angle, radius) = (random.random_range(0.0..TAU), random.random_range(6.0..20.0_f64));
            ((radius * angle.cos()).round(), (radius * angle.sin()).round(), random.random_range(0.0..TAU))
        })
        .collect();
    // Every wave gets the same share of slope variance on its own direction; then the two axes are
    // scaled apart, which for heights means a weight per wave that solves for both in the mean.
    let share = |p: f64, q: f64| p * p / (p * p + q * q).max(1.0);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (p, q, _) in &waves {
        let (a, b) = (share(*p, *q), share(*q, *p));
        xx += a * a;
        xy += a * b;
        yy += b * b;
    }
    // Energies e = l a + m b with Σ e a = var x, Σ e b = var y; negative ones cannot be and are dropped.
    let determinant = xx * yy - xy * xy;
    let l = (yy * x.get() - xy * y.get()) / determinant;
    let m = (xx * y.get() - xy * x.get()) / determinant;
    let waves: Vec<(f64, f64, f64, f64)> = waves
        .iter()
        .map(|(p, q, phase)| {
            let energy = (l * share(*p, *q) + m * share(*q, *p)).max(0.0);
            // Slope variance of a cos(2 pi k t): (2 pi k a)² / 2.
            let k = TAU * p.hypot(q / aspect).max(1.0);
            (TAU * p, TAU * q, *phase, (2.0 * energy).sqrt() / k)
        })
        .collect();
    height_field(size, move |u, v| {
        waves.iter().map(|(p, q, phase, a)| a * (p * u + q * v / aspect + phase).cos()).sum()
    })
}

pub(super) const ROW: Row = Row {
    name: "noise",
    summary: "isotropic Gaussian noise of slope deviation 0.25",
    build: |size| {
        let variance = SlopeVariance::clamped(0.0625);
        gaussian_noise(size, variance, variance, 2013)
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SurfaceRow, slope_of_normal};

    #[test]
    fn slopes_have_the_variances_and_look_gaussian() {
        let size = Size::new(512, 512).unwrap();
        let surface = gaussian_noise(size, SlopeVariance::clamped(0.04), SlopeVariance::clamped(0.02), 7);
        let mut row = SurfaceRow::flat(512);
        let (mut n, mut xx, mut yy, mut x4) = (0.0, 0.0, 0.0, 0.0);
        for y in 0..512 {
            surface.read_row(y, &mut row);
            for i in 0..512 {
                let s = slope_of_normal(row.normal(i)).as_dvec2();
                n += 1.0;
                xx += s.x * s.x;
                yy += s.y * s.y;
                x4 += s.x.powi(4);
            }
        }
        // Waves of the same wave number interfere, which leaves some percent; central differences of
        // 20 periods over 512 texels lose (2 pi 20/512)²/3 = 2 %.
        assert!((xx / n / 0.04 - 1.0).abs() < 0.15, "{}", xx / n);
        assert!((yy / n / 0.02 - 1.0).abs() < 0.15, "{}", yy / n);
        // Kurtosis of a Gaussian is 3; of 128 equal waves 3 - 3/128 in the mean.
        let kurtosis = x4 / n / (xx / n).powi(2);
        assert!((kurtosis - 3.0).abs() < 0.35, "{kurtosis}");
    }
}
