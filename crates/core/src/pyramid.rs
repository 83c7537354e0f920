//! Mip pyramids: sizes of the levels, the area each texel covers, and storage.
//!
//! Level `l` is `max(1, size >> l)` texels a side, as graphics APIs have it. Texel `i` of a level with
//! `w` texels covers exactly `[i W/w, (i+1) W/w)` of the `W` finest texels, so where sizes are not
//! powers of two the fine texels at its border count by the fraction inside ("polyphase" box filter).

use std::ops::Range;

use fearless_simd::{Level, dispatch};
use half::f16;
use half::slice::HalfFloatSliceExt;

use crate::grid::Size;
use crate::surface::Wraps;

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
                    // Bytes that are not aligned for 16-bit stores go by way of the stack.
                    Err(_) => {
                        let mut chunk = [f16::ZERO; 256];
                        for (part, place) in values.chunks(256).zip(out.chunks_mut(512)) {
                            chunk[..part.len()].convert_from_f32_slice(part);
                            place.copy_from_slice(bytemuck::cast_slice(&chunk[..part.len()]));
                        }
                    }
                }
                // Rounding to nearest reaches infinity from 65520 on. Counting is for the rare case: a
                // running maximum of the stored magnitudes, which order as their bits do, costs next to
                // nothing.
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

/// Error of levels whose byte counts do not fit the sizes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("level {level} should hold {expected} bytes and holds {found}")]
pub struct LevelMismatch {
    level: usize,
    expected: usize,
    found: usize,
}

/// Layout of a [`Pyramid`]: everything but its levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// Size of level 0.
    pub size: Size,
    /// RGBA layers.
    pub layers: usize,
    /// Bits of a channel.
    pub precision: Precision,
    /// Wrap of each axis, beyond the edges.
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

    /// Returns it with its first layers alone, as a method of fewer layers reads it.
    #[must_use]
    pub fn first_layers(&self, layers: usize) -> Self {
        let layers = layers.min(self.layers);
        let layout = Layout { layers, ..self.layout() };
        let first = |(size, bytes): (&Size, &Vec<u8>)| bytes[..layout.layer_bytes(*size) * layers].to_vec();
        let levels = self.sizes.iter().zip(&self.levels).map(first).collect();
        Self { layers, levels, sizes: self.sizes.clone(), ..*self }
    }

    /// Returns it without levels finer than this one; there may be none left.
    #[must_use]
    pub fn from_level(mut self, level: usize) -> Self {
        let finer = level.min(self.levels.len());
        self.levels.drain(..finer);
        self.sizes.drain(..finer);
        self
    }

    /// Size of the finest level, layers, precision and wraps.
    #[must_use]
    pub fn layout(&self) -> Layout {
        let size = self.sizes.first().copied().unwrap_or(Size { width: 0, height: 0 });
        Layout { size, layers: self.layers, precision: self.precision, wraps: self.wraps }
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

    /// Wrap of each axis, beyond the edges.
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
}

#[cfg(test)]
mod tests {
    use super::*;

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
