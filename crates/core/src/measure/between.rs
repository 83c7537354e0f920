//! Error between texels, where a filtered picture lives: at the middle of edges and at corners.
//!
//! The truth there is the mean of the true reflectance of the two or four texels around, as a linear filter
//! of reflectance would show. Two ways to approach it are measured: decoding the *filtered* channels,
//! and the *reference path*, which shades every neighbour and blends the results (Han et al. 2007, section
//! 6.3, for lobes that are not aligned). The first loses against the second by misalignment, or, for one
//! lobe, by the width that its variance cannot hold.

use glam::DVec2;
use rand::{SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::TexelTruth;
use crate::brdf::Lobe;
use crate::grid::Size;
use crate::lookup::{Tap, Texels};
use crate::ndf::{Evaluator, Method};
use crate::observe::{Cancelled, Observer};
use crate::pyramid::{Pyramid, level_sizes};
use crate::sphere::DiskLattice;
use crate::surface::Wraps;

/// Corners measured a level, at most; each with the edges to its right and below its texel.
pub const SITES: usize = 64;

/// A corner: the texel above left of it, the one to the right of that, the one below, and the one across.
pub type Corner = [(usize, usize); 4];

/// Corners of a level and the true lobes around them.
pub struct TrueCorners {
    /// The level.
    pub level: usize,
    size: Size,
    corners: Vec<Corner>,
    /// The true lobe of each of a corner's texels, at every direction of the lattice.
    lobes: Vec<[Vec<f64>; 4]>,
}

/// Relative L2 errors at corners and edges of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteringError {
    /// The level.
    pub level: usize,
    /// Error at the texels themselves, those around the same corners.
    pub texels: f64,
    /// Error between them, by the filtered channels.
    pub filtered: f64,
    /// Error between them, by the reference path.
    pub reference: f64,
}

/// Corners of every level that has more than one texel, with their truth; the same for every method.
///
/// # Errors
/// [`Cancelled`] by the observer.
pub fn true_corners(
    truth: &TexelTruth<'_>,
    wraps: Wraps,
    levels: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<TrueCorners>, Cancelled> {
    let sizes = level_sizes(truth.size());
    let measured: Vec<usize> =
        levels.iter().copied().filter(|l| sizes.get(*l).is_some_and(|s| s.area() > 1)).collect();
    let of_level = |(done, level): (usize, &usize)| {
        let corners = corners_of(sizes[*level], wraps, *level);
        let true_lobes = |corner: &Corner| {
            observer.check()?;
            Ok(corner.map(|(x, y)| truth.texel(sizes[*level], x, y)))
        };
        let lobes = corners.par_iter().map(true_lobes).collect::<Result<_, Cancelled>>()?;
        observer.progress((done + 1) as f64 / measured.len() as f64);
        Ok(TrueCorners { level: *level, size: sizes[*level], corners, lobes })
    };
    measured.iter().enumerate().map(of_level).collect()
}

/// Corners of a level, drawn evenly with a fixed seed where there are many.
fn corners_of(size: Size, wraps: Wraps, level: usize) -> Vec<Corner> {
    let mut all: Vec<usize> = (0..size.area()).collect();
    let mut random = Pcg64Mcg::seed_from_u64(level as u64);
    let drawn = all.partial_shuffle(&mut random, SITES).0;
    let corner = |i: &usize| {
        let (x, y) = (i % size.width, i / size.width);
        let right = wraps.x.index(x as isize + 1, size.width);
        let below = wraps.y.index(y as isize + 1, size.height);
        [(x, y), (right, y), (x, below), (right, below)]
    };
    drawn.iter().map(corner).collect()
}

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

/// The errors of a baked map between the texels of a level. A method that cannot be filtered takes the
/// reference path for both.
#[must_use]
pub fn filtering_error(
    pyramid: &Pyramid,
    method: &dyn Method,
    lobe: &dyn Lobe,
    lattice: &DiskLattice,
    truth: &TrueCorners,
) -> FilteringError {
    let evaluator = method.evaluator(lobe, &lattice.directions);
    let level = truth.level;
    let of_corner = |(corner, lobes): (&Corner, &[Vec<f64>; 4])| {
        let mut sums = [Squares::default(); 3];
        let mut out = vec![0.0; lattice.len()];
        let mut channels = vec![0.0; pyramid.channels()];
        for ((x, y), lobe) in corner.iter().zip(lobes) {
            evaluator.evaluate(&pyramid.texel(level, *x, *y), &mut out);
            sums[0].add(&out, lobe);
        }
        for (meeting, place) in PLACES {
            let mut lobe = vec![0.0; lattice.len()];
            for k in meeting {
                lobe.iter_mut().zip(&lobes[*k]).for_each(|(sum, f)| *sum += f / meeting.len() as f64);
            }
            let (x, y) = corner[0];
            let size = DVec2::new(truth.size.width as f64, truth.size.height as f64);
            let uv = (DVec2::new(x as f64, y as f64) + place) / size;
            evaluate_neighbours(pyramid, &*evaluator, (uv, level as f64), &mut out);
            sums[2].add(&out, &lobe);
            if method.filterable() {
                channels.fill(0.0);
                pyramid.bilinear(level, uv, 1.0, &mut channels);
                evaluator.evaluate(&channels, &mut out);
            }
            sums[1].add(&out, &lobe);
        }
        sums
    };
    let all: Vec<[Squares; 3]> = truth.corners.par_iter().zip(&truth.lobes).map(of_corner).collect();
    let error = |k: usize| {
        let total = all.iter().fold(Squares::default(), |t, s| Squares {
            difference: t.difference + s[k].difference,
            norm: t.norm + s[k].norm,
        });
        total.relative()
    };
    FilteringError { level, texels: error(0), filtered: error(1), reference: error(2) }
}

/// Sums of squares of a difference and of the truth.
#[derive(Clone, Copy, Default)]
struct Squares {
    difference: f64,
    norm: f64,
}

impl Squares {
    fn add(&mut self, approx: &[f64], truth: &[f64]) {
        for (a, t) in approx.iter().zip(truth) {
            self.difference += (a - t) * (a - t);
            self.norm += t * t;
        }
    }

    fn relative(self) -> f64 {
        if self.norm > 0.0 { (self.difference / self.norm).sqrt() } else { self.difference.sqrt() }
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

    /// Errors at level 3 of a built-in map.
    fn errors(map: &str, method: &str) -> FilteringError {
        let surface = (procedural::find(map).unwrap().build)(Size::new(128, 128).unwrap());
        let lobe = "blinn-phong:50".parse::<AnyLobe>().unwrap();
        let lattice = DiskLattice::new(40, DISK_RADIUS);
        let truth = TexelTruth::new(&*surface, &*lobe, &lattice);
        let corners = true_corners(&truth, surface.wraps(), &[3], &|_| ()).unwrap();
        let method = method.parse::<AnyMethod>().unwrap();
        let bake = Bake::new(&*surface, &*method);
        filtering_error(&bake.to_pyramid().unwrap().0, &*method, &*lobe, &lattice, &corners[0])
    }

    #[test]
    fn what_is_linear_needs_no_reference_path() {
        // Spherical harmonics are linear up to the clamp at zero, so both paths are the same.
        let e = errors("foil", "sh:7");
        assert!((e.filtered - e.reference).abs() < 0.02 * e.reference, "{e:?}");
    }

    #[test]
    fn misaligned_lobes_show_between_texels_and_aligned_ones_hardly() {
        let (un, aligned) = (errors("foil", "vmf:4:unaligned"), errors("foil", "vmf:4"));
        assert!(un.filtered > 2.0 * un.reference, "{un:?}");
        assert!(aligned.filtered < 0.6 * un.filtered, "{aligned:?} {un:?}");
    }

    #[test]
    fn permuting_lobes_is_not_alignment_but_better_than_nothing() {
        let [un, matched, parent] =
            ["unaligned", "matched", "parent"].map(|a| errors("foil", &format!("vmf:4:{a}")));
        assert!(
            matched.filtered < un.filtered && parent.filtered < matched.filtered,
            "{un:?} {matched:?} {parent:?}"
        );
        // The fit is the same, only the order of lobes is not.
        assert!((matched.texels - un.texels).abs() < 0.02 * un.texels);
    }
}
