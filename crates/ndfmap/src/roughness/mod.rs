//! Roughness mips for engines that take one lobe: fitted, or by an engine's own formula, and measured.
//!
//! ```no_run
//! use ndfmap::core::grid::Grid;
//! use ndfmap::core::observe::Unobserved;
//! use ndfmap::core::roughness::{EngineMaterial, RoughSurface};
//! use ndfmap::maps::source::{SourceOptions, read_source};
//! use ndfmap::roughness::{Method, RoughnessJob};
//!
//! let map = read_source("bricks_normal.png".as_ref(), &SourceOptions::default())?;
//! let surface = RoughSurface::new(&*map.surface, &Grid::from_fn(map.surface.size(), |_, _| 0.4))?;
//! let job = RoughnessJob { surface: &surface, material: EngineMaterial::METAL, method: Method::Measured };
//! let mips = job.run(&Unobserved)?;
//! println!("{} levels", mips.levels.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod judge;

use std::fmt;

use glam::Vec4;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::pyramid::level_sizes;
use ndfmap_core::roughness::{
    EngineMaterial, Objective, RoughSurface, Row, TABLE, Widening, enlarged, find, mean_under,
};
use ndfmap_core::surface::Wrap;
use ndfmap_maps::Image;
use serde::{Serialize, Serializer};

pub use judge::{Errors, LevelErrors, judge};

/// Fits that [`Method::Measured`] tries. A power of 1/4 serves FLIP, and 1 relative L2; where a whole one
/// raises a haze that FLIP punishes, a part of it may still help.
pub const FITS: [Fit; 5] = [
    Fit { objective: Objective { power: 0.25 }, share: 0.25 },
    Fit { objective: Objective { power: 0.25 }, share: 0.5 },
    Fit { objective: Objective { power: 0.25 }, share: 1.0 },
    Fit { objective: Objective { power: 0.5 }, share: 1.0 },
    Fit { objective: Objective { power: 1.0 }, share: 1.0 },
];

/// Name of the rule that mips are compared with: that of every engine.
const STOCK: &str = "plain";

/// Fit of which a share is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Measure of the fit.
    pub objective: Objective,
    /// Part of the way from plain mips to the fit, 0 to 1, in `alpha²`.
    pub share: f32,
}

/// Method by which roughness mips are made.
#[derive(Clone, Copy, Debug)]
pub enum Method {
    /// For each level, whichever of [`FITS`], engines' formulas and plain mips is measured to be best; never
    /// one that is worse than plain mips by either measure.
    Measured,
    /// One fit, whatever it does.
    Fit(Fit),
    /// The formula of an engine, whatever it does.
    Rule(&'static Row),
}

/// Roughness mips to be made.
#[derive(Clone, Copy, Debug)]
pub struct RoughnessJob<'a> {
    /// Normals and roughness of the finest level.
    pub surface: &'a RoughSurface,
    /// Material that the mips are judged by.
    pub material: EngineMaterial,
    /// Method by which they are made.
    pub method: Method,
}

/// Source of a level's roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// Plain mips: nothing that was tried is better.
    Plain,
    /// A fit.
    Fit(Fit),
    /// The formula of an engine.
    Rule(&'static str),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plain => f.write_str(STOCK),
            Self::Fit(Fit { objective: Objective { power }, share: 1.0 }) => write!(f, "fit:{power}"),
            Self::Fit(Fit { objective: Objective { power }, share }) => write!(f, "fit:{power}:{share}"),
            Self::Rule(name) => f.write_str(name),
        }
    }
}

impl Serialize for Origin {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Errors of a level, as stock mips have it and as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelReport {
    /// Level, 1 the first that is filtered.
    pub level: usize,
    /// Source of its roughness.
    pub by: Origin,
    /// Mean roughness of plain mips.
    pub stock_roughness: f64,
    /// Mean roughness of these mips.
    pub made_roughness: f64,
    /// Errors of plain mips.
    pub stock: Errors,
    /// Errors of these mips.
    pub made: Errors,
}

/// Errors of something that was tried, over those of stock mips: means over levels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// What was tried.
    pub by: Origin,
    /// Errors over those of stock mips.
    pub of_stock: Errors,
}

/// Gain of roughness mips.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RoughnessReport {
    /// Every level but the finest.
    pub levels: Vec<LevelReport>,
    /// Errors of the mips over those of stock mips: means over levels.
    pub of_stock: Errors,
    /// The same of everything that was tried, on all levels alike.
    pub tried: Vec<Tried>,
}

/// Roughness mips, and what they gain.
#[derive(Clone, Debug)]
pub struct RoughnessMips {
    /// Perceptual roughness of every level, finest first.
    pub levels: Vec<Grid<f32>>,
    /// Measurement of them.
    pub report: RoughnessReport,
}

impl RoughnessJob<'_> {
    /// Makes the mips and measures them.
    ///
    /// # Errors
    /// [`Cancelled`] when the observer wants it to end.
    pub fn run(&self, observer: &dyn Observer) -> Result<RoughnessMips, Cancelled> {
        let rule =
            |name: &str| Widening::Rule(find(name).unwrap_or_else(|| unreachable!("a row of the table")));
        let mut origins = vec![Origin::Plain];
        match self.method {
            Method::Measured => {
                origins.extend(FITS.map(Origin::Fit));
                origins
                    .extend(TABLE.iter().filter(|row| row.name != STOCK).map(|row| Origin::Rule(row.name)));
            }
            Method::Fit(fit) => origins.push(Origin::Fit(fit)),
            Method::Rule(row) => origins.push(Origin::Rule(row.name)),
        }
        observer.begin("roughness");
        let mut made = vec![self.surface.bake(rule(STOCK), &observer.part(0.0, 0.0))?];
        // Several shares of a fit need it once.
        let mut fitted: Option<(Objective, Vec<Grid<f32>>)> = None;
        for (i, origin) in origins.iter().enumerate().skip(1) {
            let last = (origins.len() - 1) as f64;
            let part = observer.part(0.5 * (i - 1) as f64 / last, 0.5 * i as f64 / last);
            let levels = match origin {
                Origin::Fit(Fit { objective, share }) => {
                    let whole = match fitted.take().filter(|(made, _)| made == objective) {
                        Some((_, levels)) => levels,
                        None => self.surface.bake(Widening::Fit(*objective), &part)?,
                    };
                    let levels = partly(&made[0], &whole, *share);
                    fitted = Some((*objective, whole));
                    levels
                }
                Origin::Rule(name) => self.surface.bake(rule(name), &part)?,
                Origin::Plain => continue,
            };
            made.push(levels);
        }
        let all: Vec<&[Grid<f32>]> = made.iter().map(|levels| &levels[..]).collect();
        let judged = judge(self.surface, self.material, &all, &observer.part(0.5, 1.0))?;
        let mut levels = vec![made[0][0].clone()];
        let mut report = Vec::new();
        for LevelErrors { level, candidates: errors } in &judged {
            let (level, chosen) =
                (*level, if matches!(self.method, Method::Measured) { best(errors) } else { 1 });
            levels.push(made[chosen][level].clone());
            report.push(LevelReport {
                level,
                by: origins[chosen],
                stock_roughness: mean_of(&made[0][level]),
                made_roughness: mean_of(&made[chosen][level]),
                stock: errors[0],
                made: errors[chosen],
            });
        }
        let tried = |(i, by): (usize, &Origin)| Tried {
            by: *by,
            of_stock: mean_ratios(judged.iter().map(|level| (level.candidates[i], level.candidates[0]))),
        };
        let report = RoughnessReport {
            of_stock: mean_ratios(report.iter().map(|level| (level.made, level.stock))),
            tried: origins.iter().enumerate().skip(1).map(tried).collect(),
            levels: report,
        };
        Ok(RoughnessMips { levels, report })
    }
}

/// Levels a part of the way between two sets, in `alpha²`.
fn partly(from: &[Grid<f32>], to: &[Grid<f32>], share: f32) -> Vec<Grid<f32>> {
    let mixed = |(from, to): (&Grid<f32>, &Grid<f32>)| {
        Grid::from_fn(from.size(), |x, y| {
            let (from, to) = (from.row(y)[x], to.row(y)[x]);
            // What does not change keeps its bits.
            if share == 1.0 || from == to {
                return to;
            }
            (from.powi(4) + share * (to.powi(4) - from.powi(4))).powf(0.25)
        })
    };
    from.iter().zip(to).map(mixed).collect()
}

fn mean_of(level: &Grid<f32>) -> f64 {
    level.texels().iter().map(|r| f64::from(*r)).sum::<f64>() / level.texels().len() as f64
}

/// Error that nobody sees, of either measure; it is added to both sides of a ratio, lest nothing be divided
/// by nothing where a level is flat.
const UNSEEN: f64 = 1e-3;

/// Errors over those of stock.
fn ratios((made, stock): (Errors, Errors)) -> Errors {
    let ratio = |made: f64, stock: f64| (made + UNSEEN) / (stock + UNSEEN);
    Errors { relative_l2: ratio(made.relative_l2, stock.relative_l2), flip: ratio(made.flip, stock.flip) }
}

/// Index of the candidate with the least sum of ratios to the first, none of its ratios above one.
fn best(errors: &[Errors]) -> usize {
    let mut best = (2.0, 0);
    for (i, candidate) in errors.iter().enumerate().skip(1) {
        let Errors { relative_l2, flip } = ratios((*candidate, errors[0]));
        if relative_l2 <= 1.0 && flip <= 1.0 && relative_l2 + flip < best.0 {
            best = (relative_l2 + flip, i);
        }
    }
    best.1
}

/// Means of both ratios.
fn mean_ratios(pairs: impl Iterator<Item = (Errors, Errors)>) -> Errors {
    let all: Vec<Errors> = pairs.map(ratios).collect();
    let mean = |pick: fn(&Errors) -> f64| all.iter().map(pick).sum::<f64>() / all.len().max(1) as f64;
    Errors { relative_l2: mean(|e| e.relative_l2), flip: mean(|e| e.flip) }
}

/// Channels of a picture (missing ones 0, alpha 1) as plain mips, from a size that is at least the picture's
/// own; it is enlarged where it is smaller, and repeats.
#[must_use]
pub fn channel_mips(image: &Image, size: Size) -> Vec<Grid<[f32; 4]>> {
    let own = image.size;
    let at = |x: isize, y: isize| {
        let texel = Wrap::Repeat.index(y, own.height) * own.width + Wrap::Repeat.index(x, own.width);
        let mut value = [0.0, 0.0, 0.0, 1.0];
        for (c, value) in value.iter_mut().enumerate().take(image.channels) {
            *value = image.samples.get(texel * image.channels + c);
        }
        Vec4::from_array(value)
    };
    let mut levels = vec![if own == size {
        Grid::from_fn(size, |x, y| at(x as isize, y as isize))
    } else {
        enlarged(own, size, at)
    }];
    for size in level_sizes(size).into_iter().skip(1) {
        let above = &levels[levels.len() - 1];
        let next = Grid::from_fn(size, |x, y| mean_under(above, size, (x, y)));
        levels.push(next);
    }
    let plain = |level: Grid<Vec4>| Grid::from_fn(level.size(), |x, y| level.row(y)[x].to_array());
    levels.into_iter().map(plain).collect()
}
