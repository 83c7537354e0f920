//! Error between texels, where a filtered picture lives: at the middle of edges and at corners.
//!
//! The truth there is the mean of the true reflectance of the two or four texels around, as a linear filter
//! of reflectance would show. Two ways to approach it are measured: decoding the *filtered* channels,
//! and the *reference path*, which shades every neighbour and blends the results (Han et al. 2007, section
//! 6.3, for lobes that are not aligned). The first loses against the second by misalignment, or, for one
//! lobe, by the width that its variance cannot hold.

use glam::DVec2;
use rayon::prelude::*;

use super::estimate::{Estimate, Sampled, Squares};
use super::texels::{BakedMap, TexelTruth, all_texels};
use crate::grid::Size;
use crate::lookup::{Tap, Texels};
use crate::ndf::Evaluator;
use crate::observe::{Cancelled, Observer};
use crate::pyramid::{Pyramid, level_sizes};
use crate::surface::Wraps;

/// Corners drawn at a time of a level that has more; each has the edges to its right and below its texel.
pub const SITES: usize = 64;

/// Most corners drawn of a level.
pub const MOST_SITES: usize = 512;

/// A corner: the texel above left of it, the one to the right of that, the one below, and the one across.
type Corner = [(usize, usize); 4];

/// Relative L2 errors at corners and edges of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteringError {
    /// The level.
    pub level: usize,
    /// Error at the texels themselves, those around the same corners.
    pub texels: Estimate,
    /// Error between them, by the filtered channels.
    pub filtered: Estimate,
    /// Error between them, by the reference path.
    pub reference: Estimate,
}

/// The corner to the right of and below a texel.
fn corner((x, y): (usize, usize), size: Size, wraps: Wraps) -> Corner {
    let right = wraps.x.index(x as isize + 1, size.width);
    let below = wraps.y.index(y as isize + 1, size.height);
    [(x, y), (right, y), (x, below), (right, below)]
}

/// Errors of maps of one surface between the texels of levels, map by map; every map is measured at the same
/// corners. Levels of one texel are left out.
///
/// A level of at most [`SITES`] corners is measured whole; of others corners are drawn as texels are by
/// [`super::level_errors`], [`MOST_SITES`] at most. A method that cannot be filtered takes the reference path
/// for both.
///
/// # Errors
/// [`Cancelled`] by the observer.
pub fn filtering_errors(
    truth: &TexelTruth<'_>,
    wraps: Wraps,
    levels: &[usize],
    maps: &[BakedMap<'_>],
    observer: &dyn Observer,
) -> Result<Vec<Vec<FilteringError>>, Cancelled> {
    let sizes = level_sizes(truth.size());
    let levels: Vec<usize> =
        levels.iter().copied().filter(|l| sizes.get(*l).is_some_and(|s| s.area() > 1)).collect();
    let mut errors = vec![Vec::new(); maps.len()];
    for (done, level) in levels.iter().enumerate() {
        let size = sizes[*level];
        let measured = |texels: &[(usize, usize)]| -> Result<Vec<Vec<Squares>>, Cancelled> {
            let corners: Vec<Corner> = texels.iter().map(|at| corner(*at, size, wraps)).collect();
            let around = truth.texels(size, corners.as_flattened(), observer)?;
            let corners = Corners { level: *level, size, corners: &corners, lobes: around.as_chunks().0 };
            Ok(maps.iter().flat_map(|map| corners.squares(truth, map)).collect())
        };
        let mut drawn = Sampled::new(FIGURES * maps.len());
        if size.area() > SITES {
            let draws = truth.draws(size);
            while !drawn.is_enough(MOST_SITES.min(size.area())) {
                let places = draws.draw(SITES, *level, drawn.batches);
                let texels: Vec<(usize, usize)> = places.iter().map(|d| d.texel).collect();
                drawn.add(&places, measured(&texels)?);
            }
        }
        let estimates = if drawn.batches == 0 || drawn.weights.len() >= size.area() {
            // In parts: all lobes around many corners at once are gigabytes.
            let mut whole = vec![Vec::new(); FIGURES * maps.len()];
            for texels in all_texels(size).chunks(SITES) {
                whole.iter_mut().zip(measured(texels)?).for_each(|(all, own)| all.extend(own));
            }
            whole.iter().map(|squares| Estimate::of(squares, None)).collect()
        } else {
            drawn.estimates()
        };
        for ((errors, map), [texels, filtered, reference]) in
            errors.iter_mut().zip(maps).zip(estimates.as_chunks().0)
        {
            if *level < map.from_level {
                continue;
            }
            let (texels, filtered, reference) = (*texels, *filtered, *reference);
            errors.push(FilteringError { level: *level, texels, filtered, reference });
        }
        observer.progress((done + 1) as f64 / levels.len() as f64);
    }
    Ok(errors)
}

/// Figures of a corner: at texels, filtered, by the reference path.
const FIGURES: usize = 3;

/// Places measured at a corner: which of its texels meet there, and where that is, in texels from the first
/// one's corner.
const PLACES: [(&[usize], DVec2); 3] =
    [(&[0, 1], DVec2::new(1.0, 0.5)), (&[0, 2], DVec2::new(0.5, 1.0)), (&[0, 1, 2, 3], DVec2::new(1.0, 1.0))];

/// The effective lobe by the reference path: every neighbour is shaded, and the results are blended.
pub fn evaluate_neighbours(
    pyramid: &Pyramid,
    evaluator: &dyn Evaluator,
    (uv, lod): (DVec2, f64),
    out: &mut [f64],
) {
    out.fill(0.0);
    let mut one = vec![0.0; out.len()];
    for n in pyramid.neighbours(Tap { uv, lod }) {
        evaluator.evaluate(&pyramid.texel(n.level, n.x, n.y), &mut one);
        out.iter_mut().zip(&one).for_each(|(sum, f)| *sum += n.weight * f);
    }
}

/// Corners of a level, with the true lobes of the four texels around each.
struct Corners<'a> {
    level: usize,
    size: Size,
    corners: &'a [Corner],
    lobes: &'a [[Vec<f64>; 4]],
}

impl Corners<'_> {
    /// Sums of squares of a map: for each figure, of every corner.
    fn squares(&self, truth: &TexelTruth<'_>, map: &BakedMap<'_>) -> [Vec<Squares>; FIGURES] {
        let BakedMap { pyramid, method, from_level } = map;
        let Some(level) = self.level.checked_sub(*from_level) else {
            return std::array::from_fn(|_| vec![Squares::default(); self.corners.len()]);
        };
        let evaluator = truth.shown_by(*method);
        let directions = truth.values();
        let of_corner = |(corner, lobes): (&Corner, &[Vec<f64>; 4])| {
            let mut sums = [Squares::default(); FIGURES];
            let mut out = vec![0.0; directions];
            let mut channels = vec![0.0; pyramid.channels()];
            for ((x, y), lobe) in corner.iter().zip(lobes) {
                evaluator.evaluate(&pyramid.texel(level, *x, *y), &mut out);
                sums[0].add(&out, lobe);
            }
            for (meeting, place) in PLACES {
                let mut lobe = vec![0.0; directions];
                for k in meeting {
                    lobe.iter_mut().zip(&lobes[*k]).for_each(|(sum, f)| *sum += f / meeting.len() as f64);
                }
                let (x, y) = corner[0];
                let size = DVec2::new(self.size.width as f64, self.size.height as f64);
                let uv = (DVec2::new(x as f64, y as f64) + place) / size;
                evaluate_neighbours(pyramid, &evaluator, (uv, level as f64), &mut out);
                sums[2].add(&out, &lobe);
                if method.mixes() {
                    channels.fill(0.0);
                    pyramid.bilinear(level, uv, 1.0, &mut channels);
                    evaluator.evaluate(&channels, &mut out);
                }
                sums[1].add(&out, &lobe);
            }
            sums
        };
        let all: Vec<[Squares; FIGURES]> = self.corners.par_iter().zip(self.lobes).map(of_corner).collect();
        std::array::from_fn(|k| all.iter().map(|sums| sums[k]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::Bake;
    use crate::brdf::AnyLobe;
    use crate::measure::DISK_RADIUS;
    use crate::ndf::AnyMethod;
    use crate::procedural;
    use crate::sphere::DiskLattice;

    /// Errors at level 3 of a built-in map.
    fn errors(map: &str, method: &str) -> FilteringError {
        let surface = (procedural::find(map).unwrap().build)(Size::new(128, 128).unwrap());
        let lobe = "blinn-phong:50".parse::<AnyLobe>().unwrap();
        let lattice = DiskLattice::new(40, DISK_RADIUS);
        let truth = TexelTruth::new(&*surface, &*lobe, &lattice);
        let method = method.parse::<AnyMethod>().unwrap();
        let pyramid = Bake::new(&*surface, &*method).to_pyramid().unwrap().0;
        let map = BakedMap { pyramid: &pyramid, from_level: 0, method: &*method };
        filtering_errors(&truth, surface.wraps(), &[3], &[map], &|_| ()).unwrap()[0][0]
    }

    #[test]
    fn what_is_linear_needs_no_reference_path() {
        // Spherical harmonics are linear up to the clamp at zero, so both paths are the same.
        let e = errors("foil", "sh:7");
        assert!((e.filtered.error - e.reference.error).abs() < 0.02 * e.reference.error, "{e:?}");
    }

    #[test]
    fn misaligned_lobes_show_between_texels_and_aligned_ones_hardly() {
        let (un, aligned) = (errors("foil", "vmf:4:unaligned"), errors("foil", "vmf:4"));
        assert!(un.filtered.error > 2.0 * un.reference.error, "{un:?}");
        assert!(aligned.filtered.error < 0.6 * un.filtered.error, "{aligned:?} {un:?}");
    }

    #[test]
    fn permuting_lobes_is_not_alignment_but_better_than_nothing() {
        let [un, matched, parent] =
            ["unaligned", "matched", "parent"].map(|a| errors("foil", &format!("vmf:4:{a}")));
        assert!(
            matched.filtered.error < un.filtered.error && parent.filtered.error < matched.filtered.error,
            "{un:?} {matched:?} {parent:?}"
        );
        // The fit is the same, only the order of lobes is not.
        assert!((matched.texels.error - un.texels.error).abs() < 0.02 * un.texels.error);
    }
}
