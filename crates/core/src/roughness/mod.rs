//! Roughness mips: for each texel of each level the roughness of one GGX lobe, which an engine's own material
//! shades in place of all the normals under it.
//!
//! An engine averages a normal map and a roughness map apart, level by level. What the normals lose in
//! spread, the roughness has to gain, or a surface dulls or sparkles with distance. This is the one-lobe form
//! of a normal distribution map, for renderers that take no other: `fit.rs` chooses the lobe by what a viewer
//! sees, `rules.rs` has the closed formulas that engines ship.

mod engine;
mod fit;
mod lobe;
mod mips;
mod profile;
mod rules;

use glam::Vec3;

use crate::grid::{Grid, Size};
use crate::observe::{Cancelled, Observer};
use crate::pyramid::footprint;
use crate::surface::{Surface, SurfaceRow, unit_or_up};

pub use engine::{EngineMaterial, LEAST_ROUGHNESS};
pub use fit::Objective;
pub use lobe::EngineLobe;
pub use mips::{enlarged, mips};
pub use rules::{PLAIN, Reads, Row, Spread, TABLE, find};

use mips::filled;

/// Normals and roughness, as large as one another, and their plain mips.
#[derive(Clone, Debug)]
pub struct RoughSurface {
    /// Normal and roughness of every texel of every level.
    levels: Vec<Grid<[f32; 4]>>,
}

/// Mean of the normals and of the roughness under a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Mean normal; as short as the normals are spread.
    pub normal: Vec3,
    /// Mean perceptual roughness.
    pub roughness: f32,
}

impl Mean {
    fn of([x, y, z, roughness]: [f32; 4]) -> Self {
        Self { normal: Vec3::new(x, y, z), roughness }
    }
}

/// Error of a roughness that is no number from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("roughness must be between 0 and 1, not {0}")]
pub struct RoughnessError(pub f32);

/// Method by which roughness is worked out.
#[derive(Clone, Copy, Debug)]
pub enum Widening {
    /// Fit of one lobe to each texel.
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
        let (own, other, wraps) = (surface.size(), roughness.size(), surface.wraps());
        let mut texels = Vec::with_capacity(own.area());
        let mut row = SurfaceRow::flat(own.width);
        for y in 0..own.height {
            surface.read_row(y, &mut row);
            texels.extend((0..own.width).map(|i| row.normal(i).extend(0.0).to_array()));
        }
        let normals = Grid::from_vec(own, texels).unwrap_or_else(|| unreachable!("row by row"));
        let size = Size { width: own.width.max(other.width), height: own.height.max(other.height) };
        let normals = if own == size { normals } else { enlarged(&normals, size, wraps) };
        let plain = Grid::from_fn(other, |x, y| [roughness.row(y)[x]; 4]);
        let roughness = if other == size { plain } else { enlarged(&plain, size, wraps) };
        let both = filled(size, |x, y| {
            // What was between two normals is a normal again.
            let Mean { normal, .. } = Mean::of(normals.row(y)[x]);
            let normal = if own == size { normal } else { unit_or_up(normal) };
            normal.extend(roughness.row(y)[x][0]).to_array()
        });
        Ok(Self { levels: mips(both) })
    }

    /// Width and height in texels.
    #[must_use]
    pub fn size(&self) -> Size {
        self.levels[0].size()
    }

    /// Sizes of all levels, finest first.
    pub fn sizes(&self) -> impl ExactSizeIterator<Item = Size> + '_ {
        self.levels.iter().map(Grid::size)
    }

    /// Mean under a texel, as an engine's own mips have it.
    #[must_use]
    pub fn mean(&self, level: usize, x: usize, y: usize) -> Mean {
        Mean::of(self.levels[level].row(y)[x])
    }

    /// Stride at which all texels of a level together read so many samples; where the level is large, each
    /// reads eight on a side.
    #[must_use]
    pub fn stride(&self, level: Size, samples: usize) -> usize {
        let finest = self.size();
        let across = (finest.width / level.width).max(finest.height / level.height);
        let side = ((samples / level.area()) as f64).sqrt() as usize;
        across.div_ceil(side.max(8))
    }

    /// Normal and roughness of every `stride`th texel under a texel of a level, and its weight; weights sum
    /// to one.
    pub fn under(&self, level: Size, (x, y): (usize, usize), stride: usize, mut each: impl FnMut(f32, Mean)) {
        let (columns, column_weight) = footprint(self.size().width, level.width, x);
        let (rows, row_weight) = footprint(self.size().height, level.height, y);
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
                let weight = (column_weight(i) * row_weight(j) / total) as f32;
                each(weight, self.mean(0, i, j));
            }
        }
    }

    /// Roughness of every level, finest first; the finest is the surface's own.
    ///
    /// # Errors
    /// [`Cancelled`] when the observer wants it to end.
    pub fn bake(&self, widening: Widening, observer: &dyn Observer) -> Result<Vec<Grid<f32>>, Cancelled> {
        match widening {
            Widening::Fit(objective) => fit::fit(self, objective, observer),
            Widening::Rule(row) => {
                observer.check()?;
                Ok(rules::bake(row, self))
            }
        }
    }
}
