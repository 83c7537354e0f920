//! Gaussian noise on a sphere, as a height map of longitude and latitude: the primitive of Dupuy et al. 2013,
//! figure 4.
//!
//! Slopes have the same deviations in the local frame everywhere on the sphere, however the map is stretched
//! near the poles. The height is a sum of wave packets (Lagae et al. 2009, "Procedural noise using sparse
//! Gabor convolution", whose kernels these are): each a cosine of random phase under a Gaussian, its wave
//! vector turned at random in the frame of its own place, all of one length on an ellipse. Many overlap at
//! every point, and so height and slopes are Gaussian.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::grid::{Grid, Size};
use crate::surface::{HeightField, SlopeFilter, Wrap, Wraps};

/// Texels of the equator in a wave.
const WAVE: f64 = 12.0;

/// Wave packets that overlap at a point, in units of their own area, 2 pi radius².
const OVERLAP: f64 = 16.0;

/// Distance at which a packet is cut off, in its radii: there it has 1 % of its height.
const CUT: f64 = 3.0;

/// Grain of a rough sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grain {
    /// Alike on all sides.
    Isotropic,
    /// Scratches along the equator: slopes run up and down the meridians, five times those along.
    Latitudinal,
    /// Scratches from pole to pole: slopes run round the sphere.
    Longitudinal,
}

impl Grain {
    /// Deviations of the slopes eastward and northward, for one of `deviation` across the grain.
    #[must_use]
    pub fn deviations(self, deviation: f64) -> DVec2 {
        match self {
            Self::Isotropic => DVec2::splat(deviation),
            Self::Latitudinal => DVec2::new(0.2 * deviation, deviation),
            Self::Longitudinal => DVec2::new(deviation, 0.2 * deviation),
        }
    }
}

/// A packet of waves.
struct Packet {
    longitude: f64,
    latitude: f64,
    /// Place on the unit sphere.
    at: DVec3,
    /// Wave vector, eastward and northward.
    wave: DVec2,
    phase: f64,
}

/// Heights of a unit sphere whose slopes have these deviations eastward and northward, in units of the length
/// `depth`.
///
/// The map goes once around and from the north pole to the south pole. It is as fine as its size allows: a
/// wave has twelve texels at the equator.
#[must_use]
pub fn sphere_noise(size: Size, deviations: DVec2, depth: f64, seed: u64) -> HeightField {
    // Wave number of the longest wave vector, per radian; a packet is as wide as a wave is long.
    let number = (size.width as f64 / WAVE).max(2.0);
    let radius = TAU / number;
    // Mean square slope of a packet on an axis, over the packet: k²/4 by its waves, turned at random (twice
    // that on the longer axis of the ellipse), and this by its Gaussian; each times half of the Gaussian's
    // square. The two axes' waves make up for the Gaussian.
    let own = 0.5 / (radius * radius);
    let largest = deviations.max_element();
    let axis = |deviation: f64| {
        let square = (deviation / largest).powi(2);
        (square * number * number - 2.0 * own * (1.0 - square)).max(0.0).sqrt()
    };
    let axes = DVec2::new(axis(deviations.x), axis(deviations.y));
    let count = (OVERLAP * 4.0 * PI / (TAU * radius * radius)).ceil() as usize;
    let each = radius * radius / 8.0 * (own + number * number / 2.0);
    let amplitude = largest / (each * count as f64).sqrt() / depth;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let packet = |_| {
        let [longitude, z, turn, phase]: [f64; 4] = random.random();
        let (longitude, latitude) = (TAU * longitude, (2.0 * z - 1.0).asin());
        let turn = TAU * turn;
        Packet {
            longitude,
            latitude,
            at: on_sphere(longitude, latitude),
            wave: axes * DVec2::from_angle(turn),
            phase: TAU * phase,
        }
    };
    let packets: Vec<Packet> = (0..count).map(packet).collect();
    let row = |y: usize| {
        let latitude = PI * (0.5 - (y as f64 + 0.5) / size.height as f64);
        let mut heights = vec![0.0; size.width];
        let near = packets.iter().filter(|p| (p.latitude - latitude).abs() < 1.1 * CUT * radius);
        near.for_each(|packet| packet.add_to(&mut heights, latitude, radius));
        heights
    };
    let rows: Vec<Vec<f64>> = (0..size.height).into_par_iter().map(row).collect();
    HeightField {
        heights: Grid::from_fn(size, |x, y| (amplitude * rows[y][x]) as f32),
        wraps: Wraps { x: Wrap::Repeat, y: Wrap::Clamp },
        filter: SlopeFilter::CentralDifference,
    }
}

impl Packet {
    /// Adds the packet to a row of the map.
    fn add_to(&self, heights: &mut [f64], latitude: f64, radius: f64) {
        let width = heights.len() as f64;
        let (sin, cos) = latitude.sin_cos();
        let (own_sin, own_cos) = self.latitude.sin_cos();
        // Within reach where the chord is short enough: |p - at|² = 2 - 2 p·at.
        let least = 1.0 - (CUT * radius).powi(2) / 2.0;
        let reach = (least - sin * own_sin) / (cos * own_cos).max(f64::MIN_POSITIVE);
        if reach > 1.0 {
            return;
        }
        let reach = reach.max(-1.0).acos() / TAU * width;
        let middle = self.longitude / TAU * width - 0.5;
        let (first, last) = ((middle - reach).ceil() as i64, (middle + reach).floor() as i64);
        // All the way round, but once.
        let last = last.min(first + heights.len() as i64 - 1);
        for x in first..=last {
            let turn = (x as f64 - middle) / width * TAU;
            let away = on_sphere(self.longitude + turn, latitude) - self.at;
            // Along the parallels and the meridians, so that waves keep to the local frame as it turns near
            // the poles.
            let along = DVec2::new(turn * own_cos, latitude - self.latitude);
            let envelope = (-away.length_squared() / (2.0 * radius * radius)).exp();
            let height = envelope * (self.wave.dot(along) + self.phase).cos();
            heights[x.rem_euclid(heights.len() as i64) as usize] += height;
        }
    }
}

fn on_sphere(longitude: f64, latitude: f64) -> DVec3 {
    let ((sin, cos), (up, out)) = (longitude.sin_cos(), latitude.sin_cos());
    DVec3::new(out * cos, out * sin, up)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_gaussian_with_the_deviations_everywhere() {
        let size = Size { width: 1024, height: 512 };
        for grain in [Grain::Isotropic, Grain::Latitudinal, Grain::Longitudinal] {
            let asked = grain.deviations(0.25);
            let heights = sphere_noise(size, asked, 1.0, 3).heights;
            // Between 60 degrees south and north, and nearer to the poles: the latter are 12 % of the sphere.
            for (from, to, tolerance) in [(0.0, 60.0, 0.05), (60.0, 80.0, 0.12)] {
                let (mut n, mut east, mut north, mut fourth) = (0.0, 0.0, 0.0, 0.0);
                for y in 1..size.height - 1 {
                    let latitude = 90.0 - (y as f64 + 0.5) / size.height as f64 * 180.0;
                    if !(from..to).contains(&latitude.abs()) {
                        continue;
                    }
                    let cos = latitude.to_radians().cos();
                    for x in 0..size.width {
                        let h = |dx: usize, dy: usize| {
                            f64::from(heights.row(y + dy - 1)[(x + dx + size.width - 1) % size.width])
                        };
                        let texel = TAU / size.width as f64;
                        let (e, u) =
                            ((h(2, 1) - h(0, 1)) / (2.0 * texel * cos), (h(1, 0) - h(1, 2)) / (2.0 * texel));
                        n += cos;
                        east += cos * e * e;
                        north += cos * u * u;
                        fourth += cos * u.powi(4);
                    }
                }
                // Central differences of waves of twelve texels lose (2 pi/12)²/6 = 4.6 %, longer ones less
                // by the square. Chance leaves an error of 1/sqrt(250) of the variance near the poles, which
                // have some 250 packets' worth of independent places; elsewhere has ten times as many.
                let lost = DVec2::ONE - 0.046 * (asked / asked.max_element()).powf(2.0);
                let got = DVec2::new((east / n).sqrt(), (north / n).sqrt()) / lost;
                assert!(
                    ((got - asked) / asked).abs().max_element() < tolerance,
                    "{grain:?} {from}: {got} for {asked}"
                );
                // 3 for a Gaussian; packets that overlap some dozen times leave about 0.2 more.
                let kurtosis = fourth / n / (north / n).powi(2);
                assert!((kurtosis - 3.0).abs() < 0.6, "{grain:?} {from}: {kurtosis}");
            }
        }
    }
}
