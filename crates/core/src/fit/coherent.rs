//! The papers' prior: means drawn towards those of the parent and of neighbours already fitted.
//!
//! Han et al. 2007, section 6.3, and Tan et al. 2005, section 4.2, visit texels in scanline order. Here the
//! texels of a level are visited in four passes, like the squares of a board with four colours: a texel sees
//! its parent and those of its eight neighbours that an earlier pass has fitted. This is as coherent, and
//! runs in parallel.

use rayon::prelude::*;

use super::assign::{MAX_LOBES, assign};
use super::em::{iterate, naturals};
use super::family::{Family, Isotropic, Pull};
use super::samples::{SampleGrid, Samples};
use super::{LEAST_WEIGHT, Level, PARENT_ROUNDS, at, each_texel};
use crate::surface::Wraps;

/// Context of a level's prior: all that it looks at besides the level itself.
pub(crate) struct PriorContext<'a, const N: usize> {
    pub(super) grid: &'a SampleGrid<N>,
    pub(super) parent: &'a Level<N>,
    pub(super) lobes: usize,
    pub(super) wraps: Wraps,
    /// Texels of the finest level.
    pub(super) finest: usize,
    /// Strength of the prior.
    pub(super) strength: f32,
}

/// Number of the pass, of four, that visits a texel.
fn pass_of((x, y): (usize, usize)) -> usize {
    (x & 1) + 2 * (y & 1)
}

/// Plain EM for every texel of a level, from the sums that are in it.
pub(super) fn without_prior<const N: usize>(
    family: impl Family<N>,
    context: &PriorContext<'_, N>,
    level: &mut Level<N>,
) {
    each_texel(context.grid, level, context.lobes, |_, samples, sums| {
        iterate(family, samples, PARENT_ROUNDS, sums);
    });
}

/// EM with the prior for every texel of a level, from the sums that are in it.
pub(super) fn with_prior(family: impl Isotropic, context: &PriorContext<'_, 4>, level: &mut Level<4>) {
    let PriorContext { grid, parent, lobes, wraps, finest, strength } = *context;
    let size = level.size;
    let count = finest as f32 / size.area() as f32;
    for pass in 0..4 {
        let sums = &level.sums;
        let texels: Vec<usize> = (0..size.area()).filter(|i| pass_of(at(size, *i)) == pass).collect();
        let fit = |samples: &mut Samples<4>, i: &usize| {
            let (x, y) = at(size, *i);
            let mut pulls = [Pull { strength, count, ..Pull::default() }; MAX_LOBES];
            let mut draw = |neighbour: &[[f32; 4]]| {
                for (pull, sums) in pulls.iter_mut().zip(neighbour).filter(|(_, s)| s[0] > LEAST_WEIGHT) {
                    let shape = family.decode(sums);
                    pull.weight += shape.alpha;
                    (0..3).for_each(|k| pull.mean[k] += shape.alpha * shape.mean[k]);
                }
            };
            draw(parent.over(size, lobes, (x, y)));
            for (dx, dy) in NEIGHBOURS {
                let there =
                    (wraps.x.index(x as isize + dx, size.width), wraps.y.index(y as isize + dy, size.height));
                if pass_of(there) < pass {
                    draw(&sums[(there.1 * size.width + there.0) * lobes..][..lobes]);
                }
            }
            grid.gather(size, (x, y), samples);
            let mut own = [[0.0; 4]; MAX_LOBES];
            own[..lobes].copy_from_slice(&sums[i * lobes..][..lobes]);
            let mut theta = [[0.0; 4]; MAX_LOBES];
            for _ in 0..PARENT_ROUNDS {
                own.iter_mut().zip(&pulls).for_each(|(own, pull)| *own = family.with_prior(own, pull));
                naturals(family, &own[..lobes], &mut theta[..lobes]);
                assign(&theta[..lobes], samples, &mut own[..lobes]);
            }
            let settle = |(own, pull): (&[f32; 4], &Pull)| {
                family.settle(&family.decode(&family.with_prior(own, pull)))
            };
            std::array::from_fn(|j| settle((&own[j], &pulls[j])))
        };
        let fitted: Vec<[[f32; 4]; MAX_LOBES]> = texels.par_iter().map_init(Samples::default, fit).collect();
        for (i, own) in texels.iter().zip(fitted) {
            level.sums[i * lobes..][..lobes].copy_from_slice(&own[..lobes]);
        }
    }
}

/// The eight texels around one.
const NEIGHBOURS: [(isize, isize); 8] =
    [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
