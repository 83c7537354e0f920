//! Compact storage: channels as integers of 8, 10 or 16 bits, each channel in a range of its own.
//!
//! A stored integer `q` stands for `low + (high - low) q / (2^bits - 1)`. That is affine, so a texture unit
//! may filter integers, as unorm, and a shader takes the filtered ones to their range: the sums come out as
//! if they had been filtered themselves. Ranges are those that the map's values fill, level after level the
//! same, since filters mix levels.
//!
//! Sums of a lobe are multiples of its weight. They are rounded last, as multiples of the weight that was
//! rounded: so a faint lobe keeps its direction and its width, and only its weight is off.

use std::fmt::{self, Display};
use std::str::FromStr;

use rayon::prelude::*;

use crate::fit::LobeKind;
use crate::ndf::{Encoding, LobeLayout};
use crate::pyramid::{Layout, Precision, Pyramid};
use crate::words;
use crate::words::UnknownWord;

/// Bits of an integer channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bits {
    /// 8 bits, four channels in a word: a layer of RGBA8 each layer.
    Eight,
    /// 10 bits, three channels in a word, in layers of their own.
    Ten,
    /// 16 bits, four channels in two words.
    Sixteen,
}

words!(Bits { Eight => "unorm8", Ten => "unorm10", Sixteen => "unorm16" });

impl Bits {
    /// Number of bits of a channel.
    #[must_use]
    pub fn count(self) -> u32 {
        u16::BITS - self.most().leading_zeros()
    }

    /// Greatest integer of a channel.
    #[must_use]
    pub fn most(self) -> u16 {
        match self {
            Self::Eight => 0xff,
            Self::Ten => 0x3ff,
            Self::Sixteen => 0xffff,
        }
    }

    /// Share of a lobe's sums that may lie beyond either end of their range.
    ///
    /// With 8 bits, `vmf:4` at exponent 50 had on ten maps, at texels, 1.29 times the error of half floats
    /// with all within, 1.23 with 0.0001 outside, 1.18 with 0.0005 and 1.20 with 0.003, which cost rare
    /// scratches twice. With 10 bits it had 1.03 with all within, and 1.03 with 0.0005 outside.
    #[must_use]
    pub fn outside(self) -> f64 {
        if self == Self::Eight { 5e-4 } else { 0.0 }
    }

    /// Channels that a texel of a stored layer holds.
    #[must_use]
    pub fn channels(self) -> usize {
        if self == Self::Ten { 3 } else { 4 }
    }

    /// Stored layers for RGBA layers of floats.
    #[must_use]
    pub fn layers(self, layers: usize) -> usize {
        (4 * layers).div_ceil(self.channels())
    }

    /// Bytes of a texel of a stored layer.
    #[must_use]
    pub fn texel_bytes(self) -> usize {
        if self == Self::Sixteen { 8 } else { 4 }
    }

    /// Writes the channels of a texel of a stored layer, little-endian; the two bits that ten leave are set,
    /// as alpha is.
    pub fn pack(self, channels: &[u16], out: &mut Vec<u8>) {
        match self {
            Self::Eight => out.extend(channels.iter().map(|q| *q as u8)),
            Self::Sixteen => out.extend(channels.iter().flat_map(|q| q.to_le_bytes())),
            Self::Ten => {
                let word = channels.iter().rev().fold(3, |word: u32, q| word << 10 | u32::from(*q));
                out.extend(word.to_le_bytes());
            }
        }
    }

    /// Reads the channels of a texel of a stored layer.
    #[must_use]
    pub fn unpack(self, bytes: &[u8]) -> [u16; 4] {
        let byte = |i: usize| bytes.get(i).copied().unwrap_or_default();
        match self {
            Self::Eight => std::array::from_fn(|i| u16::from(byte(i))),
            Self::Sixteen => std::array::from_fn(|i| u16::from_le_bytes([byte(2 * i), byte(2 * i + 1)])),
            Self::Ten => {
                let word = u32::from_le_bytes(std::array::from_fn(byte));
                [0, 10, 20, 30].map(|shift| (word >> shift & 0x3ff) as u16)
            }
        }
    }
}

/// Storage of a map's channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// Floats.
    Float(Precision),
    /// Integers, each channel in a range of its own.
    Compact(Bits),
}

impl Default for Storage {
    fn default() -> Self {
        Self::Float(Precision::Half)
    }
}

impl From<Precision> for Storage {
    fn from(precision: Precision) -> Self {
        Self::Float(precision)
    }
}

impl Storage {
    /// Every storage: floats first.
    pub const ALL: [Self; 5] = [
        Self::Float(Precision::Half),
        Self::Float(Precision::Single),
        Self::Compact(Bits::Eight),
        Self::Compact(Bits::Ten),
        Self::Compact(Bits::Sixteen),
    ];

    /// Bytes of all channels of a texel, for so many RGBA layers of floats.
    #[must_use]
    pub fn texel_bytes(self, layers: usize) -> usize {
        match self {
            Self::Float(precision) => layers * precision.texel_bytes(),
            Self::Compact(bits) => bits.layers(layers) * bits.texel_bytes(),
        }
    }

    /// Precision that a map is baked in, before its ranges are known.
    #[must_use]
    pub fn baked(self) -> Precision {
        match self {
            Self::Float(precision) => precision,
            Self::Compact(_) => Precision::Single,
        }
    }

    /// A map that was baked in [`Self::baked`], as this storage tells it.
    #[must_use]
    pub fn stored(self, pyramid: Pyramid, encoding: Encoding) -> Pyramid {
        match self {
            Self::Float(_) => pyramid,
            Self::Compact(bits) => Compact::of(bits, &pyramid, encoding).rounded(&pyramid),
        }
    }

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Float(Precision::Half) => "half",
            Self::Float(Precision::Single) => "single",
            Self::Compact(bits) => bits.name(),
        }
    }
}

impl FromStr for Storage {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        Self::ALL.into_iter().find(|storage| storage.name().eq_ignore_ascii_case(word)).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            UnknownWord { word: word.to_owned(), known }
        })
    }
}

impl Display for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Range of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Value of 0.
    pub low: f32,
    /// Value of the greatest integer, at least `low`.
    pub high: f32,
}

impl Range {
    /// Range of nothing yet.
    const EMPTY: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY };

    /// True for a range that values can be taken to.
    #[must_use]
    pub fn is_sound(self) -> bool {
        self.low.is_finite() && (self.high - self.low).is_finite() && self.low <= self.high
    }
}

/// Ranges of all channels that a map fills, while it is looked through.
#[derive(Clone, Debug)]
pub struct Extent(Vec<Range>);

impl Extent {
    /// Extent of no texels, for so many RGBA layers.
    #[must_use]
    pub fn new(layers: usize) -> Self {
        Self(vec![Range::EMPTY; 4 * layers])
    }

    /// Takes texels of a layer in.
    pub fn add(&mut self, layer: usize, texels: &[f32]) {
        for texel in texels.as_chunks::<4>().0 {
            for (range, value) in self.0[4 * layer..][..4].iter_mut().zip(texel) {
                *range = Range { low: range.low.min(*value), high: range.high.max(*value) };
            }
        }
    }

    /// Ranges of the channels; that of 0 where nothing was taken in, or what is no number.
    fn ranges(&self) -> Vec<Range> {
        // A zero has one sign, whichever came first.
        let plain = |range: &Range| Range { low: range.low + 0.0, high: range.high + 0.0 };
        let sound =
            |range: &Range| if range.is_sound() { plain(range) } else { Range { low: 0.0, high: 0.0 } };
        self.0.iter().map(sound).collect()
    }
}

/// Spread of the values of each channel over its extent, by which its range is chosen.
#[derive(Clone, Debug)]
pub struct Spread {
    extent: Extent,
    /// Values in each of [`BINS`] equal parts of each channel's extent.
    counts: Vec<Vec<u64>>,
}

/// Parts of an extent that are told apart.
const BINS: usize = 4096;

impl Spread {
    /// Spread of no texels, over an extent that holds all that are to come.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        let counts = vec![vec![0; BINS]; extent.0.len()];
        Self { extent, counts }
    }

    /// Takes texels of a layer in.
    pub fn add(&mut self, layer: usize, texels: &[f32]) {
        for texel in texels.as_chunks::<4>().0 {
            for (c, value) in (4 * layer..).zip(texel) {
                let Range { low, high } = self.extent.0[c];
                let part = f64::from(value - low) / f64::from(high - low);
                // Where all values are one, that is no number, and the first part is as good as any.
                self.counts[c][((part * BINS as f64) as usize).min(BINS - 1)] += 1;
            }
        }
    }

    /// Range of a channel with this share of its values beyond either end, and 0 within.
    fn within(&self, channel: usize, outside: f64) -> Range {
        let (counts, Range { low, high }) = (&self.counts[channel], self.extent.ranges()[channel]);
        let most = (counts.iter().sum::<u64>() as f64 * outside) as u64;
        let cut = |counts: &mut dyn Iterator<Item = &u64>| {
            let mut gone = 0;
            counts
                .take_while(|count| {
                    gone += **count;
                    gone <= most
                })
                .count()
        };
        let (below, above) = (cut(&mut counts.iter()), cut(&mut counts.iter().rev()));
        let step = (f64::from(high) - f64::from(low)) / BINS as f64;
        Range {
            low: ((f64::from(low) + step * below as f64) as f32).min(0.0) + 0.0,
            high: ((f64::from(high) - step * above as f64) as f32).max(0.0) + 0.0,
        }
    }
}

/// Compact form of a map: bits, and the range of each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Compact {
    bits: Bits,
    ranges: Vec<Range>,
    /// Layout of the lobes, for channels that are sums of lobes, each a multiple of its lobe's weight.
    lobes: Option<LobeLayout>,
}

impl Compact {
    /// Form of so many bits for the channels of an encoding, with attributes behind them where there are
    /// more ranges than its own layers have.
    #[must_use]
    pub fn new(bits: Bits, ranges: Vec<Range>, encoding: Encoding) -> Self {
        // A mean normal has no weight before it: it is a lobe whose weight is 1, and not stored. Peaks have
        // exponents, which are no sums.
        let sums = matches!(encoding, Encoding::Lobes { kind, .. } if kind != LobeKind::Peaks);
        Self { bits, ranges, lobes: encoding.lobes().filter(|_| sums) }
    }

    /// Form for channels that are spread so.
    ///
    /// Sums of lobes reach far beyond most of their values where a few texels are steep. Where bits are few,
    /// the outermost values on either side lie beyond the range, and their lobes lose weight instead
    /// ([`Bits::outside`]).
    #[must_use]
    pub fn of_spread(bits: Bits, spread: &Spread, encoding: Encoding) -> Self {
        let mut own = Self::new(bits, spread.extent.ranges(), encoding);
        if own.lobes.is_some() {
            let sums = own.lobes.map_or(0, |lobes| 4 * lobes.layers(0));
            let range = |c: usize| match own.ranges[c] {
                // A lobe can lose all of its weight, also one that never does.
                Range { low, high } if own.lobe_of(c).start == c => Range { low: low.min(0.0), high },
                // What lobes carry besides does not make them lose any.
                whole if c >= sums => whole,
                _ => spread.within(c, bits.outside()),
            };
            own.ranges = (0..own.ranges.len()).map(range).collect();
        }
        own
    }

    /// Form for a map in memory.
    #[must_use]
    pub fn of(bits: Bits, pyramid: &Pyramid, encoding: Encoding) -> Self {
        let layers = pyramid.layers();
        let mut extent = Extent::new(layers);
        layers_of(pyramid, |layer, values| extent.add(layer, values));
        let mut spread = Spread::new(extent);
        layers_of(pyramid, |layer, values| spread.add(layer, values));
        Self::of_spread(bits, &spread, encoding)
    }

    /// Bits of a channel.
    #[must_use]
    pub fn bits(&self) -> Bits {
        self.bits
    }

    /// Ranges of the channels, four a layer.
    #[must_use]
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// Integer nearest to a value of a channel.
    fn nearest(&self, channel: usize, value: f32) -> u16 {
        let Range { low, high } = self.ranges[channel];
        if high <= low {
            return 0;
        }
        let share = (f64::from(value) - f64::from(low)) / (f64::from(high) - f64::from(low));
        // A value that is none becomes the lowest.
        (share.clamp(0.0, 1.0) * f64::from(self.bits.most())).round() as u16
    }

    /// Value that an integer of a channel stands for.
    #[must_use]
    pub fn value(&self, channel: usize, stored: u16) -> f32 {
        let Range { low, high } = self.ranges[channel];
        let share = f64::from(stored) / f64::from(self.bits.most());
        (f64::from(low) + (f64::from(high) - f64::from(low)) * share) as f32
    }

    /// Channels of the lobe that a channel belongs to, its weight first; none where channels are no sums of
    /// lobes.
    #[must_use]
    pub fn lobe_of(&self, channel: usize) -> std::ops::Range<usize> {
        let Some(lobes) = self.lobes else { return 0..0 };
        let (each, own) = (4 * lobes.layers_each, 4 * lobes.layers(0));
        // An attribute fills a layer a lobe, behind all lobes.
        let lobe = if channel < own { channel / each } else { (channel - own) / 4 % lobes.count };
        lobe * each..(lobe + 1) * each
    }

    /// Integer of a channel of a texel whose channels have these values.
    #[must_use]
    pub fn round(&self, channel: usize, of: impl Fn(usize) -> f32) -> u16 {
        let lobe = self.lobe_of(channel);
        let weight = if lobe.is_empty() { 0.0 } else { of(lobe.start) };
        if weight <= 0.0 {
            return self.nearest(channel, of(channel));
        }
        // A lobe beyond the ranges loses weight until it is within; what it was the others are then.
        let share = |c: usize| {
            let (value, Range { low, high }) = (of(c), self.ranges[c]);
            let edge = if value > high { high } else { low };
            if value > high || value < low { (edge / value).clamp(0.0, 1.0) } else { 1.0 }
        };
        let within = weight * lobe.clone().map(share).fold(1.0, f32::min);
        let stored = self.nearest(lobe.start, within);
        if channel == lobe.start {
            return stored;
        }
        self.nearest(channel, of(channel) * (self.value(lobe.start, stored) / weight))
    }

    /// The map as its integers tell it, in single precision.
    #[must_use]
    pub fn rounded(&self, pyramid: &Pyramid) -> Pyramid {
        let layout = Layout { precision: Precision::Single, ..pyramid.layout() };
        let of_level = |(level, size): (usize, &crate::grid::Size)| {
            let area = size.area();
            let mut values = Vec::new();
            pyramid.precision().unpack(pyramid.level_bytes(level), &mut values);
            let mut texel = vec![0.0; self.ranges.len()];
            for i in 0..area {
                let at = |channel: usize| (channel / 4 * area + i) * 4 + channel % 4;
                texel.iter_mut().enumerate().for_each(|(channel, v)| *v = values[at(channel)]);
                for channel in 0..texel.len() {
                    values[at(channel)] = self.value(channel, self.round(channel, |c| texel[c]));
                }
            }
            let mut bytes = Vec::new();
            Precision::Single.pack(&values, &mut bytes);
            bytes
        };
        let levels = pyramid.sizes().par_iter().enumerate().map(of_level).collect();
        Pyramid::new(layout, levels).unwrap_or_else(|e| unreachable!("the same sizes: {e}"))
    }
}

/// Hands out the values of every layer of every level.
fn layers_of(pyramid: &Pyramid, mut each: impl FnMut(usize, &[f32])) {
    for level in 0..pyramid.sizes().len() {
        let bytes = pyramid.level_bytes(level);
        for (layer, bytes) in bytes.chunks(bytes.len() / pyramid.layers()).enumerate() {
            let mut values = Vec::new();
            pyramid.precision().unpack(bytes, &mut values);
            each(layer, &values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ndf::StoredSums;

    const TWO_LOBES: Encoding =
        Encoding::Lobes { kind: LobeKind::Spherical, count: 2, sums: StoredSums::AboutPole };

    fn rounded(compact: &Compact, texel: &[f32]) -> Vec<u16> {
        (0..texel.len()).map(|channel| compact.round(channel, |c| texel[c])).collect()
    }

    #[test]
    fn integers_are_packed_and_come_back() {
        for bits in Bits::ALL {
            let channels: Vec<u16> = [1, 2, 3, 5].map(|k| bits.most() / k)[..bits.channels()].to_vec();
            let mut bytes = Vec::new();
            bits.pack(&channels, &mut bytes);
            assert_eq!(bytes.len(), bits.texel_bytes());
            assert_eq!(bits.unpack(&bytes)[..bits.channels()], channels);
        }
        // Red in the lowest bits, as A2B10G10R10 has it.
        let mut word = Vec::new();
        Bits::Ten.pack(&[1, 0, 0], &mut word);
        assert_eq!(word, [1, 0, 0, 0xc0]);
        assert_eq!((Bits::Ten.layers(4), Bits::Eight.layers(4)), (6, 4));
    }

    #[test]
    fn a_faint_lobe_keeps_its_direction() {
        let range = Range { low: 0.0, high: 1.0 };
        let compact = Compact::new(Bits::Eight, vec![range; 8], TWO_LOBES);
        let (alpha, r) = (1.6_f32 / 255.0, [0.9, 0.2, 0.4]);
        let texel = [1.0 - alpha, 0.0, 0.0, 0.0, alpha, alpha * r[0], alpha * r[1], alpha * r[2]];
        let stored = rounded(&compact, &texel);
        // 1.6 steps become 2, and 0.9 of two steps 2 again. By itself it is 1.44 steps, which would be 1:
        // half of the weight, where nine tenths are due.
        assert_eq!(stored[4..], [2, 2, 0, 1]);
        assert_eq!(compact.value(4, 2), 2.0 / 255.0);
    }

    #[test]
    fn a_steep_lobe_loses_weight_and_keeps_what_it_is() {
        // Ten thousand texels with x up to 0.1, and one with 0.8: it lies beyond the range.
        const STEEP: usize = 10_000;
        let texel =
            |i: usize| if i == STEEP { [1.0, 0.8, 0.0, 0.4] } else { [1.0, i as f32 * 1e-5, 0.0, 0.2] };
        let values: Vec<f32> = (0..=STEEP).flat_map(texel).collect();
        let mut extent = Extent::new(1);
        extent.add(0, &values);
        let mut spread = Spread::new(extent);
        spread.add(0, &values);
        let one = Encoding::Lobes { kind: LobeKind::Spherical, count: 1, sums: StoredSums::AboutPole };
        let compact = Compact::of_spread(Bits::Eight, &spread, one);
        let [weight, x, ..] = compact.ranges().to_vec()[..] else { unreachable!() };
        // Weights have their whole range. Five texels may lie beyond that of x, fewer than a part of its
        // extent holds, which is 0.8/4096 wide: its end is that of the part where the others end.
        assert_eq!((weight.low, weight.high, x.low), (0.0, 1.0, 0.0));
        assert!(x.high > 0.0995 && x.high < 0.1003, "{x:?}");
        let stored = rounded(&compact, &texel(100));
        assert_eq!(stored[1], (255.0_f32 * 1e-3 / x.high).round() as u16);
        // The steep one has an eighth of its weight, and goes the same way.
        let compact = Compact::of_spread(Bits::Eight, &spread, one);
        let stored = rounded(&compact, &texel(STEEP));
        let value = |channel: usize| compact.value(channel, stored[channel]);
        // 32 of 255 steps; half a step of x is a 64th of it.
        assert_eq!(stored[0], 32);
        assert!((value(1) / value(0) - 0.8).abs() < 0.02 && (value(3) / value(0) - 0.4).abs() < 0.02);
        // No spread for channels that are no lobes: all of them lie within.
        assert_eq!(Compact::of_spread(Bits::Eight, &spread, Encoding::MeanNormal).ranges()[1].high, 0.8);
    }

    #[test]
    fn values_of_no_range_and_of_none_are_sound() {
        let ranges = vec![
            Range { low: 1.0, high: 1.0 },
            Range { low: -1.0, high: 3.0 },
            Range { low: 0.0, high: 0.0 },
            Range { low: 0.0, high: 1.0 },
        ];
        let compact = Compact::new(Bits::Sixteen, ranges, Encoding::MeanNormal);
        let stored = rounded(&compact, &[1.0, 3.0, f32::NAN, 9.0]);
        assert_eq!(stored, [0, 0xffff, 0, 0xffff]);
        assert_eq!([0, 1].map(|c| compact.value(c, stored[c])), [1.0, 3.0]);
    }
}
