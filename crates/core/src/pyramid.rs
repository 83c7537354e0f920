//! Mip pyramids: sizes of the levels, the area each texel covers, storage, and filtered look-ups.
//!
//! Level `l` is `max(1, size >> l)` texels a side, as graphics APIs have it. Texel `i` of a level with
//! `w` texels covers exactly `[i W/w, (i+1) W/w)` of the `W` finest texels, so where sizes are not
//! powers of two the fine texels at its border count by the fraction inside ("polyphase" box filter).

use std::ops::Range;

use fearless_simd::{Level, dispatch};
use glam::DVec2;
use half::f16;
use half::slice::HalfFloatSliceExt;

use crate::grid::Size;
use crate::surface::{Wrap, Wraps};

/// Sizes of all levels, finest first, down to 1 × 1.
#[must_use]
pub fn level_sizes(finest: Size) -> Vec<Size> {
    let count = usize::BITS - finest.width.max(finest.height).leading_zeros();
    let side = |n: usize, l: u32| (n >> l).max(1);
    (0..count).map(|l| Size { width: side(finest.width, l), height: side(finest.height, l) }).collect()
}

/// The run of fine texels under coarse texel `i` on one axis, with the fraction each contributes.
///
/// Fractions are ratios of integers and sum to one within rounding.
pub fn footprint(fine: usize, coarse: usize, i: usize) -> (Range<usize>, impl Fn(usize) -> f64) {
    // Scaled by `coarse`, fine texel j covers [j coarse, (j+1) coarse), coarse texel i [i fine, (i+1) fine).
    let (start, end) = (i * fine, (i + 1) * fine);
    let range = start / coarse..end.div_ceil(coarse);
    let weight = move |j: usize| {
        let overlap = end.min((j + 1) * coarse) - start.max(j * coarse);
        overlap as f64 / fine as f64
    };
    (range, weight)
}

/// Bits of a stored channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// IEEE half floats, `RGBA16F`.
    #[default]
    Half,
    /// IEEE single floats, `RGBA32F`.
    Single,
}

impl Precision {
    /// Bytes of one RGBA texel of one layer.
    #[must_use]
    pub fn texel_bytes(self) -> usize {
        match self {
            Self::Half => 8,
            Self::Single => 16,
        }
    }

    /// Stores `values` as little-endian channels; returns how many did not fit and became infinite.
    ///
    /// # Panics
    /// When `out` is not as long as the stored values.
    pub fn pack_into(self, values: &[f32], out: &mut [u8]) -> usize {
        match self {
            Self::Half => {
                assert_eq!(out.len(), values.len() * 2, "half floats take two bytes");
                match bytemuck::try_cast_slice_mut::<u8, f16>(out) {
                    Ok(halves) => dispatch!(Level::new(), _simd => pack_halves(values, halves)),
                    // Not aligned for 16-bit stores: by way of the stack.
                    Err(_) => {
                        let mut chunk = [f16::ZERO; 256];
                        for (part, place) in values.chunks(256).zip(out.chunks_mut(512)) {
                            chunk[..part.len()].convert_from_f32_slice(part);
                            place.copy_from_slice(bytemuck::cast_slice(&chunk[..part.len()]));
                        }
                    }
                }
                // Rounding to nearest reaches infinity from 65520 on. Counting is for the rare case: a running
                // maximum of the stored magnitudes, which order as their bits do, costs next to nothing.
                let largest = |most: i16, b: &[u8; 2]| most.max(i16::from_le_bytes(*b) & 0x7fff);
                if out.as_chunks::<2>().0.iter().fold(0, largest) < 0x7c00 {
                    return 0;
                }
                values.iter().filter(|v| v.abs() >= 65520.0 || v.is_nan()).count()
            }
            Self::Single => {
                out.copy_from_slice(bytemuck::cast_slice(values));
                values.iter().filter(|v| !v.is_finite()).count()
            }
        }
    }

    /// Appends `values` as [`Self::pack_into`] stores them.
    pub fn pack(self, values: &[f32], out: &mut Vec<u8>) -> usize {
        let start = out.len();
        out.resize(start + values.len() * self.texel_bytes() / 4, 0);
        self.pack_into(values, &mut out[start..])
    }

    /// Reads little-endian stored channels.
    pub fn unpack(self, bytes: &[u8], out: &mut Vec<f32>) {
        match self {
            Self::Half => {
                out.extend(bytes.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()));
            }
            Self::Single => {
                out.extend(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
            }
        }
    }
}

/// Converts to half floats; inlined into a body with the processor's own instruction for it.
#[inline(always)]
fn pack_halves(values: &[f32], halves: &mut [f16]) {
    halves.convert_from_f32_slice(values);
}

/// A stored pyramid: for each level its layers one after another, each rows of RGBA texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid {
    layers: usize,
    precision: Precision,
    wraps: Wraps,
    sizes: Vec<Size>,
    levels: Vec<Vec<u8>>,
}

/// Levels whose byte counts do not fit the sizes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("level {level} should hold {expected} bytes and holds {found}")]
pub struct LevelMismatch {
    level: usize,
    expected: usize,
    found: usize,
}

/// What a [`Pyramid`] is made of, apart from its levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// Size of level 0.
    pub size: Size,
    /// RGBA layers.
    pub layers: usize,
    /// Bits of a channel.
    pub precision: Precision,
    /// What lies beyond the edges.
    pub wraps: Wraps,
}

impl Layout {
    /// Bytes of one layer of a level of this size.
    #[must_use]
    pub fn layer_bytes(&self, size: Size) -> usize {
        size.area() * self.precision.texel_bytes()
    }
}

impl Pyramid {
    /// Takes stored levels, finest first; there may be fewer than a full chain.
    ///
    /// # Errors
    /// [`LevelMismatch`] when a level is not as long as its size says, or there are too many.
    pub fn new(layout: Layout, levels: Vec<Vec<u8>>) -> Result<Self, LevelMismatch> {
        let mut sizes = level_sizes(layout.size);
        if levels.len() > sizes.len() {
            let found = levels[sizes.len()].len();
            return Err(LevelMismatch { level: sizes.len(), expected: 0, found });
        }
        sizes.truncate(levels.len());
        for (level, (size, bytes)) in sizes.iter().zip(&levels).enumerate() {
            let expected = layout.layer_bytes(*size) * layout.layers;
            if bytes.len() != expected {
                return Err(LevelMismatch { level, expected, found: bytes.len() });
            }
        }
        Ok(Self { layers: layout.layers, precision: layout.precision, wraps: layout.wraps, sizes, levels })
    }

    /// Sizes of the levels, finest first.
    #[must_use]
    pub fn sizes(&self) -> &[Size] {
        &self.sizes
    }

    /// RGBA layers.
    #[must_use]
    pub fn layers(&self) -> usize {
        self.layers
    }

    /// Bits of a stored channel.
    #[must_use]
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// What lies beyond the edges.
    #[must_use]
    pub fn wraps(&self) -> Wraps {
        self.wraps
    }

    /// The stored bytes of a level: its layers one after another.
    #[must_use]
    pub fn level_bytes(&self, level: usize) -> &[u8] {
        &self.levels[level]
    }

    /// Channels of one texel, four a layer.
    ///
    /// # Panics
    /// When the level or the texel does not exist.
    #[must_use]
    pub fn texel(&self, level: usize, x: usize, y: usize) -> Vec<f32> {
        let size = self.sizes[level];
        assert!(x < size.width && y < size.height, "texel ({x}, {y}) lies outside level {level}");
        let texel_bytes = self.precision.texel_bytes();
        let mut channels = Vec::with_capacity(4 * self.layers);
        for layer in 0..self.layers {
            let start = ((layer * size.height + y) * size.width + x) * texel_bytes;
            self.precision.unpack(&self.levels[level][start..start + texel_bytes], &mut channels);
        }
        channels
    }

    /// The four texels around `uv` on one level, and what a bilinear filter weighs them.
    fn around(&self, level: usize, uv: DVec2) -> [Neighbour; 4] {
        let size = self.sizes[level];
        let axis = |t: f64, n: usize, wrap: Wrap| {
            let t = if t.is_finite() { t } else { 0.0 };
            let at = match wrap {
                Wrap::Repeat => t.rem_euclid(1.0),
                Wrap::Clamp => t.clamp(0.0, 1.0),
            } * n as f64
                - 0.5;
            let floor = at.floor();
            let index = |d: isize| wrap.index(floor as isize + d, n);
            [(index(0), 1.0 - (at - floor)), (index(1), at - floor)]
        };
        let columns = axis(uv.x, size.width, self.wraps.x);
        let rows = axis(uv.y, size.height, self.wraps.y);
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(j, i)| {
            let ((y, wy), (x, wx)) = (rows[j], columns[i]);
            Neighbour { level, x, y, weight: wx * wy }
        })
    }

    /// The texels that a trilinear filter mixes at `uv` and `lod`, eight at most, and what it weighs them.
    ///
    /// What shades each and blends the results shows what filtering should have given, at several times the cost.
    #[must_use]
    pub fn neighbours(&self, uv: DVec2, lod: f64) -> Vec<Neighbour> {
        let (level, t) = self.levels_of(lod);
        let mut all = Vec::with_capacity(8);
        for (level, share) in [(level, 1.0 - t), (level + 1, t)] {
            if share > 0.0 {
                let near = self.around(level, uv).into_iter();
                all.extend(
                    near.map(|n| Neighbour { weight: n.weight * share, ..n }).filter(|n| n.weight > 0.0),
                );
            }
        }
        all
    }

    /// The finer of the two levels at `lod`, and the share of the coarser.
    fn levels_of(&self, lod: f64) -> (usize, f64) {
        let last = self.sizes.len() - 1;
        let lod = if lod.is_nan() { 0.0 } else { lod.clamp(0.0, last as f64) };
        (lod.floor() as usize, lod - lod.floor())
    }

    /// Bilinear look-up on one level at `uv` (both 0..1 over the map, v down the rows).
    #[must_use]
    pub fn bilinear(&self, level: usize, uv: DVec2) -> Vec<f32> {
        let mut sums = vec![0.0_f64; 4 * self.layers];
        for n in self.around(level, uv).iter().filter(|n| n.weight > 0.0) {
            for (sum, c) in sums.iter_mut().zip(self.texel(level, n.x, n.y)) {
                *sum += n.weight * f64::from(c);
            }
        }
        sums.into_iter().map(|s| s as f32).collect()
    }

    /// Trilinear look-up: `lod` 0 is the finest level, fractions mix two, beyond the ends is clamped.
    #[must_use]
    pub fn trilinear(&self, uv: DVec2, lod: f64) -> Vec<f32> {
        let (level, t) = self.levels_of(lod);
        let mut channels = self.bilinear(level, uv);
        if t > 0.0 {
            let t = t as f32;
            for (c, coarse) in channels.iter_mut().zip(self.bilinear(level + 1, uv)) {
                *c += t * (coarse - *c);
            }
        }
        channels
    }

    /// Anisotropic look-up: the mean of up to `max_taps` trilinear taps along the longer axis of the
    /// footprint, each at the level that the shorter axis asks for.
    ///
    /// The footprint is the ellipse whose axes come from the pixel's derivatives of `uv`; its
    /// axes are found exactly (singular values of the 2×2 derivative), not guessed from the longer column.
    #[must_use]
    pub fn anisotropic(&self, footprint: &PixelFootprint, max_taps: usize) -> Vec<f32> {
        let texels = DVec2::new(self.sizes[0].width as f64, self.sizes[0].height as f64);
        let (dx, dy) = (footprint.duv_dx * texels, footprint.duv_dy * texels);
        // Eigenvalues of J Jᵀ, whose ellipse is the image of the pixel's unit circle.
        let (a, b, c) = (dx.x * dx.x + dy.x * dy.x, dx.x * dx.y + dy.x * dy.y, dx.y * dx.y + dy.y * dy.y);
        let (mean, spread) = ((a + c) / 2.0, ((a - c) / 2.0).hypot(b));
        let (major, minor) = ((mean + spread).sqrt(), (mean - spread).max(0.0).sqrt());
        // The angle's own formula has no branch for a circle or an axis-aligned ellipse.
        let angle = 0.5 * (2.0 * b).atan2(a - c);
        let wanted = (major / minor.max(1.0)).ceil();
        let taps = if wanted.is_finite() { wanted.clamp(1.0, max_taps.max(1) as f64) } else { 1.0 };
        let lod = (major / taps).max(minor).max(1.0).log2();
        let step = DVec2::from_angle(angle) * major / texels;
        let mut sums = vec![0.0_f32; 4 * self.layers];
        for tap in 0..taps as usize {
            let t = (tap as f64 + 0.5) / taps - 0.5;
            for (sum, c) in sums.iter_mut().zip(self.trilinear(footprint.uv + step * t, lod)) {
                *sum += c / taps as f32;
            }
        }
        sums
    }
}

/// A texel that a filter reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Its level.
    pub level: usize,
    /// Its column.
    pub x: usize,
    /// Its row.
    pub y: usize,
    /// Its share; shares sum to one.
    pub weight: f64,
}

/// Where a pixel falls on the map, and how far it reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFootprint {
    /// Its centre, 0..1 over the map, v down the rows.
    pub uv: DVec2,
    /// Change of `uv` to the next pixel on the right.
    pub duv_dx: DVec2,
    /// Change of `uv` to the next pixel below.
    pub duv_dy: DVec2,
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn sizes_halve_downwards() {
        let sizes: Vec<_> =
            level_sizes(Size { width: 20, height: 5 }).iter().map(|s| (s.width, s.height)).collect();
        assert_eq!(sizes, [(20, 5), (10, 2), (5, 1), (2, 1), (1, 1)]);
        assert_eq!(level_sizes(Size { width: 1, height: 1 }).len(), 1);
    }

    #[test]
    fn footprints_partition_the_fine_texels() {
        for (fine, coarse) in [(8, 4), (745, 372), (745, 46), (5, 2), (7, 7), (1000, 3), (3, 1)] {
            let mut covered = vec![0.0; fine];
            for i in 0..coarse {
                let (range, weight) = footprint(fine, coarse, i);
                let total: f64 = range.clone().map(&weight).sum();
                assert!((total - 1.0).abs() < 1e-12);
                for j in range {
                    assert!(weight(j) > 0.0);
                    covered[j] += weight(j) * fine as f64 / coarse as f64;
                }
            }
            assert!(covered.iter().all(|c| (c - 1.0).abs() < 1e-12), "{fine} to {coarse}");
        }
    }

    #[test]
    fn half_floats_round_trip_and_report_overflow() {
        let mut bytes = Vec::new();
        assert_eq!(Precision::Half.pack(&[0.5, -2.0, 65504.0, 1e6], &mut bytes), 1);
        let mut back = Vec::new();
        Precision::Half.unpack(&bytes, &mut back);
        assert_eq!(back, [0.5, -2.0, 65504.0, f32::INFINITY]);
    }

    #[test]
    fn linear_lookups_reproduce_a_ramp() {
        let p = ramp(Size { width: 16, height: 16 }, 2);
        for (uv, lod) in
            [(DVec2::new(0.3, 0.6), 0.0), (DVec2::new(0.41, 0.52), 0.7), (DVec2::new(0.5, 0.5), 9.0)]
        {
            let c = p.trilinear(uv, lod);
            // Single-precision centres: 2^-23.
            assert!((f64::from(c[0]) - uv.x).abs() < 2e-7 && (f64::from(c[1]) - uv.y).abs() < 2e-7, "{c:?}");
        }
        let footprint = PixelFootprint {
            uv: DVec2::new(0.5, 0.45),
            duv_dx: DVec2::new(0.3, 0.1),
            duv_dy: DVec2::new(0.0, 0.02),
        };
        let c = p.anisotropic(&footprint, 16);
        assert!((f64::from(c[0]) - 0.5).abs() < 1e-6 && (f64::from(c[1]) - 0.45).abs() < 1e-6);
    }

    #[test]
    fn neighbours_are_what_the_filter_mixes() {
        let p = ramp(Size { width: 16, height: 8 }, 4);
        for (uv, lod) in
            [(DVec2::new(0.3, 0.6), 0.0), (DVec2::new(0.01, 0.99), 1.3), (DVec2::new(0.5, 0.25), 2.5)]
        {
            let near = p.neighbours(uv, lod);
            assert!(near.len() <= 8 && (near.iter().map(|n| n.weight).sum::<f64>() - 1.0).abs() < 1e-12);
            for (c, filtered) in p.trilinear(uv, lod).iter().enumerate() {
                let mixed: f64 =
                    near.iter().map(|n| n.weight * f64::from(p.texel(n.level, n.x, n.y)[c])).sum();
                // The filter works in single floats.
                assert!((mixed - f64::from(*filtered)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn anisotropic_stays_sharper_than_trilinear_along_the_short_axis() {
        // Vertical stripes, a pixel that is long along them: anisotropic look-ups must still see them.
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
        let p = Pyramid::new(layout, bytes.collect()).unwrap();
        let pixel = PixelFootprint {
            uv: DVec2::new(3.0 / 64.0, 0.5),
            duv_dx: DVec2::new(1.0 / 64.0, 0.0),
            duv_dy: DVec2::new(0.0, 0.25),
        };
        assert!(p.anisotropic(&pixel, 16)[0] > 0.99);
        assert!((p.anisotropic(&pixel, 1)[0] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn lookups_survive_nonsense() {
        let p = ramp(Size { width: 4, height: 2 }, 3);
        for bad in [f64::NAN, f64::INFINITY, -1e300] {
            assert!(p.trilinear(DVec2::splat(bad), bad).iter().all(|c| c.is_finite()));
            let pixel =
                PixelFootprint { uv: DVec2::splat(bad), duv_dx: DVec2::splat(bad), duv_dy: DVec2::ZERO };
            assert!(p.anisotropic(&pixel, 8).iter().all(|c| c.is_finite()));
        }
    }

    #[test]
    fn wrong_lengths_are_refused() {
        let layout = Layout {
            size: Size { width: 2, height: 2 },
            layers: 1,
            precision: Precision::Half,
            wraps: Wraps::default(),
        };
        let error = Pyramid::new(layout, vec![vec![0; 31]]).unwrap_err();
        assert_eq!(error.to_string(), "level 0 should hold 32 bytes and holds 31");
        assert!(Pyramid::new(layout, vec![vec![0; 32], vec![0; 8], vec![]]).is_err());
    }
}
