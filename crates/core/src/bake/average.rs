//! Sums of a level in single floats, and their averages on the next level.

use fearless_simd::{Level, dispatch};

use crate::grid::Size;
use crate::pyramid::footprint;

/// Sums of one level in single floats: layers one after another, each rows of RGBA texels.
#[derive(Clone)]
pub(super) struct Sums {
    pub(super) size: Size,
    pub(super) layers: usize,
    pub(super) values: Vec<f32>,
}

impl Sums {
    pub(super) fn zero(size: Size, layers: usize) -> Self {
        Self { size, layers, values: vec![0.0; size.area() * 4 * layers] }
    }
}

/// Gathers row `y` of every layer of `rows` × `width` RGBA texels, layer after layer.
pub(super) fn copy_row(sums: &[f32], (rows, width): (usize, usize), y: usize, out: &mut [f32]) {
    let length = width * 4;
    for (layer, out) in sums.chunks_exact(rows * length).zip(out.chunks_exact_mut(length)) {
        out.copy_from_slice(&layer[y * length..][..length]);
    }
}

/// Averages two by two, in every layer of `rows` × `width` RGBA texels.
pub(super) fn halve(sums: &[f32], (rows, width): (usize, usize), out: &mut Vec<f32>) {
    out.clear();
    out.resize(sums.len() / 4, 0.0);
    let averager = RowAverager::new(width, width / 2);
    for (two, out) in sums.chunks_exact(rows * width * 4).zip(out.chunks_exact_mut(rows * width)) {
        for (two, out) in two.chunks_exact(width * 8).zip(out.chunks_exact_mut(width * 2)) {
            averager.add(&two[..width * 4], 0.5, out);
            averager.add(&two[width * 4..], 0.5, out);
        }
    }
}

/// Averages rows of RGBA texels from `fine` to `coarse` texels.
pub(super) struct RowAverager {
    /// For each coarse texel its first fine one and the weights from there on; empty when pairs nest.
    taps: Vec<(usize, Vec<f32>)>,
}

impl RowAverager {
    pub(super) fn new(fine: usize, coarse: usize) -> Self {
        let tap = |i| {
            let (range, weight) = footprint(fine, coarse, i);
            (range.start, range.map(|j| weight(j) as f32).collect())
        };
        let taps = if fine == 2 * coarse { Vec::new() } else { (0..coarse).map(tap).collect() };
        Self { taps }
    }

    /// Adds `weight` times the averaged row to `out`.
    pub(super) fn add(&self, finer: &[f32], weight: f32, out: &mut [f32]) {
        let out = out.as_chunks_mut::<4>().0;
        if self.taps.is_empty() {
            // The same additions in the same order at every SIMD level, so the same bits.
            dispatch!(Level::new(), _simd => add_pairs(finer, 0.5 * weight, out));
            return;
        }
        let finer = finer.as_chunks::<4>().0;
        for (o, (first, weights)) in out.iter_mut().zip(&self.taps) {
            for (texel, w) in finer[*first..].iter().zip(weights) {
                for c in 0..4 {
                    o[c] += weight * w * texel[c];
                }
            }
        }
    }
}

#[inline(always)]
pub(super) fn add_pairs(finer: &[f32], weight: f32, out: &mut [[f32; 4]]) {
    for (o, pair) in out.iter_mut().zip(finer.as_chunks::<8>().0) {
        for c in 0..4 {
            o[c] += weight * (pair[c] + pair[c + 4]);
        }
    }
}
