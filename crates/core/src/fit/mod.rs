//! Fitting: from the fine normals under each texel of each level to a few lobes, whose sums are then stored.
//!
//! Two questions are answered apart. *Which lobes?* Expectation maximisation (`em.rs`), then descent on the
//! error that is seen (`refine.rs`). *Which lobe of this texel goes with which of its neighbours'?* What a
//! filter mixes must belong together, so every alignment but `unaligned` goes from the coarsest level down
//! and starts each texel from its parent. [`Alignment`] has the choices, from the papers' to ours. Everything
//! works on sums of sufficient statistics (`family.rs`), so both kinds of lobe share all of it.
//!
//! Bytes do not depend on threads: a texel depends on its parent, its own samples and texels of earlier
//! passes only.

mod assign;
mod coherent;
mod em;
mod family;
mod matching;
mod peaks;
mod refine;
mod samples;

use std::ops::Range;

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

pub use assign::MAX_LOBES;
pub(crate) use family::from_pole;
pub use peaks::SHARPEST;

use self::assign::{assign, shares};
use self::coherent::PriorContext;
use self::em::{iterate, log_likelihood, naturals, start_at_random, start_from_furthest};
use self::family::{Family, Planar, Spherical, log_density};
use self::matching::match_lobes;
use self::refine::LevelLobes;
use self::samples::{SampleGrid, Samples, Samplings};
use crate::grid::{Grid, Size};
use crate::observe::{Cancelled, Observer};
use crate::pyramid::{footprint, level_sizes};
use crate::surface::{Surface, SurfaceRow};
use crate::words;

/// The shape of the lobes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeKind {
    /// Von Mises-Fisher; sums of `(1, n.x, n.y, 1 - n.z)`.
    Spherical,
    /// Isotropic Gaussians of `n.xy`; sums of `(1, n.x, n.y, n.x² + n.y²)`.
    Planar,
    /// Phong peaks `(weight, n.x, n.y, exponent)`, which are no sums and cannot be filtered or aligned.
    Peaks,
    /// Gaussians of `n.xy` of any covariance; sums of `(1, n.x, n.y, n.x², n.y², n.x n.y)`. Only tests have
    /// them.
    #[cfg(test)]
    Elliptic,
}

impl LobeKind {
    /// Statistics of a lobe, its weight among them.
    #[must_use]
    pub fn statistics(self) -> usize {
        match self {
            Self::Spherical | Self::Planar | Self::Peaks => 4,
            #[cfg(test)]
            Self::Elliptic => 6,
        }
    }

    /// RGBA layers of a lobe.
    #[must_use]
    pub fn layers(self) -> usize {
        self.statistics().div_ceil(4)
    }
}

/// Alignment: the way in which lobes of neighbouring texels are made to correspond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Alignment {
    /// Started from the parent, then moved towards the least error at texels and between them: ours.
    #[default]
    Refined,
    /// Started from the parent, then plain EM.
    Parent,
    /// Started from the parent, EM with the papers' prior over the parent and the neighbours already fitted.
    Prior,
    /// Each texel by itself, its lobes then put in its parent's order.
    Matched,
    /// Each texel by itself.
    Unaligned,
}

words!(Alignment {
    Refined => "refined",
    Parent => "parent",
    Prior => "prior",
    Matched => "matched",
    Unaligned => "unaligned",
});

/// Fit to be made: kind, number and alignment of the lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The shape of the lobes.
    pub kind: LobeKind,
    /// Lobes a texel, 1 to [`MAX_LOBES`].
    pub lobes: usize,
    /// Alignment of the lobes.
    pub alignment: Alignment,
    /// Strength of the papers' prior, `c` of Tan et al. and `C` of Han et al.: the number of normals that a
    /// neighbour's whole texel counts for. Only [`Alignment::Prior`] has one.
    pub prior: f32,
    /// True for EM as Han et al. print it: an E-step without weights, and a prior that counts no normals.
    pub printed: bool,
}

impl Fit {
    /// Fit of lobes, with the default alignment and a prior of 1.
    #[must_use]
    pub fn new(kind: LobeKind, lobes: usize) -> Self {
        Self { kind, lobes, alignment: Alignment::default(), prior: 1.0, printed: false }
    }
}

/// Value of an attribute, four channels.
pub type Rgba = [f32; 4];

/// Fit job: the maps that lobes are fitted to.
pub struct FitJob<'a> {
    /// The finest level.
    pub surface: &'a dyn Surface,
    /// Other maps of the same size whose values each lobe is to carry.
    pub attributes: &'a [Grid<Rgba>],
    /// Observer of the fit.
    pub observer: &'a dyn Observer,
}

/// Fitted rows of a level.
pub struct FittedRows<'a> {
    /// Level, 0 the finest.
    pub level: usize,
    /// Size of the level.
    pub size: Size,
    /// Rows of the level.
    pub rows: Range<usize>,
    /// Sums of a lobe: its weight, then its other statistics.
    pub statistics: usize,
    /// Sums: the lobes of a texel one after another, texel by texel. Weights of a texel sum to one.
    pub sums: &'a [f32],
    /// For each attribute the lobes' weighted means `alpha y`, in the order of `sums`.
    pub attributes: &'a [Vec<Rgba>],
}

/// Rounds of EM for a texel that starts from furthest points.
const ALONE_ROUNDS: usize = 40;

/// Starts for a texel that is fitted by itself.
const ALONE_STARTS: usize = 4;

/// Rounds of EM for a texel that starts from its parent, where nothing follows.
const PARENT_ROUNDS: usize = 10;

/// Starts tried for the coarsest texel, and rounds of EM for each.
const STARTS: usize = 16;
const START_ROUNDS: usize = 5;

/// Rounds of EM before refinement, and of refinement for each lobe.
const ROUNDS_BEFORE: usize = 4;
const REFINE_ROUNDS_PER_LOBE: usize = 4;

/// Levels finer than this hold few normals a texel, which EM meets exactly or nearly: they are refined less
/// or not at all.
const FIRST_REFINED: usize = 2;
const FIRST_REFINED_WELL: usize = 3;

/// Rounds of EM, and of refinement, below [`FIRST_REFINED_WELL`].
const FINE_ROUNDS: usize = 1;
const FINE_REFINE_ROUNDS: usize = 4;

/// Rows of the finest level made at a time.
const BAND: usize = 16;

/// A lobe of less weight dies: half floats could no longer hold it.
const LEAST_WEIGHT: f32 = 1.0 / 8192.0;

/// Fits every level and hands on its rows, each once, levels in no particular order.
///
/// # Errors
/// The first error of `emit`, at which it stops, or [`Cancelled`] by the observer.
///
/// # Panics
/// When an attribute has another size than the surface, peaks are to carry one, or `lobes` is out of range.
pub fn fit_levels<E: From<Cancelled>>(
    fit: &Fit,
    job: &FitJob<'_>,
    emit: &mut dyn FnMut(&FittedRows<'_>) -> Result<(), E>,
) -> Result<(), E> {
    assert!((1..=MAX_LOBES).contains(&fit.lobes), "a texel has 1 to {MAX_LOBES} lobes");
    let size = job.surface.size();
    assert!(job.attributes.iter().all(|a| a.size() == size), "attributes are as large as the surface");
    match fit.kind {
        LobeKind::Spherical if fit.printed => Fitter::<_, 4>::new(Spherical::<true>, fit, job).run(emit),
        LobeKind::Spherical => Fitter::<_, 4>::new(Spherical::<false>, fit, job).run(emit),
        LobeKind::Planar => Fitter::<_, 4>::new(Planar, fit, job).run(emit),
        LobeKind::Peaks => peaks::fit_levels(fit.lobes, job, emit),
        #[cfg(test)]
        LobeKind::Elliptic => Fitter::<_, 6>::new(family::Elliptic, fit, job).run(emit),
    }
}

struct Fitter<'a, F, const N: usize> {
    family: F,
    fit: &'a Fit,
    job: &'a FitJob<'a>,
    sizes: Vec<Size>,
    samplings: Samplings<N>,
}

/// Level whose sums are known.
pub(crate) struct Level<const N: usize> {
    size: Size,
    sums: Vec<[f32; N]>,
}

impl<const N: usize> Level<N> {
    /// The texel that covers the middle of texel `(x, y)` of a level of `finer` size.
    fn index_over(&self, finer: Size, (x, y): (usize, usize)) -> usize {
        over(y, finer.height, self.size.height) * self.size.width + over(x, finer.width, self.size.width)
    }

    /// The lobes of the texel that covers the middle of texel `(x, y)` of a level of `finer` size.
    fn over(&self, finer: Size, lobes: usize, (x, y): (usize, usize)) -> &[[f32; N]] {
        &self.sums[self.index_over(finer, (x, y)) * lobes..][..lobes]
    }

    /// `theta` of every lobe of some rows, in place of their sums: several children ask a parent for them.
    fn thetas(&self, family: impl Family<N>, lobes: usize, rows: Range<usize>) -> Vec<[f32; N]> {
        let line = self.size.width * lobes;
        self.sums[rows.start * line..rows.end * line].par_iter().map(|sums| family.natural(sums)).collect()
    }
}

/// The texel of a coarser side that covers the middle of texel `i` of a finer one.
fn over(i: usize, finer: usize, coarser: usize) -> usize {
    ((2 * i + 1) * coarser / (2 * finer)).min(coarser - 1)
}

impl<'a, F: Family<N>, const N: usize> Fitter<'a, F, N> {
    fn new(family: F, fit: &'a Fit, job: &'a FitJob<'a>) -> Self {
        let sizes = level_sizes(job.surface.size());
        let samplings = Samplings::new(family, job.surface, &sizes);
        Self { family, fit, job, sizes, samplings }
    }

    fn run<E: From<Cancelled>>(
        &self,
        emit: &mut dyn FnMut(&FittedRows<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.job.observer.progress(0.05);
        match self.fit.alignment {
            Alignment::Unaligned => {
                for (level, made) in self.alone()?.into_iter().enumerate().skip(1) {
                    self.hand_on(level, &made, emit)?;
                }
                self.finest(None, emit)
            }
            Alignment::Matched => {
                let mut levels = self.alone()?;
                for coarse in (1..levels.len() - 1).rev() {
                    let (finer, parents) = levels.split_at_mut(coarse + 1);
                    let (parent, child) = (&parents[0], &mut finer[coarse]);
                    let size = child.size;
                    child.sums.par_chunks_mut(self.fit.lobes).enumerate().for_each(|(i, sums)| {
                        match_lobes(self.family, parent.over(size, self.fit.lobes, at(size, i)), sums);
                    });
                }
                for (level, made) in levels.iter().enumerate().skip(1) {
                    self.hand_on(level, made, emit)?;
                }
                self.finest(levels.get(1), emit)
            }
            _ => {
                let mut parent: Option<Level<N>> = None;
                for level in (1..self.sizes.len()).rev() {
                    let made = self.descend(level, parent.as_ref());
                    self.job.observer.check()?;
                    self.hand_on(level, &made, emit)?;
                    parent = Some(made);
                    self.job.observer.progress(1.0 - 0.9 * level as f64 / self.sizes.len() as f64);
                }
                self.finest(parent.as_ref(), emit)
            }
        }
    }

    fn empty(&self, level: usize) -> Level<N> {
        let size = self.sizes[level];
        Level { size, sums: vec![[0.0; N]; size.area() * self.fit.lobes] }
    }

    /// Fits every level above the finest, each texel by itself: takes the likeliest lobes that EM finds from
    /// the normals furthest apart, from the furthest of the lobes of the finer texels below it, and from
    /// seeds drawn at random.
    fn alone(&self) -> Result<Vec<Level<N>>, Cancelled> {
        let lobes = self.fit.lobes;
        let mut levels = vec![Level { size: self.sizes[0], sums: Vec::new() }];
        for level in 1..self.sizes.len() {
            let mut made = self.empty(level);
            let (size, finer) = (made.size, &levels[level - 1]);
            each_texel(self.samplings.for_level(size), &mut made, lobes, |i, samples, sums| {
                if self.job.observer.cancelled() {
                    return;
                }
                let mut likeliest = f64::MIN;
                let mut own = [[0.0; N]; MAX_LOBES];
                let own = &mut own[..lobes];
                let mut random = Pcg64Mcg::seed_from_u64(i as u64);
                for start in 0..ALONE_STARTS {
                    match start {
                        0 => start_from_furthest(samples, samples, own),
                        // The finest level's lobes are the normals themselves, which the first start has
                        // seen.
                        1 if level > 1 => {
                            start_from_furthest(&lobe_means(finer, lobes, size, at(size, i)), samples, own);
                        }
                        _ => start_at_random(samples, &mut random, own),
                    }
                    iterate(self.family, samples, ALONE_ROUNDS, own);
                    let likely = log_likelihood(self.family, samples, own);
                    if likely > likeliest {
                        likeliest = likely;
                        sums.copy_from_slice(own);
                    }
                }
            });
            levels.push(made);
            self.job.observer.check()?;
            self.job.observer.progress(0.05 + 0.85 * level as f64 / self.sizes.len() as f64);
        }
        Ok(levels)
    }

    /// A level started from its parent; the coarsest, which has none, by [`Self::start`].
    fn descend(&self, level: usize, parent: Option<&Level<N>>) -> Level<N> {
        let (family, lobes) = (self.family, self.fit.lobes);
        let mut made = self.empty(level);
        let size = made.size;
        let grid = self.samplings.for_level(size);
        // One lobe has nothing to be aligned with, and its sums are exact means: refinement would only bend
        // it to one roughness.
        let refined = self.fit.alignment == Alignment::Refined && lobes > 1;
        let rounds = match parent {
            None => 0,
            Some(_) if refined && level < FIRST_REFINED_WELL => FINE_ROUNDS,
            Some(_) if refined => ROUNDS_BEFORE,
            Some(_) => PARENT_ROUNDS,
        };
        let prior = self.fit.alignment == Alignment::Prior && parent.is_some();
        let thetas = parent.map(|p| p.thetas(family, lobes, 0..p.size.height));
        each_texel(grid, &mut made, lobes, |i, samples, sums| {
            if self.job.observer.cancelled() {
                return;
            }
            match (parent, &thetas) {
                (Some(parent), Some(thetas)) => {
                    let over = parent.index_over(size, at(size, i));
                    assign(&thetas[over * lobes..][..lobes], samples, sums);
                }
                _ => self.start(samples, sums),
            }
            if !prior {
                iterate(family, samples, rounds, sums);
            }
        });
        if self.job.observer.cancelled() {
            return made;
        }
        if let (true, Some(parent)) = (prior, parent) {
            let (wraps, finest) = (self.job.surface.wraps(), self.sizes[0].area());
            let strength = self.fit.prior;
            let context = PriorContext { grid, parent, lobes, wraps, finest, strength };
            family.fit_with_prior(&context, &mut made);
        }
        if refined && level >= FIRST_REFINED {
            let well = level >= FIRST_REFINED_WELL;
            let rounds = if well { REFINE_ROUNDS_PER_LOBE * lobes } else { FINE_REFINE_ROUNDS };
            family.refine(grid, &mut LevelLobes { size, lobes, sums: &mut made.sums }, rounds);
        }
        made.sums.par_chunks_mut(lobes).for_each(remove_light_lobes);
        made
    }

    /// The start of the coarsest texel, which all others inherit: of several, the one whose lobes are
    /// narrowest.
    ///
    /// This is not the likeliest, nor the one of least error there. The levels below need lobes that divide
    /// the normals well, as in k-means, and this start measured better on both counts. For the same reason EM
    /// stays short.
    fn start(&self, samples: &Samples<N>, sums: &mut [[f32; N]]) {
        start_from_furthest(samples, samples, sums);
        let mut least = f32::MAX;
        let mut best = [[0.0; N]; MAX_LOBES];
        let mut random = Pcg64Mcg::seed_from_u64(0);
        for _ in 0..STARTS {
            iterate(self.family, samples, START_ROUNDS, sums);
            let width = sums.iter().map(|s| s[0] * self.family.width(s)).sum();
            if width < least {
                least = width;
                best[..sums.len()].copy_from_slice(sums);
            }
            start_at_random(samples, &mut random, sums);
        }
        sums.copy_from_slice(&best[..sums.len()]);
    }

    /// Hands on a level with the attributes of its lobes.
    fn hand_on<E>(
        &self,
        level: usize,
        made: &Level<N>,
        emit: &mut dyn FnMut(&FittedRows<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let attributes: Vec<Vec<Rgba>> = self.job.attributes.iter().map(|a| self.carry(made, a)).collect();
        emit(&FittedRows {
            level,
            size: made.size,
            rows: 0..made.size.height,
            statistics: N,
            sums: made.sums.as_flattened(),
            attributes: &attributes,
        })
    }

    /// Each lobe's mean of an attribute, `y_j = Σ z_ij y_i / Σ z_ij`, times its weight (Han et al. 2007,
    /// section 6.4).
    fn carry(&self, made: &Level<N>, attribute: &Grid<Rgba>) -> Vec<Rgba> {
        let (lobes, size, fine) = (self.fit.lobes, made.size, attribute.size());
        let mut carried = vec![[0.0; 4]; made.sums.len()];
        carried.par_chunks_mut(lobes).zip(made.sums.par_chunks(lobes)).enumerate().for_each_init(
            Samples::default,
            |samples, (i, (carried, sums))| {
                let (x, y) = at(size, i);
                self.samplings.finest().gather(size, (x, y), samples);
                let mut theta = [[0.0; N]; MAX_LOBES];
                naturals(self.family, sums, &mut theta[..lobes]);
                let (rows, _) = footprint(fine.height, size.height, y);
                let (columns, _) = footprint(fine.width, size.width, x);
                let places = rows.flat_map(|r| columns.clone().map(move |c| (r, c)));
                let mut weights = [0.0_f32; MAX_LOBES];
                let mut mean = [0.0_f32; 4];
                let mut z = [0.0; MAX_LOBES];
                for (k, (r, c)) in places.enumerate() {
                    shares(&theta[..lobes], &samples.statistics(k), &mut z[..lobes]);
                    let (value, weight) = (attribute.row(r)[c], samples.weights()[k]);
                    (0..4).for_each(|k| mean[k] += weight * value[k]);
                    for (j, carried) in carried.iter_mut().enumerate() {
                        let z = z[j] * weight;
                        weights[j] += z;
                        (0..4).for_each(|k| carried[k] += z * value[k]);
                    }
                }
                for ((carried, sums), weight) in carried.iter_mut().zip(sums).zip(weights) {
                    // A lobe that refinement moved away from all normals has none to ask: it carries the
                    // texel's mean.
                    let own =
                        if weight > LEAST_WEIGHT * LEAST_WEIGHT { carried.map(|c| c / weight) } else { mean };
                    *carried = own.map(|y| sums[0] * y);
                }
            },
        );
        carried
    }

    /// The finest level, band by band: each normal is one lobe, in the place that its parent gives it.
    fn finest<E: From<Cancelled>>(
        &self,
        parent: Option<&Level<N>>,
        emit: &mut dyn FnMut(&FittedRows<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let (lobes, size) = (self.fit.lobes, self.sizes[0]);
        // One set of buffers for all bands: a band is megabytes that would come and go.
        let mut sums: Vec<[f32; N]> = Vec::new();
        let mut attributes: Vec<Vec<Rgba>> = vec![Vec::new(); self.job.attributes.len()];
        let mut places = Vec::new();
        for start in (0..size.height).step_by(BAND) {
            self.job.observer.check()?;
            let rows = start..(start + BAND).min(size.height);
            let texels = rows.len() * size.width;
            places.resize(texels, 0_usize);
            sums.clear();
            sums.resize(texels * lobes, [0.0; N]);
            for buffer in &mut attributes {
                buffer.clear();
                buffer.resize(texels * lobes, [0.0; 4]);
            }
            // The parents' rows that this band asks, their thetas worked out once.
            let above = parent.map(|p| {
                let first = over(rows.start, size.height, p.size.height);
                let last = over(rows.end - 1, size.height, p.size.height);
                (p, first, p.thetas(self.family, lobes, first..last + 1))
            });
            let lines = sums.par_chunks_mut(size.width * lobes).zip(places.par_chunks_mut(size.width));
            lines.enumerate().for_each_init(
                || SurfaceRow::flat(size.width),
                |row, (r, (sums, places))| {
                    let y = start + r;
                    self.job.surface.read_row(y, row);
                    for x in 0..size.width {
                        let t = self.family.statistics(row.normal(x));
                        places[x] = above.as_ref().map_or(0, |(p, first, thetas)| {
                            let at = p.index_over(size, (x, y)) - first * p.size.width;
                            likeliest(&thetas[at * lobes..][..lobes], &t)
                        });
                        sums[x * lobes + places[x]] = t;
                    }
                },
            );
            for (carried, attribute) in attributes.iter_mut().zip(self.job.attributes) {
                for (i, place) in places.iter().enumerate() {
                    carried[i * lobes + place] = attribute.row(start + i / size.width)[i % size.width];
                }
            }
            emit(&FittedRows {
                level: 0,
                size,
                rows: rows.clone(),
                statistics: N,
                sums: sums.as_flattened(),
                attributes: &attributes,
            })?;
            self.job.observer.progress(0.9 + 0.1 * rows.end as f64 / size.height as f64);
        }
        Ok(())
    }
}

/// Runs `texel` on the samples and sums of every texel of a level.
fn each_texel<const N: usize>(
    grid: &SampleGrid<N>,
    level: &mut Level<N>,
    lobes: usize,
    texel: impl Fn(usize, &Samples<N>, &mut [[f32; N]]) + Sync,
) {
    let size = level.size;
    let texels = level.sums.par_chunks_mut(lobes).enumerate();
    texels.for_each_init(Samples::default, |samples, (i, sums)| {
        grid.gather(size, at(size, i), samples);
        texel(i, samples, sums);
    });
}

/// The lobe that a sample most likely belongs to.
fn likeliest<const N: usize>(thetas: &[[f32; N]], t: &[f32; N]) -> usize {
    let mut best = (0, f32::MIN);
    for (j, theta) in thetas.iter().enumerate() {
        let log = log_density(theta, t);
        if log > best.1 {
            best = (j, log);
        }
    }
    best.0
}

/// Column and row of texel `i`.
fn at(size: Size, i: usize) -> (usize, usize) {
    (i % size.width, i / size.width)
}

/// Removes lobes too light to store; the others take over their normals, by weight, so that the mean of all
/// stays.
fn remove_light_lobes<const N: usize>(sums: &mut [[f32; N]]) {
    let light = |s: &[f32; N]| s[0] < LEAST_WEIGHT;
    let kept: f32 = sums.iter().filter(|s| !light(s)).map(|s| s[0]).sum();
    let mut left = [0.0; N];
    for sums in sums.iter_mut().filter(|s| light(s)) {
        (0..N).for_each(|k| left[k] += sums[k]);
        *sums = [0.0; N];
    }
    for sums in sums.iter_mut() {
        let share = sums[0] / kept;
        (0..N).for_each(|k| sums[k] += share * left[k]);
    }
}

/// Means of all lobes of the finer texels under a texel.
fn lobe_means<const N: usize>(
    finer: &Level<N>,
    lobes: usize,
    size: Size,
    (x, y): (usize, usize),
) -> Samples<N> {
    let mut means = Samples::default();
    let (columns, _) = footprint(finer.size.width, size.width, x);
    let (rows, _) = footprint(finer.size.height, size.height, y);
    for r in rows {
        let line = &finer.sums[(r * finer.size.width + columns.start) * lobes..][..columns.len() * lobes];
        for sums in line.iter().filter(|s| s[0] > LEAST_WEIGHT) {
            means.push(sums[0], sums.map(|s| s / sums[0]));
        }
    }
    means
}
