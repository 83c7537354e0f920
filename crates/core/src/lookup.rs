//! Filtered look-ups of a pyramid at a place, for a pixel of a given reach, as a texture unit does them.
//!
//! [`Texels`] has the filters, each once. A [`crate::pyramid::Pyramid`] filters its texels as stored; a
//! [`Lookup`], in floats with the channels of a texel side by side, is the fast one.

use glam::DVec2;
use rayon::prelude::*;

use crate::grid::{Grid, Size};
use crate::pyramid::{Pyramid, footprint, level_sizes};
use crate::surface::{Wrap, Wraps};

/// A texel that a filter reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Level of the texel.
    pub level: usize,
    /// Column of the texel.
    pub x: usize,
    /// Row of the texel.
    pub y: usize,
    /// Weight of the texel; weights sum to one.
    pub weight: f64,
}

/// Footprint of a pixel: where it falls on the map, and how far it reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFootprint {
    /// Centre of the pixel, 0..1 over the map, v down the rows.
    pub uv: DVec2,
    /// Change of `uv` to the next pixel on the right.
    pub duv_dx: DVec2,
    /// Change of `uv` to the next pixel below.
    pub duv_dy: DVec2,
}

/// Width of a filter, in taps and levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtering {
    /// Trilinear taps along the longer axis of a pixel's reach, at most; 1 is plain trilinear filtering.
    pub max_taps: usize,
    /// Cuts the reach into this many parts on both axes, each looked up at a level so much finer: with 2,
    /// four times the taps, and a kernel nearer to the pixel's square.
    pub parts: usize,
    /// Bias added to the level that the reach asks for; negative is sharper.
    pub lod_bias: f64,
}

impl Filtering {
    /// Trilinear filter of a texture unit: one tap.
    pub const TRILINEAR: Self = Self { max_taps: 1, parts: 1, lod_bias: 0.0 };

    /// Anisotropic filter of a texture unit: up to so many taps along the longer axis.
    #[must_use]
    pub const fn anisotropic(max_taps: usize) -> Self {
        Self { max_taps, parts: 1, lod_bias: 0.0 }
    }

    /// Anisotropic filter with the reach cut in two on both axes. A tent of two texels at the level where a
    /// texel is a pixel is far wider than the pixel; four tents half as wide are not. This filter halves the
    /// error of every method's pictures (`docs/methods.md`).
    #[must_use]
    pub const fn fine(max_taps: usize) -> Self {
        Self { max_taps, parts: 2, lod_bias: 0.0 }
    }
}

/// Filter of map look-ups: our own taps, or the device's sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Our own taps: the same on every device.
    Taps(Filtering),
    /// The device's sampler, with so many taps at most; 1 is plain trilinear filtering. The result is the
    /// device's choice; a renderer without such a device filters by [`Self::filtering`].
    Sampler(u16),
}

impl Sampling {
    /// Filter by our own taps; for a sampler, the taps that it is meant to take.
    #[must_use]
    pub fn filtering(self) -> Filtering {
        match self {
            Self::Taps(filtering) => filtering,
            Self::Sampler(taps) => Filtering::anisotropic(usize::from(taps.max(1))),
        }
    }
}

/// Settings of a renderer's map look-ups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lookups {
    /// Filter and its width.
    pub sampling: Sampling,
    /// True to shade every texel that the filter reads and mix the results: the reference for lobes that are
    /// not aligned, and the only way for methods that cannot be filtered, which take it unasked.
    pub neighbours: bool,
    /// True to shade as the papers print it; see [`crate::ndf::FilteredTexel::at_means`].
    pub at_means: bool,
}

impl Lookups {
    /// Look-ups by one trilinear tap of our own.
    pub const TRILINEAR: Self = Self::taps(Filtering::TRILINEAR);

    /// Look-ups by taps of our own.
    #[must_use]
    pub const fn taps(filtering: Filtering) -> Self {
        Self { sampling: Sampling::Taps(filtering), neighbours: false, at_means: false }
    }

    /// Look-ups by the device's sampler, with so many taps.
    #[must_use]
    pub const fn sampler(taps: u16) -> Self {
        Self { sampling: Sampling::Sampler(taps), neighbours: false, at_means: false }
    }
}

/// A tap of a filter: a place and a level, whose fraction mixes two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tap {
    /// Place, 0..1 over the map, v down the rows.
    pub uv: DVec2,
    /// Level.
    pub lod: f64,
}

/// The two texels beside a place on one axis, and their shares.
#[inline]
fn pair(t: f64, n: usize, wrap: Wrap) -> [(usize, f64); 2] {
    // Any place will do for one that is not finite, or so far away that floats cannot tell texels apart.
    let t = if t.abs() < 1e15 { t } else { 0.0 };
    let t = match wrap {
        // The part after the point, by way of an integer, which is faster than a call of `floor`. Rounding
        // can make it 1, which is then the first texel again.
        Wrap::Repeat => {
            let part = t - (t as i64) as f64;
            if part < 0.0 { part + 1.0 } else { part }
        }
        Wrap::Clamp => t.clamp(0.0, 1.0),
    };
    let at = t * n as f64 + 0.5;
    // Number of the second texel, from 0 to n. Before texel 0 lies the last texel, or texel 0 itself.
    let next = at as usize;
    let part = at - next as f64;
    let (before, after) = match wrap {
        Wrap::Repeat => (n - 1, 0),
        Wrap::Clamp => (0, n - 1),
    };
    let first = if next == 0 { before } else { (next - 1).min(n - 1) };
    let second = if next < n { next } else { after };
    [(first, 1.0 - part), (second, part)]
}

/// A pyramid that can be looked up.
pub trait Texels {
    /// Sizes of the levels, finest first.
    fn sizes(&self) -> &[Size];

    /// Wrap of each axis, beyond the edges.
    fn wraps(&self) -> Wraps;

    /// Channels of a texel.
    fn channels(&self) -> usize;

    /// Adds a texel's channels times its weight.
    fn add(&self, place: Neighbour, sums: &mut [f32]);

    /// The four texels around `uv` on one level, with their weights in a bilinear filter.
    #[inline]
    fn around(&self, level: usize, uv: DVec2) -> [Neighbour; 4] {
        let (size, wraps) = (self.sizes()[level], self.wraps());
        let [(left, w_left), (right, w_right)] = pair(uv.x, size.width, wraps.x);
        let [(above, w_above), (below, w_below)] = pair(uv.y, size.height, wraps.y);
        [
            Neighbour { level, x: left, y: above, weight: w_left * w_above },
            Neighbour { level, x: right, y: above, weight: w_right * w_above },
            Neighbour { level, x: left, y: below, weight: w_left * w_below },
            Neighbour { level, x: right, y: below, weight: w_right * w_below },
        ]
    }

    /// The finer of the two levels at `lod`, and the share of the coarser; beyond the ends is clamped.
    fn levels_of(&self, lod: f64) -> (usize, f64) {
        let last = self.sizes().len() - 1;
        let lod = if lod.is_nan() { 0.0 } else { lod.clamp(0.0, last as f64) };
        (lod.floor() as usize, lod - lod.floor())
    }

    /// The texels that a trilinear filter mixes, eight at most, with their weights.
    ///
    /// Shading each of them and blending the results shows what filtering should have given, at several times
    /// the cost.
    fn neighbours(&self, tap: Tap) -> Vec<Neighbour> {
        let (level, t) = self.levels_of(tap.lod);
        let mut all = Vec::with_capacity(8);
        for (level, share) in [(level, 1.0 - t), (level + 1, t)] {
            if share > 0.0 {
                let near = self.around(level, tap.uv).into_iter();
                all.extend(
                    near.map(|n| Neighbour { weight: n.weight * share, ..n }).filter(|n| n.weight > 0.0),
                );
            }
        }
        all
    }

    /// Adds `share` of a bilinear look-up on one level.
    #[inline]
    fn bilinear(&self, level: usize, uv: DVec2, share: f64, sums: &mut [f32]) {
        for n in self.around(level, uv) {
            if n.weight > 0.0 {
                self.add(Neighbour { weight: n.weight * share, ..n }, sums);
            }
        }
    }

    /// Adds `share` of a trilinear look-up.
    #[inline]
    fn trilinear(&self, tap: Tap, share: f64, sums: &mut [f32]) {
        let (level, t) = self.levels_of(tap.lod);
        self.bilinear(level, tap.uv, share * (1.0 - t), sums);
        if t > 0.0 {
            self.bilinear(level + 1, tap.uv, share * t, sums);
        }
    }

    /// The trilinear taps, all of one weight, that cover a pixel's reach: along its longer axis, each at the
    /// level that the shorter axis asks for, or as much coarser as `max_taps` makes it.
    ///
    /// The reach is the ellipse of the pixel's derivatives of `uv`; its axes are found exactly (singular
    /// values of the 2×2 derivative), not guessed from the longer column.
    fn taps(&self, pixel: &PixelFootprint, filtering: Filtering) -> (usize, impl Iterator<Item = Tap>)
    where
        Self: Sized,
    {
        let finest = self.sizes()[0];
        let texels = DVec2::new(finest.width as f64, finest.height as f64);
        let (dx, dy) = (pixel.duv_dx * texels, pixel.duv_dy * texels);
        // Eigenvalues of J Jᵀ, whose ellipse is the image of the pixel's unit circle.
        let (a, b, c) = (dx.x * dx.x + dy.x * dy.x, dx.x * dx.y + dy.x * dy.y, dx.y * dx.y + dy.y * dy.y);
        let half = (a - c) / 2.0;
        let spread = (half * half + b * b).sqrt();
        let major = ((a + c) / 2.0 + spread).sqrt();
        // Their product is the square of det J.
        let minor = if major > 0.0 { dx.perp_dot(dy).abs() / major } else { 0.0 };
        // The longer axis has twice the angle whose cosine and sine are these: halved by square roots, the
        // larger first.
        let (cos2, sin2) = if spread > 0.0 { (half / spread, b / spread) } else { (1.0, 0.0) };
        let larger = ((1.0 + cos2.abs()) / 2.0).sqrt();
        let smaller = sin2 / (2.0 * larger);
        let axis = if cos2 >= 0.0 { DVec2::new(larger, smaller) } else { DVec2::new(smaller, larger) };
        let parts = filtering.parts.max(1) as f64;
        // A hundredth over is no reason for another tap: else a round pixel would have one or two by its last
        // digit.
        let wanted = (major / minor.max(1.0) - 0.01).ceil();
        let long = if wanted.is_finite() { wanted.clamp(1.0, filtering.max_taps.max(1) as f64) } else { 1.0 };
        let long = long * parts;
        let lod = (major / long).max(minor / parts).max(1.0).log2() + filtering.lod_bias;
        let (along, across) = (axis * major / texels, axis.perp() * minor / texels);
        let uv = pixel.uv;
        let place = |i: usize, of: f64| (i as f64 + 0.5) / of - 0.5;
        let rows = parts as usize;
        let tap = move |i: usize| Tap {
            uv: uv + along * place(i / rows, long) + across * place(i % rows, parts),
            lod,
        };
        let count = long as usize * rows;
        (count, (0..count).map(tap))
    }

    /// Overwrites `sums` with the filtered channels at a pixel.
    fn filtered(&self, pixel: &PixelFootprint, filtering: Filtering, sums: &mut [f32])
    where
        Self: Sized,
    {
        sums.fill(0.0);
        let (count, taps) = self.taps(pixel, filtering);
        for tap in taps {
            self.trilinear(tap, 1.0 / count as f64, sums);
        }
    }
}

impl Texels for Pyramid {
    fn sizes(&self) -> &[Size] {
        Self::sizes(self)
    }

    fn wraps(&self) -> Wraps {
        Self::wraps(self)
    }

    fn channels(&self) -> usize {
        4 * self.layers()
    }

    fn add(&self, place: Neighbour, sums: &mut [f32]) {
        let weight = place.weight as f32;
        for (sum, c) in sums.iter_mut().zip(self.texel(place.level, place.x, place.y)) {
            *sum += weight * c;
        }
    }
}

/// A pyramid in floats, all channels of a texel side by side.
#[derive(Clone, Debug)]
pub struct Lookup {
    channels: usize,
    wraps: Wraps,
    sizes: Vec<Size>,
    levels: Vec<Vec<f32>>,
}

/// Mean of the values under texel (x, y) of a grid of another size over the same map, weighted by area; where
/// that grid is the finer one, mean of the texels that (x, y) lies in.
#[must_use]
pub fn area_mean(values: &Grid<[f32; 4]>, size: Size, x: usize, y: usize) -> [f32; 4] {
    let fine = values.size();
    let (columns, column) = footprint(fine.width, size.width, x);
    let (rows, row) = footprint(fine.height, size.height, y);
    let mut sum = [0.0; 4];
    for r in rows {
        for c in columns.clone() {
            let weight = (row(r) * column(c)) as f32;
            sum.iter_mut().zip(values.row(r)[c]).for_each(|(s, v)| *s += weight * v);
        }
    }
    sum
}

impl Lookup {
    /// Unpacks a stored pyramid.
    #[must_use]
    pub fn new(pyramid: &Pyramid) -> Self {
        let (layers, precision) = (pyramid.layers(), pyramid.precision());
        let channels = 4 * layers;
        let unpack = |level: usize| {
            let size = pyramid.sizes()[level];
            let bytes = pyramid.level_bytes(level);
            let row_bytes = size.width * precision.texel_bytes();
            let mut texels = vec![0.0; size.area() * channels];
            texels.par_chunks_mut(size.width * channels).enumerate().for_each(|(y, row)| {
                let mut values = Vec::with_capacity(4 * size.width);
                for layer in 0..layers {
                    values.clear();
                    precision
                        .unpack(&bytes[(layer * size.height + y) * row_bytes..][..row_bytes], &mut values);
                    for (texel, rgba) in row.chunks_exact_mut(channels).zip(values.as_chunks::<4>().0) {
                        texel[4 * layer..][..4].copy_from_slice(rgba);
                    }
                }
            });
            texels
        };
        let levels = (0..pyramid.sizes().len()).map(unpack).collect();
        Self { channels, wraps: pyramid.wraps(), sizes: pyramid.sizes().to_vec(), levels }
    }

    /// Area means of plain values at every level.
    #[must_use]
    pub fn of_values(values: &Grid<[f32; 4]>, wraps: Wraps) -> Self {
        let sizes = level_sizes(values.size());
        let level = |size: &Size| {
            let mean = |i: usize| area_mean(values, *size, i % size.width, i / size.width);
            let texels: Vec<[f32; 4]> = (0..size.area()).into_par_iter().map(mean).collect();
            texels.into_flattened()
        };
        let levels = sizes.iter().map(level).collect();
        Self { channels: 4, wraps, sizes, levels }
    }

    /// The channels of a texel.
    #[inline]
    #[must_use]
    pub fn texel(&self, level: usize, x: usize, y: usize) -> &[f32] {
        &self.levels[level][(y * self.sizes[level].width + x) * self.channels..][..self.channels]
    }
}

impl Texels for Lookup {
    fn sizes(&self) -> &[Size] {
        &self.sizes
    }

    fn wraps(&self) -> Wraps {
        self.wraps
    }

    fn channels(&self) -> usize {
        self.channels
    }

    #[inline]
    fn add(&self, place: Neighbour, sums: &mut [f32]) {
        let weight = place.weight as f32;
        let texel = self.texel(place.level, place.x, place.y);
        for (sum, c) in sums.as_chunks_mut::<4>().0.iter_mut().zip(texel.as_chunks::<4>().0) {
            for k in 0..4 {
                sum[k] += weight * c[k];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pyramid::{Layout, Precision};

    fn ramp(size: Size, levels: usize) -> Pyramid {
        // Every level holds u in red and v in green at the texels' centres, so linear look-ups are exact.
        let layout = Layout {
            size,
            layers: 1,
            precision: Precision::Single,
            wraps: Wraps { x: Wrap::Clamp, y: Wrap::Clamp },
        };
        let level = |s: &Size| {
            let mut values = Vec::new();
            for y in 0..s.height {
                for x in 0..s.width {
                    let at =
                        [(x as f32 + 0.5) / s.width as f32, (y as f32 + 0.5) / s.height as f32, 0.0, 1.0];
                    values.extend(at);
                }
            }
            let mut bytes = Vec::new();
            assert_eq!(Precision::Single.pack(&values, &mut bytes), 0);
            bytes
        };
        Pyramid::new(layout, level_sizes(size).iter().take(levels).map(level).collect()).unwrap()
    }

    fn lookup_of_ramp(size: Size, levels: usize) -> Lookup {
        Lookup::new(&ramp(size, levels))
    }

    fn trilinear(p: &Lookup, uv: DVec2, lod: f64) -> Vec<f32> {
        let mut sums = vec![0.0; p.channels()];
        p.trilinear(Tap { uv, lod }, 1.0, &mut sums);
        sums
    }

    fn anisotropic(p: &Lookup, pixel: &PixelFootprint, max_taps: usize) -> Vec<f32> {
        let mut sums = vec![0.0; p.channels()];
        p.filtered(pixel, Filtering::anisotropic(max_taps), &mut sums);
        sums
    }

    #[test]
    fn linear_lookups_reproduce_a_ramp() {
        let p = lookup_of_ramp(Size { width: 16, height: 16 }, 2);
        for (uv, lod) in
            [(DVec2::new(0.3, 0.6), 0.0), (DVec2::new(0.41, 0.52), 0.7), (DVec2::new(0.5, 0.5), 9.0)]
        {
            let c = trilinear(&p, uv, lod);
            // Single-precision centres: 2^-23.
            assert!((f64::from(c[0]) - uv.x).abs() < 2e-7 && (f64::from(c[1]) - uv.y).abs() < 2e-7, "{c:?}");
        }
        let footprint = PixelFootprint {
            uv: DVec2::new(0.5, 0.45),
            duv_dx: DVec2::new(0.3, 0.1),
            duv_dy: DVec2::new(0.0, 0.02),
        };
        let c = anisotropic(&p, &footprint, 16);
        assert!((f64::from(c[0]) - 0.5).abs() < 1e-6 && (f64::from(c[1]) - 0.45).abs() < 1e-6);
    }

    #[test]
    fn neighbours_are_what_the_filter_mixes() {
        let p = lookup_of_ramp(Size { width: 16, height: 8 }, 4);
        for (uv, lod) in
            [(DVec2::new(0.3, 0.6), 0.0), (DVec2::new(0.01, 0.99), 1.3), (DVec2::new(0.5, 0.25), 2.5)]
        {
            let near = p.neighbours(Tap { uv, lod });
            assert!(near.len() <= 8 && (near.iter().map(|n| n.weight).sum::<f64>() - 1.0).abs() < 1e-12);
            for (c, filtered) in trilinear(&p, uv, lod).iter().enumerate() {
                let mixed: f64 =
                    near.iter().map(|n| n.weight * f64::from(p.texel(n.level, n.x, n.y)[c])).sum();
                // The filter works in single floats.
                assert!((mixed - f64::from(*filtered)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn anisotropic_stays_sharper_than_trilinear_along_the_short_axis() {
        // Vertical stripes, and a pixel that is long along them: anisotropic look-ups must still see them.
        let size = Size { width: 64, height: 64 };
        let layout = Layout { size, layers: 1, precision: Precision::Single, wraps: Wraps::default() };
        let stripes = |s: &Size, value: &dyn Fn(usize) -> f32| {
            let row: Vec<f32> = (0..s.width).flat_map(|x| [value(x), 0.0, 0.0, 1.0]).collect();
            let mut bytes = Vec::new();
            Precision::Single.pack(&row.repeat(s.height), &mut bytes);
            bytes
        };
        let levels = level_sizes(size);
        let bytes = levels.iter().enumerate().map(|(l, s)| match l {
            0 => stripes(s, &|x| (x / 2 % 2) as f32),
            1 => stripes(s, &|x| (x % 2) as f32),
            _ => stripes(s, &|_| 0.5),
        });
        let p = Lookup::new(&Pyramid::new(layout, bytes.collect()).unwrap());
        let pixel = PixelFootprint {
            uv: DVec2::new(3.0 / 64.0, 0.5),
            duv_dx: DVec2::new(1.0 / 64.0, 0.0),
            duv_dy: DVec2::new(0.0, 0.25),
        };
        assert!(anisotropic(&p, &pixel, 16)[0] > 0.99);
        assert!((anisotropic(&p, &pixel, 1)[0] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn lookups_survive_nonsense() {
        let p = lookup_of_ramp(Size { width: 4, height: 2 }, 3);
        for bad in [f64::NAN, f64::INFINITY, -1e300] {
            assert!(trilinear(&p, DVec2::splat(bad), bad).iter().all(|c| c.is_finite()));
            let pixel =
                PixelFootprint { uv: DVec2::splat(bad), duv_dx: DVec2::splat(bad), duv_dy: DVec2::ZERO };
            assert!(anisotropic(&p, &pixel, 8).iter().all(|c| c.is_finite()));
        }
    }

    #[test]
    fn values_are_averaged_by_area() {
        let size = Size { width: 5, height: 3 };
        let values = Grid::from_fn(size, |x, y| [x as f32, y as f32, (x * y) as f32, 1.0]);
        let lookup = Lookup::of_values(&values, Wraps::default());
        // The coarsest level is the mean of all; x and y are independent, so is their product.
        let coarsest = lookup.texel(lookup.sizes().len() - 1, 0, 0);
        for (c, expected) in coarsest.iter().zip([2.0, 1.0, 2.0, 1.0]) {
            assert!((c - expected).abs() < 1e-6, "{coarsest:?}");
        }
    }

    #[test]
    fn a_stored_pyramid_and_its_lookup_agree() {
        let stored = ramp(Size { width: 16, height: 8 }, 4);
        let tap = Tap { uv: DVec2::new(0.31, 0.77), lod: 1.4 };
        let [mut a, mut b] = [[0.0; 4]; 2];
        stored.trilinear(tap, 1.0, &mut a);
        Lookup::new(&stored).trilinear(tap, 1.0, &mut b);
        assert_eq!(a, b);
    }
}
