//! Rules: closed formulas by which engines and their tools widen roughness. All measure how short the mean
//! normal is, and most take `kappa = (3L - L³)/(1 - L²)` from its length L (Banerjee et al. 2005). They
//! differ in the constant, and in what it is added to.

use glam::Vec3;

use super::RoughSurface;
use super::mips::filled;
use crate::grid::Grid;
use crate::lookup::area_mean;
use crate::surface::unit_or_up;

/// Evidence that a rule goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Length of the mean normal, 0 to 1.
    pub length: f64,
    /// Perceptual roughness before it is widened.
    pub roughness: f64,
}

impl Spread {
    /// `1/kappa`: 0 where all normals are one.
    fn inverse_kappa(self) -> f64 {
        let length = self.length.clamp(0.0, 1.0);
        let top = 3.0 * length - length.powi(3);
        if top > 0.0 { (1.0 - length * length) / top } else { f64::INFINITY }
    }
}

/// Level whose means a rule reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// Normals and roughness of the finest level.
    Finest,
    /// The level above, whose normals are made unit again and whose roughness is widened already.
    LevelAbove,
}

/// A row of [`TABLE`].
#[derive(Debug)]
pub struct Row {
    /// Name on the command line.
    pub name: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Level that it reads.
    pub reads: Reads,
    /// Perceptual roughness; it is clamped to 0 to 1 afterwards.
    pub rule: fn(Spread) -> f64,
}

/// Rule of plain mips, which every engine makes unless told otherwise.
pub const PLAIN: Row = Row {
    name: "plain",
    summary: "the mean of the roughness, as mips are made anywhere",
    reads: Reads::Finest,
    rule: |s| s.roughness,
};

/// Every rule.
pub static TABLE: &[Row] = &[
    PLAIN,
    Row {
        name: "kappa",
        summary: "alpha² + 2/kappa, by theory right for a Gaussian bump (Karis 2018; Pettineo's sample)",
        reads: Reads::Finest,
        rule: |s| (s.roughness.powi(4) + 2.0 * s.inverse_kappa()).powf(0.25),
    },
    Row {
        name: "unreal",
        summary: "Unreal Engine's composite texture, of power 1",
        reads: Reads::Finest,
        rule: |s| {
            let length = s.length.clamp(1e-6, 1.0);
            let variance = ((1.0 - length) / length - 4e-5).max(0.0);
            let alpha_squared = s.roughness.powi(4);
            let b = 2.0 * variance * (alpha_squared - 1.0);
            ((b - alpha_squared) / (b - 1.0)).max(0.0).powf(0.25)
        },
    },
    Row {
        name: "filament",
        summary: "Filament's roughness-prefilter: 2/kappa added to the square of perceptual roughness",
        reads: Reads::Finest,
        rule: |s| (s.roughness.powi(2) + 2.0 * s.inverse_kappa()).sqrt(),
    },
    Row {
        name: "unity",
        summary: "Unity HDRP's texture normal filtering: alpha² + 1/(2 kappa), at most 1/16 added",
        reads: Reads::Finest,
        rule: |s| (s.roughness.powi(4) + (0.5 * s.inverse_kappa()).min(0.0625)).powf(0.25),
    },
    Row {
        name: "godot",
        summary: "Godot's import with a normal map: 3/(4 kappa), at most 0.16, added to perceptual roughness²",
        reads: Reads::Finest,
        rule: |s| (s.roughness.powi(2) + (0.75 * s.inverse_kappa()).min(0.16)).sqrt(),
    },
    Row {
        name: "three",
        summary: "three.js's former RoughnessMipmapper: level by level, 1 - L added to a variance by table",
        reads: Reads::LevelAbove,
        rule: |s| three::roughness(three::variance(s.roughness) + 1.0 - s.length),
    },
];

/// The row of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Row> {
    TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name))
}

/// Roughness of every level by a rule.
pub(super) fn bake(row: &Row, surface: &RoughSurface) -> Vec<Grid<f32>> {
    let widened = |[x, y, z, roughness]: [f32; 4]| {
        let length = f64::from(Vec3::new(x, y, z).length());
        (row.rule)(Spread { length, roughness: f64::from(roughness) }).clamp(0.0, 1.0) as f32
    };
    let mut levels = vec![filled(surface.size(), |x, y| surface.mean(0, x, y).roughness)];
    for (level, size) in surface.sizes().enumerate().skip(1) {
        levels.push(match row.reads {
            Reads::Finest => filled(size, |x, y| widened(surface.levels[level].row(y)[x])),
            Reads::LevelAbove => {
                let roughness = &levels[level - 1];
                let above = filled(roughness.size(), |x, y| {
                    let normal = unit_or_up(surface.mean(level - 1, x, y).normal);
                    normal.extend(roughness.row(y)[x]).to_array()
                });
                filled(size, |x, y| widened(area_mean(&above, size, x, y)))
            }
        });
    }
    levels
}

/// Variance of three.js's blurred cubes, and back: the constants of its former mipmapper.
mod three {
    /// Knots: perceptual roughness and variance, falling.
    const KNOTS: [(f64, f64); 4] = [(1.0, 0.339), (0.8, 0.276), (0.4, 0.046), (0.305, 0.016)];

    pub(super) fn variance(roughness: f64) -> f64 {
        for pair in KNOTS.windows(2) {
            let [(r0, v0), (r1, v1)] = [pair[0], pair[1]];
            if roughness >= r1 {
                return v0 + (roughness - r0) * (v1 - v0) / (r1 - r0);
            }
        }
        1.79 * roughness.powi(4)
    }

    pub(super) fn roughness(variance: f64) -> f64 {
        for pair in KNOTS.windows(2) {
            let [(r0, v0), (r1, v1)] = [pair[0], pair[1]];
            if variance >= v1 {
                return r0 + (variance - v0) * (r1 - r0) / (v1 - v0);
            }
        }
        (0.559 * variance).powf(0.25)
    }
}
