//! Map-space error: how far a representation's effective lobes lie from the truth, level by level.
//!
//! The truth of a texel is the mean of the BRDF over the fine normals under it, each weighted by the
//! area that lies inside, in f64 (Han et al. 2007, section 3.2: no masking, no projected-area weights).
//! `error = |approx - truth| / |truth|`, both norms over texels and over directions spread evenly on the
//! unit disk of `w.xy`, radius below 0.97.

use std::ops::RangeInclusive;

use glam::DVec3;
use rayon::prelude::*;

use super::aspect::{AspectEvaluator, Aspects, Places, Reflectance};
use super::estimate::{Draws, Estimate, Sampled, Squares};
use crate::brdf::Lobe;
use crate::grid::Size;
use crate::ndf::{Evaluator, Shows};
use crate::observe::{Cancelled, Observer};
use crate::pyramid::{Pyramid, footprint, level_sizes};
use crate::sphere::DiskLattice;
use crate::surface::{Surface, SurfaceRow};

/// Directions with `w.xy` beyond this radius are left out: at the horizon slopes blow up.
pub const DISK_RADIUS: f64 = 0.97;

/// Most texels of a level that are all measured without drawing some first.
pub const MAX_TEXELS: usize = 512;

/// Most values of the true lobes of a level that are kept at once, half a gigabyte.
const MOST_VALUES: usize = 1 << 26;

/// Texels drawn at a time from a level that has more than [`MAX_TEXELS`].
pub const SAMPLED_TEXELS: usize = 256;

/// Most texels drawn of a level.
pub const MOST_SAMPLED: usize = 4096;

/// Points a side of the lattice of directions: enough for any wide lobe, and most, for the narrowest.
const SIDES: RangeInclusive<f64> = 48.0..=320.0;

/// Lobe too narrow for errors to be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "`{lobe}` is too narrow to be measured: it deviates by {deviation:.2e}, and errors are taken at directions \
     {step:.2e} apart, between which it would fall; take a wider lobe"
)]
pub struct TooNarrow {
    /// Spelling of the lobe.
    pub lobe: String,
    /// Deviation of its slopes on one axis.
    pub deviation: f64,
    /// Least step between directions.
    pub step: f64,
}

/// The directions that suit a lobe: a lattice of at least 1.4 points per deviation; for the narrowest lobes
/// of one point or more.
///
/// # Errors
/// [`TooNarrow`] for a lobe that could fall between the points.
pub fn lattice_for(lobe: &dyn Lobe) -> Result<DiskLattice, TooNarrow> {
    let deviation = lobe.slope_variance().map_or(1.0, |v| v.get().sqrt());
    let step = 2.0 / SIDES.end();
    if deviation < step {
        return Err(TooNarrow { lobe: lobe.to_string(), deviation, step });
    }
    let side = (2.0 / (0.7 * deviation)).ceil().clamp(*SIDES.start(), *SIDES.end());
    Ok(DiskLattice::new(side as usize, DISK_RADIUS))
}

/// Fine normals in memory, and the BRDF and directions the truth is asked for.
pub struct TexelTruth<'a> {
    size: Size,
    normals: Vec<[f32; 3]>,
    aspects: Aspects<'a>,
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
        let aspects = Aspects::new(lobe);
        let reach = aspects.reach();
        Self { size, normals, aspects, lattice, reach }
    }

    /// Size of the finest level.
    #[must_use]
    pub fn size(&self) -> Size {
        self.size
    }

    /// True where the lobe stands for a measured material, which it does not equal.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        self.aspects.count() > 1
    }

    /// Number of values of a texel: directions, once for each aspect of the material. A lobe has one; a
    /// measured material has three channels at three difference angles.
    #[must_use]
    pub fn values(&self) -> usize {
        self.aspects.count() * self.lattice.len()
    }

    /// An evaluator of what a method shows in the place of [`Self::texel`].
    pub fn shown_by<'b>(&'b self, method: &'b dyn Shows) -> impl Evaluator + 'b {
        AspectEvaluator::new(&self.aspects, method, &self.lattice.directions)
    }

    /// Adds `weight f(w · n)` for every direction that the lobe around `n` reaches, in every aspect.
    fn splat(&self, (n, weight): (DVec3, f64), by: Reflectance, scratch: &mut [f64], out: &mut [f64]) {
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
            let to = Places { out, first: range.start + first, stride: self.lattice.len() };
            self.aspects.add(by, scratch, weight, to);
        }
    }

    /// The true effective lobe of texel `(x, y)` of a level of this size: at every direction, aspect after
    /// aspect, [`Self::values`] in all.
    #[must_use]
    pub fn texel(&self, level: Size, x: usize, y: usize) -> Vec<f64> {
        self.mean_of_normals(level, (x, y), Reflectance::True)
    }

    /// That lobe, by the factors of a measured material in its place: what factoring alone costs.
    #[must_use]
    pub fn factored_texel(&self, level: Size, x: usize, y: usize) -> Vec<f64> {
        self.mean_of_normals(level, (x, y), Reflectance::Factored)
    }

    fn mean_of_normals(&self, level: Size, (x, y): (usize, usize), by: Reflectance) -> Vec<f64> {
        let mut out = vec![0.0; self.values()];
        let mut scratch = vec![0.0; self.lattice.len()];
        let (rows, row_weight) = footprint(self.size.height, level.height, y);
        for j in rows {
            let (columns, weight) = footprint(self.size.width, level.width, x);
            for i in columns {
                let n = DVec3::from_array(self.normals[j * self.size.width + i].map(f64::from));
                self.splat((n, row_weight(j) * weight(i)), by, &mut scratch, &mut out);
            }
        }
        out
    }
}

/// All texels of one level and their true lobes.
struct TrueLevel {
    /// The level.
    level: usize,
    /// Texels, row by row.
    texels: Vec<(usize, usize)>,
    lobes: Lobes,
}

/// Lobes of some texels, at every direction of the lattice.
struct Lobes {
    /// The true effective lobe of each.
    true_ones: Vec<Vec<f64>>,
    /// That by the factors of a measured material; empty for other lobes.
    factored: Vec<Vec<f64>>,
}

/// Map to be measured.
#[derive(Clone, Copy)]
pub struct BakedMap<'a> {
    /// The levels.
    pub pyramid: &'a Pyramid,
    /// Level of the surface that the map's finest is; finer ones it leaves out.
    pub from_level: usize,
    /// Method that made them, or engine that shades them.
    pub method: &'a dyn Shows,
}

/// Texels of a level of `size`, all of them.
pub(super) fn all_texels(size: Size) -> Vec<(usize, usize)> {
    (0..size.area()).map(|i| (i % size.width, i / size.width)).collect()
}

impl TexelTruth<'_> {
    /// All texels of a level. They are averaged from a finer level, where one is given whose texels nest in
    /// these.
    fn level(
        &self,
        level: usize,
        finer: Option<&TrueLevel>,
        observer: &dyn Observer,
    ) -> Result<TrueLevel, Cancelled> {
        let sizes = level_sizes(self.size);
        let (size, texels) = (sizes[level], all_texels(sizes[level]));
        let nested = finer.filter(|finer| {
            let fine = sizes[finer.level];
            fine.width.is_multiple_of(size.width) && fine.height.is_multiple_of(size.height)
        });
        let lobes = match nested {
            Some(finer) => {
                let means = |lobes: &[Vec<f64>]| -> Vec<Vec<f64>> {
                    let of = |t: &(usize, usize)| mean_of_nested(lobes, sizes[finer.level], size, *t);
                    if lobes.is_empty() { Vec::new() } else { texels.par_iter().map(of).collect() }
                };
                let Lobes { true_ones, factored } = &finer.lobes;
                Lobes { true_ones: means(true_ones), factored: means(factored) }
            }
            None => self.lobes(size, &texels, observer)?,
        };
        Ok(TrueLevel { level, texels, lobes })
    }

    /// Lobes of some texels of a level.
    fn lobes(
        &self,
        size: Size,
        texels: &[(usize, usize)],
        observer: &dyn Observer,
    ) -> Result<Lobes, Cancelled> {
        let factored = |(x, y): &(usize, usize)| {
            observer.check()?;
            Ok(self.factored_texel(size, *x, *y))
        };
        let factored: Result<_, Cancelled> =
            if self.is_measured() { texels.par_iter().map(factored).collect() } else { Ok(Vec::new()) };
        Ok(Lobes { true_ones: self.texels(size, texels, observer)?, factored: factored? })
    }

    /// True lobes of some texels of a level.
    pub(super) fn texels(
        &self,
        size: Size,
        texels: &[(usize, usize)],
        observer: &dyn Observer,
    ) -> Result<Vec<Vec<f64>>, Cancelled> {
        let lobe = |(x, y): &(usize, usize)| {
            observer.check()?;
            Ok(self.texel(size, *x, *y))
        };
        texels.par_iter().map(lobe).collect()
    }

    /// Draws of a level's texels.
    pub(super) fn draws(&self, size: Size) -> Draws {
        let spread = |i: usize| {
            let (rows, row_weight) = footprint(self.size.height, size.height, i / size.width);
            let mut mean = DVec3::ZERO;
            for j in rows {
                let (columns, weight) = footprint(self.size.width, size.width, i % size.width);
                for i in columns {
                    let n = DVec3::from_array(self.normals[j * self.size.width + i].map(f64::from));
                    mean += row_weight(j) * weight(i) * n;
                }
            }
            (1.0 - mean.length_squared()).max(0.0)
        };
        Draws::new(size, (0..size.area()).into_par_iter().map(spread).collect())
    }
}

/// Errors of every level, finest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelErrors {
    /// Errors of each map, from its own finest level on.
    pub maps: Vec<Vec<Estimate>>,
    /// Share of a measured material's factors in them: the error of the normals as they are, shaded by the
    /// factors. Empty for other lobes.
    pub factoring: Vec<Estimate>,
}

/// Errors of maps of one surface at every level, map by map; each map is measured at the same texels.
///
/// A level of at most [`MAX_TEXELS`] texels is measured whole. Of others texels are drawn, more of them where
/// normals vary, until the standard error of every map's error is below a fiftieth of it, or
/// [`MOST_SAMPLED`] are drawn, or as many as there are: then all are measured.
///
/// # Errors
/// [`Cancelled`] by the observer.
pub fn level_errors(
    truth: &TexelTruth<'_>,
    maps: &[BakedMap<'_>],
    observer: &dyn Observer,
) -> Result<LevelErrors, Cancelled> {
    let sizes = level_sizes(truth.size);
    let figures = maps.len() + usize::from(truth.is_measured());
    let mut errors = vec![Vec::with_capacity(sizes.len()); figures];
    let mut finer: Option<TrueLevel> = None;
    for (level, size) in sizes.iter().enumerate() {
        let mut drawn = Sampled::new(figures);
        // All lobes of a level are kept, twice for a measured material: of many values each, fewer.
        if size.area() > MAX_TEXELS.min(MOST_VALUES / truth.values()) {
            let draws = truth.draws(*size);
            while !drawn.is_enough(MOST_SAMPLED.min(size.area())) {
                let places = draws.draw(SAMPLED_TEXELS, level, drawn.batches);
                let texels: Vec<(usize, usize)> = places.iter().map(|d| d.texel).collect();
                drawn.add(&places, measured(truth, maps, level, &texels, observer)?);
            }
        }
        let estimates = if drawn.batches == 0 {
            let whole = truth.level(level, finer.as_ref(), observer)?;
            let squares = all_squares(truth, maps, (level, &whole.texels), &whole.lobes);
            let own = squares.iter().map(|squares| Estimate::of(squares, None)).collect();
            // Coarser ones are averaged from it where they nest in it.
            finer = Some(whole);
            own
        } else if drawn.weights.len() >= size.area() {
            // In parts: all lobes of a large level at once are gigabytes.
            let mut whole = vec![Vec::new(); figures];
            for texels in all_texels(*size).chunks(SAMPLED_TEXELS) {
                let own = measured(truth, maps, level, texels, observer)?;
                whole.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
            }
            whole.iter().map(|squares| Estimate::of(squares, None)).collect()
        } else {
            drawn.estimates()
        };
        errors.iter_mut().zip(estimates).for_each(|(errors, estimate)| errors.push(estimate));
        observer.progress((level + 1) as f64 / sizes.len() as f64);
    }
    // Of levels that a map leaves out there is no error.
    errors
        .iter_mut()
        .zip(maps)
        .for_each(|(errors, map)| drop(errors.drain(..map.from_level.min(errors.len()))));
    let factoring = if truth.is_measured() { errors.pop().unwrap_or_default() } else { Vec::new() };
    Ok(LevelErrors { maps: errors, factoring })
}

/// Sums of squares of some texels of a level, map by map, and last of a measured material's factors.
fn measured(
    truth: &TexelTruth<'_>,
    maps: &[BakedMap<'_>],
    level: usize,
    texels: &[(usize, usize)],
    observer: &dyn Observer,
) -> Result<Vec<Vec<Squares>>, Cancelled> {
    let lobes = truth.lobes(level_sizes(truth.size)[level], texels, observer)?;
    Ok(all_squares(truth, maps, (level, texels), &lobes))
}

/// [`measured`], with the true lobes at hand.
fn all_squares(
    truth: &TexelTruth<'_>,
    maps: &[BakedMap<'_>],
    (level, texels): (usize, &[(usize, usize)]),
    Lobes { true_ones, factored }: &Lobes,
) -> Vec<Vec<Squares>> {
    let mut all: Vec<_> = maps.iter().map(|map| squares(truth, map, level, texels, true_ones)).collect();
    if truth.is_measured() {
        let of = |(factored, lobe): (&Vec<f64>, &Vec<f64>)| {
            let mut sums = Squares::default();
            sums.add(factored, lobe);
            sums
        };
        all.push(factored.iter().zip(true_ones).map(of).collect());
    }
    all
}

/// Sums of squares of a map's texels against their true lobes.
fn squares(
    truth: &TexelTruth<'_>,
    map: &BakedMap<'_>,
    level: usize,
    texels: &[(usize, usize)],
    lobes: &[Vec<f64>],
) -> Vec<Squares> {
    let Some(own_level) = level.checked_sub(map.from_level) else {
        return vec![Squares::default(); texels.len()];
    };
    let evaluator = truth.shown_by(map.method);
    let of = |((x, y), lobe): (&(usize, usize), &Vec<f64>)| {
        let mut approx = vec![0.0; lobe.len()];
        evaluator.evaluate(&map.pyramid.texel(own_level, *x, *y), &mut approx);
        let mut sums = Squares::default();
        sums.add(&approx, lobe);
        sums
    };
    texels.par_iter().zip(lobes).map(of).collect()
}

fn mean_of_nested(lobes: &[Vec<f64>], fine: Size, coarse: Size, (x, y): (usize, usize)) -> Vec<f64> {
    let (columns, rows) = (fine.width / coarse.width, fine.height / coarse.height);
    let mut mean = vec![0.0; lobes[0].len()];
    for j in y * rows..(y + 1) * rows {
        for i in x * columns..(x + 1) * columns {
            let child = &lobes[j * fine.width + i];
            mean.iter_mut().zip(child).for_each(|(sum, f)| *sum += f / (columns * rows) as f64);
        }
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::AnyLobe;
    use crate::procedural;

    #[test]
    fn culling_changes_nothing() {
        let lobe = "blinn-phong:200".parse::<AnyLobe>().unwrap();
        let lattice = lattice_for(&*lobe).unwrap();
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
    fn lobes_that_would_fall_between_directions_are_refused() {
        for (spelling, measured) in
            [("lambert", true), ("ggx:0.01", true), ("ggx:0.003", false), ("blinn-phong:100000", false)]
        {
            let lobe = spelling.parse::<AnyLobe>().unwrap();
            let lattice = lattice_for(&*lobe);
            assert_eq!(lattice.is_ok(), measured, "{spelling}");
            if let Err(error) = lattice {
                assert!(error.to_string().contains(spelling), "{error}");
            }
        }
        // A flat map is right under the narrowest lobe that is measured.
        let lobe = "ggx:0.01".parse::<AnyLobe>().unwrap();
        let lattice = lattice_for(&*lobe).unwrap();
        let normals = crate::grid::Grid::from_fn(Size::new(4, 4).unwrap(), |_, _| glam::Vec3::Z);
        let flat = crate::surface::NormalGrid { normals, wraps: crate::surface::Wraps::default() };
        let method = "vmf:1".parse::<crate::ndf::AnyMethod>().unwrap();
        let pyramid = crate::bake::Bake::new(&flat, &*method).to_pyramid().unwrap().0;
        let truth = TexelTruth::new(&flat, &*lobe, &lattice);
        let maps = [BakedMap { pyramid: &pyramid, from_level: 0, method: &*method }];
        for estimate in &level_errors(&truth, &maps, &|_| ()).unwrap().maps[0] {
            assert!(estimate.error < 1e-6 && estimate.standard_error == 0.0, "{estimate:?}");
        }
    }

    #[test]
    fn nested_levels_equal_direct_ones() {
        let lobe = "blinn-phong:30".parse::<AnyLobe>().unwrap();
        let lattice = DiskLattice::new(16, DISK_RADIUS);
        let surface = (procedural::find("foil").unwrap().build)(Size::new(32, 32).unwrap());
        let truth = TexelTruth::new(&*surface, &*lobe, &lattice);
        let finer = truth.level(1, None, &|_| ()).unwrap();
        for level in 2..6 {
            let size = Size::new(32 >> level, 32 >> level).unwrap();
            let (direct, nested) =
                (truth.texel(size, 0, 0), truth.level(level, Some(&finer), &|_| ()).unwrap());
            assert!(direct.iter().zip(&nested.lobes.true_ones[0]).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }
}
