//! Roughness mips: for each texel of each level the roughness of one GGX lobe, which an engine's own material
//! shades in place of all the normals under it.
//!
//! An engine averages a normal map and a roughness map apart, level by level. What the normals lose in
//! spread, the roughness has to gain, or a surface dulls or sparkles with distance. This is the one-lobe form
//! of a normal distribution map, for renderers that take no other: `fit.rs` chooses the lobe by what a viewer
//! sees, `rules.rs` has the closed formulas that engines ship.

mod engine;
mod fit;
mod mips;
mod profile;
mod rules;

use glam::Vec3;

use crate::grid::{Grid, Size};
use crate::observe::{Cancelled, Observer};
use crate::pyramid::{footprint, level_sizes};
use crate::surface::{Surface, SurfaceRow, unit_or_up};

pub use engine::{EngineMaterial, LEAST_ROUGHNESS};
pub use fit::Objective;
pub use mips::{enlarged, mean_under};
pub use rules::{Reads, Row, Spread, TABLE, find};

/// Normals and roughness of the finest level, as large as one another.
#[derive(Clone, Debug)]
pub struct RoughSurface {
    size: Size,
    normals: Vec<Vec3>,
    roughness: Vec<f32>,
}

/// Error of a roughness that is no number from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("roughness must be between 0 and 1, not {0}")]
pub struct RoughnessError(pub f32);

/// Method by which roughness is worked out.
#[derive(Clone, Copy, Debug)]
pub enum Widening {
    /// One lobe fitted to each texel.
    Fit(Objective),
    /// A closed formula that an engine ships.
    Rule(&'static Row),
}

impl RoughSurface {
    /// A surface whose perceptual roughness (glTF's; its square is the width alpha of GGX) is a map. Where
    /// the two differ in size, the smaller is enlarged, bilinearly, and by the surface's own wraps.
    ///
    /// # Errors
    /// [`RoughnessError`] for a roughness that is no number from 0 to 1.
    pub fn new(surface: &dyn Surface, roughness: &Grid<f32>) -> Result<Self, RoughnessError> {
        if let Some(bad) = roughness.texels().iter().find(|r| !(0.0..=1.0).contains(*r)) {
            return Err(RoughnessError(*bad));
        }
        let own = surface.size();
        let mut rows = Vec::with_capacity(own.area());
        let mut row = SurfaceRow::flat(own.width);
        for y in 0..own.height {
            surface.read_row(y, &mut row);
            rows.extend((0..own.width).map(|i| row.normal(i)));
        }
        let other = roughness.size();
        let size = Size { width: own.width.max(other.width), height: own.height.max(other.height) };
        let wraps = surface.wraps();
        let normals = if own == size {
            rows
        } else {
            let at = |x, y| rows[wraps.y.index(y, own.height) * own.width + wraps.x.index(x, own.width)];
            enlarged(own, size, at).texels().iter().map(|n| unit_or_up(*n)).collect()
        };
        let roughness = if other == size {
            roughness.texels().to_vec()
        } else {
            let at = |x, y| roughness.row(wraps.y.index(y, other.height))[wraps.x.index(x, other.width)];
            enlarged(other, size, at).texels().to_vec()
        };
        Ok(Self { size, normals, roughness })
    }

    /// Width and height in texels.
    #[must_use]
    pub fn size(&self) -> Size {
        self.size
    }

    /// Stride at which all texels of a level together read so many samples; where the level is large, each
    /// reads eight on a side.
    #[must_use]
    pub fn stride(&self, level: Size, samples: usize) -> usize {
        let across = (self.size.width / level.width).max(self.size.height / level.height);
        let side = ((samples / level.area()) as f64).sqrt() as usize;
        across.div_ceil(side.max(8))
    }

    /// Normal and roughness of every `stride`th texel under a texel of a level, and its weight; weights sum
    /// to one.
    pub fn under(
        &self,
        level: Size,
        (x, y): (usize, usize),
        stride: usize,
        mut each: impl FnMut(f32, Vec3, f32),
    ) {
        let (columns, column_weight) = footprint(self.size.width, level.width, x);
        let (rows, row_weight) = footprint(self.size.height, level.height, y);
        // Strides begin in the middle of their cells, so that no side of the texel is preferred.
        let picks = |range: std::ops::Range<usize>| {
            let first = range.start + (stride - 1).min(range.len() - 1) / 2;
            (first..range.end).step_by(stride)
        };
        let mut total = 0.0;
        for j in picks(rows.clone()) {
            for i in picks(columns.clone()) {
                total += column_weight(i) * row_weight(j);
            }
        }
        for j in picks(rows) {
            for i in picks(columns.clone()) {
                let at = j * self.size.width + i;
                let weight = (column_weight(i) * row_weight(j) / total) as f32;
                each(weight, self.normals[at], self.roughness[at]);
            }
        }
    }

    /// Means of every level: of normals, not normalised, and of roughness, as an engine's own mips are.
    #[must_use]
    pub fn means(&self) -> Vec<Grid<Mean>> {
        let finest = self.normals.iter().zip(&self.roughness);
        let finest = finest.map(|(n, r)| Mean { normal: *n, roughness: *r }).collect();
        let mut levels = vec![
            Grid::from_vec(self.size, finest).unwrap_or_else(|| unreachable!("as many as the size says")),
        ];
        for size in level_sizes(self.size).into_iter().skip(1) {
            let above = &levels[levels.len() - 1];
            let texel = |x: usize, y: usize| mean_under(above, size, (x, y));
            levels.push(Grid::from_fn(size, texel));
        }
        levels
    }

    /// Roughness of every level, finest first; the finest is the surface's own.
    ///
    /// # Errors
    /// [`Cancelled`] when the observer wants it to end.
    pub fn bake(&self, widening: Widening, observer: &dyn Observer) -> Result<Vec<Grid<f32>>, Cancelled> {
        let means = self.means();
        match widening {
            Widening::Fit(objective) => fit::fit(self, &means, objective, observer),
            Widening::Rule(row) => {
                observer.check()?;
                Ok(rules::bake(row, &means))
            }
        }
    }
}

/// Mean of the normals and of the roughness under a texel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// Mean normal; as short as the normals are spread.
    pub normal: Vec3,
    /// Mean perceptual roughness.
    pub roughness: f32,
}

impl std::ops::Add for Mean {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { normal: self.normal + other.normal, roughness: self.roughness + other.roughness }
    }
}

impl std::ops::Mul<f32> for Mean {
    type Output = Self;

    fn mul(self, by: f32) -> Self {
        Self { normal: self.normal * by, roughness: self.roughness * by }
    }
}
