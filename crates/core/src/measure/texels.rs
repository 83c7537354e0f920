//! Map-space error: how far a representation's effective lobes lie from the truth, level by level.
//!
//! The truth of a texel is the mean of the BRDF over the fine normals under it, each weighted by the
//! area that lies inside, in f64 (Han et al. 2007, section 3.2: no masking, no projected-area weights).
//! `error = |approx - truth| / |truth|`, both norms over texels and over directions spread evenly on the
//! unit disk of `w.xy`, radius below 0.97.

use glam::DVec3;
use rand::{SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::brdf::Lobe;
use crate::grid::Size;
use crate::ndf::Method;
use crate::observe::{Cancelled, Observer};
use crate::pyramid::{Pyramid, footprint, level_sizes};
use crate::sphere::DiskLattice;
use crate::surface::{Surface, SurfaceRow};

/// Directions with `w.xy` beyond this radius are left out: at the horizon slopes blow up.
pub const DISK_RADIUS: f64 = 0.97;

/// Most texels of a level that are all measured; of more, [`SAMPLED_TEXELS`] are drawn evenly.
pub const MAX_TEXELS: usize = 512;

/// Texels drawn from a level that has more than [`MAX_TEXELS`].
pub const SAMPLED_TEXELS: usize = 256;

/// The directions that suit a lobe: a lattice of at least 1.4 points per deviation, within bounds.
///
/// 48 a side are enough for any wide lobe; 160 keep the narrowest affordable, and being an even sample
/// they stay unbiased when they are sparse.
#[must_use]
pub fn lattice_for(lobe: &dyn Lobe) -> DiskLattice {
    let deviation = lobe.slope_variance().map_or(1.0, |v| v.get().sqrt());
    let side = (2.0 / (0.7 * deviation)).ceil().clamp(48.0, 160.0);
    DiskLattice::new(side as usize, DISK_RADIUS)
}

/// Fine normals in memory, and the BRDF and directions the truth is asked for.
pub struct TexelTruth<'a> {
    size: Size,
    normals: Vec<[f32; 3]>,
    lobe: &'a dyn Lobe,
    lattice: &'a DiskLattice,
    /// Half-angle beyond which the lobe is below 1e-12 of its peak.
    reach: f64,
}

impl<'a> TexelTruth<'a> {
    /// Reads all of the surface.
    #[must_use]
    pub fn new(surface: &dyn Surface, lobe: &'a dyn Lobe, lattice: &'a DiskLattice) -> Self {
        let size = surface.size();
        let mut normals = Vec::with_capacity(size.area());
        let mut row = SurfaceRow::flat(size.width);
        for y in 0..size.height {
            surface.read_row(y, &mut row);
            normals.extend((0..size.width).map(|i| row.normal(i).to_array()));
        }
        Self { size, normals, lobe, lattice, reach: reach(lobe) }
    }

    /// Size of the finest level.
    #[must_use]
    pub fn size(&self) -> Size {
        self.size
    }

    /// Adds `weight f(w · n)` for every direction that the lobe around `n` reaches.
    fn splat(&self, n: DVec3, weight: f64, scratch: &mut [f64], out: &mut [f64]) {
        // The cap of half-angle r around n spans cos r n.x ± sin r sqrt(1 - n.x²) in x, likewise in y.
        let (sin, cos) = self.reach.sin_cos();
        let span = |c: f64| {
            if self.reach >= 1.57 {
                return (-1.0, 1.0);
            }
            let half = sin * (1.0 - c * c).max(0.0).sqrt();
            // When a pole of the axis lies in the cap, the cap reaches it.
            let low = if -c > cos { -1.0 } else { cos * c - half };
            let high = if c > cos { 1.0 } else { cos * c + half };
            (low, high)
        };
        let ((x0, x1), (y0, y1)) = (span(n.x), span(n.y));
        for (y, range) in &self.lattice.rows {
            if *y < y0 || *y > y1 {
                continue;
            }
            let row = &self.lattice.directions[range.clone()];
            let first = row.partition_point(|w| w.x < x0);
            let last = row.partition_point(|w| w.x <= x1);
            let scratch = &mut scratch[..last - first];
            for (u, w) in scratch.iter_mut().zip(&row[first..last]) {
                *u = w.dot(n);
            }
            self.lobe.evaluate_all(scratch);
            for (out, f) in out[range.start + first..].iter_mut().zip(scratch.iter()) {
                *out += weight * f;
            }
        }
    }

    /// The true effective lobe of texel `(x, y)` of a level of this size, at every direction.
    #[must_use]
    pub fn texel(&self, level: Size, x: usize, y: usize) -> Vec<f64> {
        let mut out = vec![0.0; self.lattice.len()];
        let mut scratch = vec![0.0; self.lattice.len()];
        let (rows, row_weight) = footprint(self.size.height, level.height, y);
        for j in rows {
            let (columns, weight) = footprint(self.size.width, level.width, x);
            for i in columns {
                let n = DVec3::from_array(self.normals[j * self.size.width + i].map(f64::from));
                self.splat(n, row_weight(j) * weight(i), &mut scratch, &mut out);
            }
        }
        out
    }
}

/// Angle beyond which a falling lobe stays below 1e-12 of its peak.
fn reach(lobe: &dyn Lobe) -> f64 {
    let peak = lobe.evaluate(1.0);
    let (mut near, mut far) = (0.0, std::f64::consts::FRAC_PI_2);
    if lobe.evaluate(1e-3) > 1e-12 * peak {
        return far;
    }
    for _ in 0..60 {
        let middle = (near + far) / 2.0;
        if lobe.evaluate(f64::cos(middle)) > 1e-12 * peak { near = middle } else { far = middle }
    }
    far
}

/// Texels of one level and their true lobes.
pub struct TrueLevel {
    /// The level.
    pub level: usize,
    /// Texels measured.
    pub texels: Vec<(usize, usize)>,
    /// The true effective lobe of each, at every direction of the lattice.
    pub lobes: Vec<Vec<f64>>,
}

/// The true lobes of every level.
///
/// Levels with more than [`MAX_TEXELS`] texels are sampled, with a fixed seed, so that two methods are
/// measured on the same texels. A level in whose texels those of a finer one nest is averaged from it.
///
/// # Errors
/// [`Cancelled`] by the observer.
pub fn true_levels(truth: &TexelTruth<'_>, observer: &dyn Observer) -> Result<Vec<TrueLevel>, Cancelled> {
    let sizes = level_sizes(truth.size);
    let mut levels: Vec<TrueLevel> = Vec::with_capacity(sizes.len());
    for (level, size) in sizes.iter().enumerate() {
        let texels = measured_texels(*size, level);
        // The coarsest finer level that was measured whole and whose texels nest in this one's.
        let nested = levels.iter().rev().find(|finer| {
            let fine = sizes[finer.level];
            finer.texels.len() == fine.area()
                && fine.width.is_multiple_of(size.width)
                && fine.height.is_multiple_of(size.height)
        });
        let lobes = match nested {
            Some(finer) => {
                texels.par_iter().map(|t| mean_of_nested(finer, sizes[finer.level], *size, *t)).collect()
            }
            None => {
                let lobe = |(x, y): &(usize, usize)| {
                    observer.check()?;
                    Ok(truth.texel(*size, *x, *y))
                };
                texels.par_iter().map(lobe).collect::<Result<_, Cancelled>>()?
            }
        };
        levels.push(TrueLevel { level, texels, lobes });
        observer.progress((level + 1) as f64 / sizes.len() as f64);
    }
    Ok(levels)
}

fn measured_texels(size: Size, level: usize) -> Vec<(usize, usize)> {
    let at = |i: usize| (i % size.width, i / size.width);
    if size.area() <= MAX_TEXELS {
        return (0..size.area()).map(at).collect();
    }
    let mut random = Pcg64Mcg::seed_from_u64(level as u64);
    if size.area() <= 1 << 20 {
        let mut all: Vec<usize> = (0..size.area()).collect();
        return all.partial_shuffle(&mut random, SAMPLED_TEXELS).0.iter().map(|i| at(*i)).collect();
    }
    // On large levels a repeated draw is too rare to matter, and stays unbiased.
    use rand::RngExt;
    (0..SAMPLED_TEXELS).map(|_| at(random.random_range(0..size.area()))).collect()
}

fn mean_of_nested(finer: &TrueLevel, fine: Size, coarse: Size, (x, y): (usize, usize)) -> Vec<f64> {
    let (columns, rows) = (fine.width / coarse.width, fine.height / coarse.height);
    let mut mean = vec![0.0; finer.lobes[0].len()];
    for j in y * rows..(y + 1) * rows {
        for i in x * columns..(x + 1) * columns {
            let child = &finer.lobes[j * fine.width + i];
            mean.iter_mut().zip(child).for_each(|(sum, f)| *sum += f / (columns * rows) as f64);
        }
    }
    mean
}

/// The error of a baked map at one level.
#[must_use]
pub fn level_error(
    pyramid: &Pyramid,
    method: &dyn Method,
    lobe: &dyn Lobe,
    lattice: &DiskLattice,
    truth: &TrueLevel,
) -> f64 {
    let evaluator = method.evaluator(lobe, &lattice.directions);
    let sums: Vec<(f64, f64)> = truth
        .texels
        .par_iter()
        .zip(&truth.lobes)
        .map(|((x, y), lobe)| {
            let mut approx = vec![0.0; lobe.len()];
            evaluator.evaluate(&pyramid.texel(truth.level, *x, *y), &mut approx);
            let square = |f: &dyn Fn(usize) -> f64| (0..lobe.len()).map(|i| f(i).powi(2)).sum::<f64>();
            (square(&|i| approx[i] - lobe[i]), square(&|i| lobe[i]))
        })
        .collect();
    let (difference, norm) = sums.iter().fold((0.0, 0.0), |(d, n), (a, b)| (d + a, n + b));
    if norm > 0.0 { (difference / norm).sqrt() } else { difference.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::AnyLobe;
    use crate::procedural;

    #[test]
    fn culling_changes_nothing() {
        let lobe = "blinn-phong:200".parse::<AnyLobe>().unwrap();
        let lattice = lattice_for(&*lobe);
        let surface = (procedural::find("armour").unwrap().build)(Size::new(32, 32).unwrap());
        let mut truth = TexelTruth::new(&*surface, &*lobe, &lattice);
        assert!(truth.reach < 1.0);
        let level = Size::new(4, 4).unwrap();
        let fast = truth.texel(level, 1, 2);
        truth.reach = 1.6;
        let slow = truth.texel(level, 1, 2);
        let peak = lobe.evaluate(1.0);
        assert!(fast.iter().zip(&slow).all(|(a, b)| (a - b).abs() < 1e-11 * peak));
    }

    #[test]
    fn nested_levels_equal_direct_ones() {
        let lobe = "blinn-phong:30".parse::<AnyLobe>().unwrap();
        let lattice = DiskLattice::new(16, DISK_RADIUS);
        let surface = (procedural::find("foil").unwrap().build)(Size::new(32, 32).unwrap());
        let truth = TexelTruth::new(&*surface, &*lobe, &lattice);
        let levels = true_levels(&truth, &|_| ()).unwrap();
        for level in &levels[2..] {
            let size = Size::new(32 >> level.level, 32 >> level.level).unwrap();
            let direct = truth.texel(size, 0, 0);
            assert!(direct.iter().zip(&level.lobes[0]).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }
}
