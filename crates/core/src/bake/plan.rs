//! Plan of a bake: the levels that bands of rows reach, and the rows of each band.

use std::ops::Range;

use crate::grid::Size;
use crate::pyramid::{Layout, level_sizes};

/// Level-1 rows that one task makes: enough to carry through [`CASCADE`] levels.
pub(super) const BAND: usize = 8;

/// Coarse levels that a band makes, at most: 8 rows become 4, 2 and 1.
pub(super) const CASCADE: usize = 4;

/// Sizes of all levels, and which of them bands reach.
pub(super) struct Plan {
    pub(super) layout: Layout,
    pub(super) sizes: Vec<Size>,
    /// Last level that bands make; its sums are kept for the levels beyond.
    pub(super) kept: usize,
}

impl Plan {
    pub(super) fn new(layout: Layout) -> Self {
        let sizes = level_sizes(layout.size);
        let halves =
            |l: &usize| sizes[l - 1] == Size { width: 2 * sizes[*l].width, height: 2 * sizes[*l].height };
        let last = CASCADE.min(sizes.len() - 1);
        let kept = (2..=last).take_while(halves).last().unwrap_or(1.min(last));
        Self { layout, sizes, kept }
    }

    /// The level whose rows bands are counted in: 1, or 0 when there is no other.
    pub(super) fn unit(&self) -> Size {
        self.sizes[1.min(self.kept)]
    }

    pub(super) fn bands(&self) -> Vec<Band> {
        let height = self.unit().height;
        (0..height).step_by(BAND).map(|r| Band(r..(r + BAND).min(height))).collect()
    }

    pub(super) fn row_bytes(&self, level: usize) -> usize {
        self.sizes[level].width * self.layout.precision.texel_bytes()
    }

    /// The coarsest kept level finer than `level` whose texels nest in it; else 0, the surface.
    pub(super) fn nearest_nesting(&self, level: usize) -> usize {
        let coarse = self.sizes[level];
        let nests = |k: &usize| {
            let fine = self.sizes[*k];
            fine.width.is_multiple_of(coarse.width) && fine.height.is_multiple_of(coarse.height)
        };
        (self.kept..level).rev().find(nests).unwrap_or(0)
    }
}

/// The rows of the unit level that one task makes.
pub(super) struct Band(pub(super) Range<usize>);

impl Band {
    /// Rows of a level that this band stores: on level 0 those that begin in it.
    pub(super) fn rows(&self, plan: &Plan, level: usize) -> Range<usize> {
        let (own, unit) = (plan.sizes[level].height, plan.unit().height);
        self.0.start * own / unit..self.0.end * own / unit
    }

    pub(super) fn bytes(&self, plan: &Plan, level: usize) -> usize {
        self.rows(plan, level).len() * plan.row_bytes(level)
    }
}

/// Splits layers that lie one after another into bands of these lengths: for each band, its part of every
/// layer.
pub(super) fn split_layers<'a, T>(
    data: &'a mut [T],
    layers: usize,
    lengths: &[usize],
) -> Vec<Vec<&'a mut [T]>> {
    let mut bands: Vec<Vec<&mut [T]>> = lengths.iter().map(|_| Vec::with_capacity(layers)).collect();
    let mut rest = data;
    for _ in 0..layers {
        for (band, length) in bands.iter_mut().zip(lengths) {
            let (part, after) = rest.split_at_mut(*length);
            band.push(part);
            rest = after;
        }
    }
    bands
}
