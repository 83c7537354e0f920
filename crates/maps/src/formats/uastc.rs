//! UASTC LDR 4 × 4, packed for data: Basis Universal's texture format, a subset of ASTC that every device's
//! transcoder knows (Binomial, "UASTC LDR 4x4 Texture Specification").
//!
//! A block holds 16 texels in 128 bits. Five of its nineteen modes are written, those of one subset without
//! alpha that have something to give: 8, one colour; 0, 192 values an end and 16 weights; 5, 256 and 8; 18,
//! 32 and 32; 6, 160 and 4, with weights of its own for one channel. For each the principal axis of the
//! colours gives two ends, which least squares refine; the mode with the least error wins. Hints for ETC are
//! in `etc.rs`; those for BC1, which only spare a transcoder some work, are left at zero.

use glam::Vec3;
use ndfmap_core::grid::Grid;
use rayon::prelude::*;

use super::etc::{Flat, Halves};

/// Bytes of a block.
pub(super) const BLOCK_BYTES: usize = 16;

/// Colour model of KTX2's data format descriptor.
pub(super) const COLOUR_MODEL: u8 = 166;

/// Texels of a block.
pub(super) const TEXELS: usize = 16;

/// Mode that holds one colour: its code, of so many bits.
const SOLID: (u32, u32) = (0x17, 5);

/// A mode of one subset, without alpha.
struct Mode {
    code: u32,
    code_bits: u32,
    /// True where one channel has weights of its own.
    has_two_planes: bool,
    weight_bits: u32,
    end: EndCode,
    /// Values that an end may have, rising, and the code of each.
    ends: Vec<(u8, u32)>,
    /// Weights out of 64, by their codes.
    weights: Vec<i32>,
}

/// Code of an end: bits, and above them a digit of a base that is no power of two, or none.
#[derive(Clone, Copy)]
struct EndCode {
    bits: u32,
    digit: Digit,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Digit {
    None,
    Trit,
    Quint,
}

impl Digit {
    /// Base of the digit.
    fn base(self) -> u32 {
        match self {
            Self::None => 1,
            Self::Trit => 3,
            Self::Quint => 5,
        }
    }

    /// Lengths of the groups that the digits of six ends are written in, and the bits of each group.
    fn groups(self) -> &'static [(usize, u32)] {
        match self {
            Self::None => &[],
            Self::Trit => &[(5, 8), (1, 2)],
            Self::Quint => &[(3, 7), (3, 7)],
        }
    }
}

impl Mode {
    fn new(code: (u32, u32), weight_bits: u32, end: EndCode) -> Self {
        let count = end.digit.base() << end.bits;
        let mut ends: Vec<(u8, u32)> = (0..count).map(|code| (end.value(code), code)).collect();
        ends.sort_unstable();
        let weights = (0..1 << weight_bits).map(|code| weight(code, weight_bits)).collect();
        Self { code: code.0, code_bits: code.1, has_two_planes: false, weight_bits, end, ends, weights }
    }

    fn all() -> [Self; 4] {
        let plain = |bits| EndCode { bits, digit: Digit::None };
        let (trit, quint) =
            (EndCode { bits: 6, digit: Digit::Trit }, EndCode { bits: 5, digit: Digit::Quint });
        [
            Self::new((0x1, 4), 4, trit),
            Self::new((0xb, 5), 3, plain(8)),
            Self::new((0x9, 4), 5, plain(5)),
            Self { has_two_planes: true, ..Self::new((0x1b, 5), 2, quint) },
        ]
    }

    /// Index of the greatest end value at or below one.
    fn at_or_below(&self, value: f32) -> usize {
        self.ends.partition_point(|(v, _)| f32::from(*v) <= value).saturating_sub(1)
    }
}

impl EndCode {
    /// Value of an end by its code (ASTC, section "Color Endpoint Unquantization").
    fn value(self, code: u32) -> u8 {
        let low = code & ((1 << self.bits) - 1);
        let (digit, upper) = (code >> self.bits, low >> 1);
        let t = match self.digit {
            // Bits repeat to fill a byte.
            Digit::None if self.bits == 8 => return low as u8,
            Digit::None => return (low << (8 - self.bits) | low >> (2 * self.bits - 8)) as u8,
            // Six bits, fedcba: 5 D + fedcb000f.
            Digit::Trit => 5 * digit + (upper << 4 | upper >> 4),
            // Five bits, edcba: 6 D + edcb0000e.
            Digit::Quint => 6 * digit + (upper << 5 | upper >> 3),
        };
        // Flipped where a is set.
        let flip = if low & 1 == 1 { 0x1ff } else { 0 };
        (flip & 0x80 | (t ^ flip) >> 2) as u8
    }
}

/// Weight out of 64 by its code (ASTC, section "Weight Unquantization").
fn weight(code: u32, bits: u32) -> i32 {
    let six = match bits {
        2 => code << 4 | code << 2 | code,
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

/// Ends and weights of channels that share their weights, and their error.
#[derive(Clone, Copy)]
struct Plane {
    error: f32,
    /// Indices into the mode's ends, of each end and channel.
    ends: [[usize; 3]; 2],
    /// Codes of the weights.
    weights: [u8; TEXELS],
}

/// Block in a mode: a plane of all channels, and perhaps one for a channel by itself.
#[derive(Clone, Copy)]
struct Fitted {
    /// Sum of the errors as ASTC and as BC7.
    error: f32,
    mode: usize,
    plane: Plane,
    own: Option<(usize, Plane)>,
}

/// Blocks of a level, in rows, by the importance of each channel's squared error; alpha is left out, and
/// reads as opaque.
pub(super) fn pack(level: &Grid<[u8; 4]>, importance: [f32; 3]) -> Vec<u8> {
    let packer = Packer { modes: Mode::all(), importance: Vec3::from_array(importance) };
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
        packer.pack(&std::array::from_fn(texel)).to_le_bytes()
    };
    let blocks: Vec<[u8; BLOCK_BYTES]> = (0..across * down).into_par_iter().map(block).collect();
    blocks.as_flattened().to_vec()
}

/// Packer of blocks.
struct Packer {
    modes: [Mode; 4],
    /// Importance of each channel's squared error.
    importance: Vec3,
}

/// Turns of ends and weights, each fitted to the other.
const TURNS: usize = 2;

impl Packer {
    fn pack(&self, texels: &[[u8; 3]; TEXELS]) -> u128 {
        if texels.iter().all(|texel| texel == &texels[0]) {
            let mut bits = Bits::default();
            bits.put(SOLID.0, SOLID.1);
            texels[0].iter().chain(&[255]).for_each(|channel| bits.put(u32::from(*channel), 8));
            Flat::of(texels[0]).fields().into_iter().for_each(|(value, length)| bits.put(value, length));
            return bits.bits;
        }
        let colours = texels.map(|texel| Vec3::from_array(texel.map(f32::from)));
        let varies = [0, 1, 2]
            .map(|c| self.importance[c] > 0.0 && texels.iter().any(|texel| texel[c] != texels[0][c]));
        // Where one channel alone varies, one plane has more weights for it.
        let own = if varies.iter().filter(|v| **v).count() > 1 { varies } else { [false; 3] };
        let fitted = self.modes.iter().enumerate().flat_map(|(i, mode)| {
            let shared = (!mode.has_two_planes).then_some(None);
            let own = (0..3).filter(move |c| mode.has_two_planes && own[*c]).map(Some);
            shared.into_iter().chain(own).map(move |channel| (i, channel))
        });
        let fitted = fitted.map(|(i, channel)| self.fitted(&colours, i, channel));
        let best = fitted.min_by(|a, b| a.error.total_cmp(&b.error));
        best.map_or(0, |fitted| self.written(&fitted, Halves::of(texels).fields()))
    }

    /// Block in a mode, perhaps with a plane for a channel by itself.
    fn fitted(&self, colours: &[Vec3; TEXELS], mode: usize, channel: Option<usize>) -> Fitted {
        let Some(channel) = channel else {
            let plane = plane(colours, &self.modes[mode], self.importance);
            let error = plane.error + self.error_as_bc7(colours, &self.modes[mode], &plane);
            return Fitted { error, mode, plane, own: None };
        };
        let alone = Vec3::AXES[channel];
        let own = plane(colours, &self.modes[mode], self.importance * alone);
        let plane = plane(colours, &self.modes[mode], self.importance * (Vec3::ONE - alone));
        Fitted { error: 2.0 * (plane.error + own.error), mode, plane, own: Some((channel, own)) }
    }

    /// Error of a plane on desktops, whose BC7 has 16 weights at most; up to its rounding of ends, it is the
    /// same where the mode has no more.
    fn error_as_bc7(&self, colours: &[Vec3; TEXELS], mode: &Mode, plane: &Plane) -> f32 {
        if mode.weights.len() <= 16 {
            return plane.error;
        }
        let end = |k: usize| Vec3::from_array(plane.ends[k].map(|i| f32::from(mode.ends[i].0)));
        let off = |(colour, code): (&Vec3, &u8)| {
            // Weights of BC7 are sixteenths but for their rounding.
            let weight = (f32::from(*code) * 15.0 / 31.0).round() / 15.0;
            let off = end(0).lerp(end(1), weight) - *colour;
            (off * off).dot(self.importance)
        };
        colours.iter().zip(&plane.weights).map(off).sum()
    }

    /// Bits of a block with these hints.
    fn written(&self, fitted: &Fitted, hints: [(u32, u32); 6]) -> u128 {
        let mode = &self.modes[fitted.mode];
        let plane = fitted.plane.anchored(mode);
        let own = fitted.own.map(|(channel, own)| (channel, own.anchored(mode)));
        let mut bits = Bits::default();
        bits.put(mode.code, mode.code_bits);
        hints.into_iter().for_each(|(value, length)| bits.put(value, length));
        if let Some((channel, _)) = own {
            bits.put(channel as u32, 2);
        }
        let codes: [u32; 6] = std::array::from_fn(|i| {
            let (channel, end) = (i / 2, i % 2);
            let plane = own.filter(|own| own.0 == channel).map_or(plane, |own| own.1);
            mode.ends[plane.ends[end][channel]].1
        });
        let EndCode { bits: end_bits, digit } = mode.end;
        let mut digits = codes.iter().map(|code| code >> end_bits);
        for (length, group_bits) in digit.groups() {
            let group: Vec<u32> = digits.by_ref().take(*length).collect();
            bits.put(
                group.iter().rev().fold(0, |sum, digit_value| digit.base() * sum + digit_value),
                *group_bits,
            );
        }
        codes.iter().for_each(|code| bits.put(code & ((1 << end_bits) - 1), end_bits));
        for i in 0..TEXELS {
            for plane in std::iter::once(plane).chain(own.map(|own| own.1)) {
                bits.put(u32::from(plane.weights[i]), mode.weight_bits - u32::from(i == 0));
            }
        }
        bits.bits
    }
}

impl Plane {
    /// Plane of equal values whose first weight has a top bit of zero, for it is not stored.
    fn anchored(mut self, mode: &Mode) -> Self {
        if self.weights[0] >> (mode.weight_bits - 1) != 0 {
            self.ends.swap(0, 1);
            self.weights.iter_mut().for_each(|weight| *weight = (1 << mode.weight_bits) - 1 - *weight);
        }
        self
    }
}

/// Plane of the channels that have importance: ends along their principal axis, then refined.
fn plane(colours: &[Vec3; TEXELS], mode: &Mode, importance: Vec3) -> Plane {
    let wanted = ends(colours, importance);
    let start = |enclosing: bool| {
        let mut best = weighed(colours, mode, importance, &quantised(mode, &wanted, enclosing));
        for _ in 0..TURNS {
            let Some(ends) = refined(colours, mode, &best) else { break };
            let again = weighed(colours, mode, importance, &quantised(mode, &ends, false));
            if again.error >= best.error {
                break;
            }
            best = again;
        }
        best
    };
    let (nearest, enclosing) = (start(false), start(true));
    if enclosing.error < nearest.error { enclosing } else { nearest }
}

/// Ends of the colours along their principal axis, as importance stretches them.
fn ends(colours: &[Vec3; TEXELS], importance: Vec3) -> [Vec3; 2] {
    let stretch = Vec3::from_array(importance.to_array().map(f32::sqrt));
    let mean = colours.iter().sum::<Vec3>() / TEXELS as f32;
    let mut covariance = glam::Mat3::ZERO;
    for colour in colours {
        let d = (colour - mean) * stretch;
        covariance += glam::Mat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    // Power iteration; half a dozen turns are enough for ends that are rounded afterwards.
    // The longest column is never at right angles to the axis.
    let columns = [covariance.x_axis, covariance.y_axis, covariance.z_axis];
    let longest = |a: Vec3, b: Vec3| if b.length_squared() > a.length_squared() { b } else { a };
    let mut axis = columns.into_iter().fold(Vec3::ZERO, longest);
    for _ in 0..6 {
        axis = (covariance * axis).normalize_or(axis);
    }
    let axis = axis.normalize_or(Vec3::ONE);
    let along = colours.map(|colour| ((colour - mean) * stretch).dot(axis));
    let low = along.iter().copied().fold(f32::INFINITY, f32::min);
    let high = along.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    // Channels follow the axis by regression, those of no importance too.
    let square: f32 = along.iter().map(|t| t * t).sum();
    let slope = colours.iter().zip(along).map(|(colour, t)| (colour - mean) * t).sum::<Vec3>()
        / square.max(f32::MIN_POSITIVE);
    [low, high].map(|t| (mean + t * slope).clamp(Vec3::ZERO, Vec3::splat(255.0)))
}

/// Ends with the least squared error under the weights of a plane; none where they are all alike.
fn refined(colours: &[Vec3; TEXELS], mode: &Mode, plane: &Plane) -> Option<[Vec3; 2]> {
    let (mut low, mut high, mut cross) = (0.0, 0.0, 0.0);
    let mut sums = [Vec3::ZERO; 2];
    for (colour, code) in colours.iter().zip(&plane.weights) {
        let t = mode.weights[usize::from(*code)] as f32 / 64.0;
        low += (1.0 - t) * (1.0 - t);
        high += t * t;
        cross += t * (1.0 - t);
        sums[0] += (1.0 - t) * *colour;
        sums[1] += t * *colour;
    }
    let determinant: f32 = low * high - cross * cross;
    if determinant < 1e-3 {
        return None;
    }
    let ends = [high * sums[0] - cross * sums[1], low * sums[1] - cross * sums[0]];
    Some(ends.map(|end| (end / determinant).clamp(Vec3::ZERO, Vec3::splat(255.0))))
}

/// Indices of the mode's ends that are nearest to wanted ones, or enclose them.
fn quantised(mode: &Mode, wanted: &[Vec3; 2], enclosing: bool) -> [[usize; 3]; 2] {
    std::array::from_fn(|k| {
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
    })
}

/// Plane of these ends, with the weight of each texel that is nearest to it.
fn weighed(colours: &[Vec3; TEXELS], mode: &Mode, importance: Vec3, ends: &[[usize; 3]; 2]) -> Plane {
    let value = |k: usize, c: usize| mode.ends[ends[k][c]].0;
    let of_weight = |weight: i32| {
        Vec3::from_array(std::array::from_fn(|c| between(value(0, c), value(1, c), weight) as f32))
    };
    // As many as the mode with most weights has.
    let mut palette = [Vec3::ZERO; 32];
    for (entry, weight) in palette.iter_mut().zip(&mode.weights) {
        *entry = of_weight(*weight);
    }
    let palette = &palette[..mode.weights.len()];
    let mut plane = Plane { error: 0.0, ends: *ends, weights: [0; TEXELS] };
    for (code, colour) in plane.weights.iter_mut().zip(colours) {
        let mut nearest = (f32::INFINITY, 0);
        for (i, entry) in palette.iter().enumerate() {
            let off = *entry - *colour;
            let off = (off * off).dot(importance);
            if off < nearest.0 {
                nearest = (off, i);
            }
        }
        plane.error += nearest.0;
        *code = nearest.1 as u8;
    }
    plane
}
