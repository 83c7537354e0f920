//! Roughness mips for engines that take one lobe: fitted, or by an engine's own formula, and measured.
//!
//! ```no_run
//! use ndfmap::core::grid::Grid;
//! use ndfmap::core::observe::Unobserved;
//! use ndfmap::core::roughness::{EngineMaterial, RoughSurface};
//! use ndfmap::maps::source::{SourceOptions, read_source};
//! use ndfmap::roughness::RoughnessJob;
//!
//! let map = read_source("bricks_normal.png".as_ref(), &SourceOptions::default())?;
//! let surface = RoughSurface::new(&*map.surface, &Grid::from_fn(map.surface.size(), |_, _| 0.4))?;
//! let job = RoughnessJob { surface: &surface, material: EngineMaterial::METAL, by: None };
//! let mips = job.run(&Unobserved)?;
//! println!("{} levels", mips.levels.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod judge;

use std::fmt;
use std::str::FromStr;

use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::roughness::{
    EngineMaterial, Objective, PLAIN, RoughSurface, Row, TABLE, Widening, enlarged, find, mips,
};
use ndfmap_core::surface::Wraps;
use serde::{Serialize, Serializer};

pub use judge::{Errors, Judge, LevelErrors, PICTURES, View};

/// Fits that are tried. A power of 1/4 serves FLIP, and 1 relative L2; where a whole one
/// raises a haze that FLIP punishes, a part of it may still help.
pub const FITS: [Fit; 8] = [
    Fit { objective: Objective { power: 0.125 }, share: 0.5 },
    Fit { objective: Objective { power: 0.125 }, share: 1.0 },
    Fit { objective: Objective { power: 0.25 }, share: 0.25 },
    Fit { objective: Objective { power: 0.25 }, share: 0.5 },
    Fit { objective: Objective { power: 0.25 }, share: 0.75 },
    Fit { objective: Objective { power: 0.25 }, share: 1.0 },
    Fit { objective: Objective { power: 0.5 }, share: 1.0 },
    Fit { objective: Objective { power: 1.0 }, share: 1.0 },
];

/// Importance of roughness to those who compress it, beside 1 for other channels of its texture: it rules
/// highlights, and is what is measured.
pub const ROUGHNESS_IMPORTANCE: f32 = 16.0;

/// Fit of which a share is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Measure of the fit.
    pub objective: Objective,
    /// Part of the way from plain mips to the fit, 0 to 1, in `alpha²`.
    pub share: f32,
}

/// Roughness mips to be made.
#[derive(Clone, Copy, Debug)]
pub struct RoughnessJob<'a> {
    /// Normals and roughness of the finest level.
    pub surface: &'a RoughSurface,
    /// Material that the mips are judged by.
    pub material: EngineMaterial,
    /// Fit or formula by which they are made, whatever it does. Without one, each level takes whichever of
    /// [`FITS`], engines' formulas and plain mips is measured to be best; never one that is worse than plain
    /// mips by either measure.
    pub by: Option<Origin>,
}

/// Source of a level's roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// A fit.
    Fit(Fit),
    /// A formula, by its name; `plain` where nothing that was tried is better.
    Rule(&'static str),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fit(Fit { objective: Objective { power }, share: 1.0 }) => write!(f, "fit:{power}"),
            Self::Fit(Fit { objective: Objective { power }, share }) => write!(f, "fit:{power}:{share}"),
            Self::Rule(name) => f.write_str(name),
        }
    }
}

/// Error of a name that is neither a fit nor a formula.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no fit and no formula has this name: there are fit:POWER, fit:POWER:SHARE, {0}")]
pub struct ParseOriginError(String);

impl FromStr for Origin {
    type Err = ParseOriginError;

    /// Reads what [`Display`](fmt::Display) writes: a power above 0 and up to 4, and a share from 0 to 1.
    fn from_str(text: &str) -> Result<Self, ParseOriginError> {
        let fit = |text: &str| {
            let (power, share) = text.split_once(':').unwrap_or((text, "1"));
            let (power, share): (f32, f32) = (power.parse().ok()?, share.parse().ok()?);
            let is_sound = power > 0.0 && power <= 4.0 && (0.0..=1.0).contains(&share);
            is_sound.then_some(Self::Fit(Fit { objective: Objective { power }, share }))
        };
        let named = match text.strip_prefix("fit:") {
            Some(numbers) => fit(numbers),
            None => find(text).map(|row| Self::Rule(row.name)),
        };
        named.ok_or_else(|| {
            let names: Vec<&str> = TABLE.iter().map(|row| row.name).collect();
            ParseOriginError(names.join(", "))
        })
    }
}

impl Origin {
    /// Perceptual roughness of every level of a surface, finest first.
    ///
    /// # Errors
    /// [`Cancelled`] when the observer wants it to end.
    pub fn levels(
        self,
        surface: &RoughSurface,
        observer: &dyn Observer,
    ) -> Result<Vec<Grid<f32>>, Cancelled> {
        match self {
            Self::Rule(name) => surface.bake(Widening::Rule(find(name).unwrap_or(&PLAIN)), observer),
            Self::Fit(Fit { objective, share }) => {
                let plain = surface.bake(Widening::Rule(&PLAIN), observer)?;
                Ok(partly(&plain, &surface.bake(Widening::Fit(objective), observer)?, share))
            }
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
    /// Fit or formula that was tried.
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
    /// Everything that was tried, on all levels alike.
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
        observer.begin("roughness");
        let judge = Judge::new(self.surface, self.material, &observer.part(0.0, 0.4))?;
        self.make(&judge, &observer.part(0.4, 1.0))
    }

    /// Makes the mips, measured by a judge of the same surface and material.
    pub(crate) fn make(
        &self,
        judge: &Judge<'_>,
        observer: &dyn Observer,
    ) -> Result<RoughnessMips, Cancelled> {
        let surface = self.surface;
        let by =
            |row: &'static Row| Ok((Origin::Rule(row.name), surface.bake(Widening::Rule(row), observer)?));
        let mut made = vec![by(&PLAIN)?];
        match self.by {
            Some(origin) => made.push((origin, origin.levels(surface, &observer.part(0.0, 0.5))?)),
            None => {
                // Several shares of a fit need it once.
                let mut whole: Option<(Objective, Vec<Grid<f32>>)> = None;
                for (i, fit) in FITS.into_iter().enumerate() {
                    let (from, to) = (i as f64 / FITS.len() as f64, (i + 1) as f64 / FITS.len() as f64);
                    let levels = match whole.take().filter(|(objective, _)| *objective == fit.objective) {
                        Some((_, levels)) => levels,
                        None => surface
                            .bake(Widening::Fit(fit.objective), &observer.part(0.5 * from, 0.5 * to))?,
                    };
                    made.push((Origin::Fit(fit), partly(&made[0].1, &levels, fit.share)));
                    whole = Some((fit.objective, levels));
                }
                for row in TABLE.iter().filter(|row| row.name != PLAIN.name) {
                    made.push(by(row)?);
                }
            }
        }
        let all: Vec<&[Grid<f32>]> = made.iter().map(|(_, levels)| &levels[..]).collect();
        let judged = judge.errors(&all, &observer.part(0.5, 1.0))?;
        let mut levels = vec![made[0].1[0].clone()];
        let mut report = Vec::new();
        for LevelErrors { level, candidates: errors } in &judged {
            let chosen = if self.by.is_some() { 1 } else { best(errors) };
            let (by, mips) = &made[chosen];
            levels.push(mips[*level].clone());
            report.push(LevelReport {
                level: *level,
                by: *by,
                stock_roughness: mean_of(&made[0].1[*level]),
                made_roughness: mean_of(&mips[*level]),
                stock: mean(&errors[0]),
                made: mean(&errors[chosen]),
            });
        }
        let tried = |(i, (by, _)): (usize, &(Origin, Vec<Grid<f32>>))| Tried {
            by: *by,
            of_stock: mean_ratios(
                judged.iter().map(|level| (mean(&level.candidates[i]), mean(&level.candidates[0]))),
            ),
        };
        let report = RoughnessReport {
            of_stock: mean_ratios(report.iter().map(|level| (level.made, level.stock))),
            tried: made.iter().enumerate().skip(1).map(tried).collect(),
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
            // A value that does not change keeps its bits.
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
pub(crate) fn ratios((made, stock): (Errors, Errors)) -> Errors {
    let ratio = |made: f64, stock: f64| (made + UNSEEN) / (stock + UNSEEN);
    Errors { relative_l2: ratio(made.relative_l2, stock.relative_l2), flip: ratio(made.flip, stock.flip) }
}

/// Mean over lights.
pub(crate) fn mean(errors: &[Errors]) -> Errors {
    let mean = |pick: fn(&Errors) -> f64| errors.iter().map(pick).sum::<f64>() / errors.len() as f64;
    Errors { relative_l2: mean(|e| e.relative_l2), flip: mean(|e| e.flip) }
}

/// Greatest ratio to stock that is let pass in a single light, where the means gain.
const PASSING: f64 = 1.1;

/// Index of the candidate with the least sum of ratios to the first: none of its means is worse, and in no
/// light by more than what is let pass.
fn best(errors: &[[Errors; PICTURES]]) -> usize {
    let mut best = (2.0, 0);
    for (i, candidate) in errors.iter().enumerate().skip(1) {
        let Errors { relative_l2, flip } = ratios((mean(candidate), mean(&errors[0])));
        let passes = |(made, stock): (&Errors, &Errors)| {
            let Errors { relative_l2, flip } = ratios((*made, *stock));
            relative_l2 <= PASSING && flip <= PASSING
        };
        let is_safe = relative_l2 <= 1.0 && flip <= 1.0 && candidate.iter().zip(&errors[0]).all(passes);
        if is_safe && relative_l2 + flip < best.0 {
            best = (relative_l2 + flip, i);
        }
    }
    best.1
}

/// Means of both ratios.
pub(crate) fn mean_ratios(pairs: impl Iterator<Item = (Errors, Errors)>) -> Errors {
    let all: Vec<Errors> = pairs.map(ratios).collect();
    let mean = |pick: fn(&Errors) -> f64| all.iter().map(pick).sum::<f64>() / all.len().max(1) as f64;
    Errors { relative_l2: mean(|e| e.relative_l2), flip: mean(|e| e.flip) }
}

/// Channels of a picture as plain mips, from a size that is at least the picture's own; it is enlarged where
/// it is smaller, and repeats.
#[must_use]
pub fn channel_mips(values: Grid<[f32; 4]>, size: Size) -> Vec<Grid<[f32; 4]>> {
    mips(if values.size() == size { values } else { enlarged(&values, size, Wraps::default()) })
}
