//! UASTC LDR 4 × 4, packed for data: Basis Universal's texture format, a subset of ASTC that every device's
//! transcoder knows (Binomial, "UASTC LDR 4x4 Texture Specification").
//!
//! A block holds 16 texels in 128 bits. Four of its nineteen modes are written, those of one subset and one
//! plane: 8, one colour; 0, 192 values an end and 16 weights; 5, 256 and 8; 18, 32 and 32. For each the
//! principal axis of the colours gives two ends; the mode with the least squared error wins. Hints for ETC
//! and BC1, which are only for those who transcode to them, are left at zero.

use ndfmap_core::grid::Grid;
use rayon::prelude::*;

/// Bytes of a block.
pub(super) const BLOCK_BYTES: usize = 16;

/// Colour model of KTX2's data format descriptor.
pub(super) const COLOUR_MODEL: u8 = 166;

/// Texels of a block.
const TEXELS: usize = 16;

/// Mode that holds one colour: its code, of so many bits.
const SOLID: (u32, u32) = (0x17, 5);

/// Bits of the hints.
const HINTS: u32 = 15;

/// A mode of one subset and one plane, without alpha.
struct Mode {
    code: u32,
    code_bits: u32,
    weight_bits: u32,
    /// Bits of an end's value below its trit, if it has one.
    end_bits: u32,
    has_trit: bool,
    /// Values that an end may have, rising, and the code of each.
    ends: Vec<(u8, u32)>,
    /// Weights out of 64, by their codes.
    weights: Vec<i32>,
}

impl Mode {
    fn new(code: (u32, u32), weight_bits: u32, (end_bits, has_trit): (u32, bool)) -> Self {
        let count = if has_trit { 3 << end_bits } else { 1 << end_bits };
        let mut ends: Vec<(u8, u32)> = (0..count).map(|code| (end(code, end_bits, has_trit), code)).collect();
        ends.sort_unstable();
        let weights = (0..1 << weight_bits).map(|code| weight(code, weight_bits)).collect();
        Self { code: code.0, code_bits: code.1, weight_bits, end_bits, has_trit, ends, weights }
    }

    fn all() -> [Self; 3] {
        [
            Self::new((0x1, 4), 4, (6, true)),
            Self::new((0xb, 5), 3, (8, false)),
            Self::new((0x9, 4), 5, (5, false)),
        ]
    }

    /// Index of the greatest end value at or below one.
    fn at_or_below(&self, value: f32) -> usize {
        self.ends.partition_point(|(v, _)| f32::from(*v) <= value).saturating_sub(1)
    }
}

/// Value of an end by its code (ASTC, section "Color Endpoint Unquantization").
fn end(code: u32, bits: u32, has_trit: bool) -> u8 {
    let low = code & ((1 << bits) - 1);
    if !has_trit {
        // Bits repeat to fill a byte.
        return if bits == 8 { low as u8 } else { (low << (8 - bits) | low >> (2 * bits - 8)) as u8 };
    }
    // Six bits, fedcba, and a trit: T = 5 D + fedcb000f, flipped where a is set.
    let trit = code >> bits;
    let upper = low >> 1;
    let t = 5 * trit + (upper << 4 | upper >> 4);
    let flip = if low & 1 == 1 { 0x1ff } else { 0 };
    let t = t ^ flip;
    (flip & 0x80 | t >> 2) as u8
}

/// Weight out of 64 by its code (ASTC, section "Weight Unquantization").
fn weight(code: u32, bits: u32) -> i32 {
    let six = match bits {
        3 => code << 3 | code,
        4 => code << 2 | code >> 2,
        _ => code << 1 | code >> 4,
    };
    (if six > 32 { six + 1 } else { six }) as i32
}

/// Value between two ends (ASTC, section "Weight Application", without sRGB).
fn between(low: u8, high: u8, weight: i32) -> i32 {
    let wide = |v: u8| i32::from(v) << 8 | i32::from(v);
    ((wide(low) * (64 - weight) + wide(high) * weight + 32) >> 6) >> 8
}

/// Bits of a block, lowest first.
#[derive(Default)]
struct Bits {
    bits: u128,
    count: u32,
}

impl Bits {
    fn put(&mut self, value: u32, bits: u32) {
        self.bits |= u128::from(value) << self.count;
        self.count += bits;
    }
}

/// Ends and weights of a block in a mode, and their squared error.
#[derive(Clone, Copy)]
struct Fitted {
    error: u32,
    mode: usize,
    /// Indices into the mode's ends, of each end and channel.
    ends: [[usize; 3]; 2],
    /// Codes of the weights.
    weights: [u8; TEXELS],
}

/// Blocks of a level, in rows; alpha is left out, and reads as opaque.
pub(super) fn pack(level: &Grid<[u8; 4]>) -> Vec<u8> {
    let modes = Mode::all();
    let size = level.size();
    let (across, down) = (size.width.div_ceil(4), size.height.div_ceil(4));
    let block = |i: usize| {
        let texel = |t: usize| {
            // Edges repeat in blocks that reach beyond them.
            let x = (i % across * 4 + t % 4).min(size.width - 1);
            let y = (i / across * 4 + t / 4).min(size.height - 1);
            let [r, g, b, _] = level.row(y)[x];
            [r, g, b]
        };
        pack_block(&std::array::from_fn(texel), &modes).to_le_bytes()
    };
    let blocks: Vec<[u8; BLOCK_BYTES]> = (0..across * down).into_par_iter().map(block).collect();
    blocks.as_flattened().to_vec()
}

fn pack_block(texels: &[[u8; 3]; TEXELS], modes: &[Mode]) -> u128 {
    if texels.iter().all(|texel| texel == &texels[0]) {
        let mut bits = Bits::default();
        bits.put(SOLID.0, SOLID.1);
        texels[0].iter().chain(&[255]).for_each(|channel| bits.put(u32::from(*channel), 8));
        return bits.bits;
    }
    let ends = ends_of(texels);
    let mut best: Option<Fitted> = None;
    for mode in modes.iter().enumerate() {
        for enclosing in [false, true] {
            let fitted = fitted(texels, mode, &ends, enclosing);
            if best.is_none_or(|best| fitted.error < best.error) {
                best = Some(fitted);
            }
        }
    }
    best.map_or(0, |fitted| written(fitted, modes))
}

/// Ends of the colours along their principal axis.
fn ends_of(texels: &[[u8; 3]; TEXELS]) -> [[f32; 3]; 2] {
    let colours = texels.map(|texel| glam::Vec3::from_array(texel.map(f32::from)));
    let mean = colours.iter().sum::<glam::Vec3>() / TEXELS as f32;
    let mut covariance = glam::Mat3::ZERO;
    for colour in colours {
        let d = colour - mean;
        covariance += glam::Mat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    // Power iteration; half a dozen turns are enough for ends that are rounded afterwards.
    let mut axis = glam::Vec3::new(covariance.x_axis.x, covariance.y_axis.y, covariance.z_axis.z);
    for _ in 0..6 {
        axis = (covariance * axis).normalize_or(axis);
    }
    let axis = axis.normalize_or(glam::Vec3::ONE);
    let along = colours.map(|colour| (colour - mean).dot(axis));
    let low = along.iter().copied().fold(f32::INFINITY, f32::min);
    let high = along.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    [low, high].map(|t| (mean + t * axis).clamp(glam::Vec3::ZERO, glam::Vec3::splat(255.0)).to_array())
}

fn fitted(
    texels: &[[u8; 3]; TEXELS],
    (index, mode): (usize, &Mode),
    wanted: &[[f32; 3]; 2],
    enclosing: bool,
) -> Fitted {
    let ends: [[usize; 3]; 2] = std::array::from_fn(|k| {
        std::array::from_fn(|c| {
            let value = wanted[k][c];
            let below = mode.at_or_below(value);
            let above = (below + 1).min(mode.ends.len() - 1);
            let (low, high) = (f32::from(mode.ends[below].0), f32::from(mode.ends[above].0));
            if !enclosing {
                return if value - low <= high - value { below } else { above };
            }
            let is_lower = (wanted[0][c] <= wanted[1][c]) == (k == 0);
            if is_lower || low >= value { below } else { above }
        })
    });
    let value = |k: usize, c: usize| mode.ends[ends[k][c]].0;
    let palette: Vec<[i32; 3]> = mode
        .weights
        .iter()
        .map(|weight| std::array::from_fn(|c| between(value(0, c), value(1, c), *weight)))
        .collect();
    let mut weights = [0; TEXELS];
    let mut error = 0;
    for (code, texel) in weights.iter_mut().zip(texels) {
        let off = |entry: &[i32; 3]| -> u32 {
            entry.iter().zip(texel).map(|(a, b)| (a - i32::from(*b)).pow(2) as u32).sum()
        };
        let mut nearest = (u32::MAX, 0);
        for (i, entry) in palette.iter().enumerate() {
            nearest = nearest.min((off(entry), i));
        }
        error += nearest.0;
        *code = nearest.1 as u8;
    }
    Fitted { error, mode: index, ends, weights }
}

/// Bits of a block.
fn written(fitted: Fitted, modes: &[Mode]) -> u128 {
    let Fitted { mut ends, mut weights, .. } = fitted;
    let mode = &modes[fitted.mode];
    // The top bit of the first weight is not stored: it is zero.
    if weights[0] >> (mode.weight_bits - 1) != 0 {
        ends.swap(0, 1);
        weights.iter_mut().for_each(|weight| *weight = (1 << mode.weight_bits) - 1 - *weight);
    }
    let mut bits = Bits::default();
    bits.put(mode.code, mode.code_bits);
    bits.put(0, HINTS);
    let codes: [u32; 6] = std::array::from_fn(|i| mode.ends[ends[i % 2][i / 2]].1);
    if mode.has_trit {
        // Five trits in a byte, the sixth in two bits.
        let trit = |i: usize| codes[i] >> mode.end_bits;
        bits.put((0..5).rev().fold(0, |sum, i| 3 * sum + trit(i)), 8);
        bits.put(trit(5), 2);
    }
    codes.iter().for_each(|code| bits.put(code & ((1 << mode.end_bits) - 1), mode.end_bits));
    for (i, weight) in weights.iter().enumerate() {
        bits.put(u32::from(*weight), mode.weight_bits - u32::from(i == 0));
    }
    bits.bits
}
