//! Compact storage: channels as integers of 8, 10 or 16 bits, each channel in a range of its own.
//!
//! A stored integer `q` stands for `low + (high - low) q / (2^bits - 1)`. That is affine, so a texture unit
//! may filter integers, as unorm, and a shader takes the filtered ones to their range: the sums come out as
//! if they had been filtered themselves. Ranges are those that the map's values fill, level after level the
//! same, since filters mix levels.
//!
//! Sums of a lobe are multiples of its weight. They are rounded last, as multiples of the weight that was
//! rounded: so a faint lobe keeps its direction and its width, and only its weight is off.

mod range;
mod storage;

use rayon::prelude::*;

use crate::fit::LobeKind;
use crate::grid::Size;
use crate::ndf::{Encoding, LobeLayout};
use crate::pyramid::{Layout, Precision, Pyramid};

pub use range::{Extent, Range, Spread};
pub use storage::{Bits, Storage};

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

    /// Form for channels that reach so far, all of their values within.
    #[must_use]
    pub fn of_extent(bits: Bits, extent: &Extent, encoding: Encoding) -> Self {
        Self::new(bits, extent.ranges(), encoding)
    }

    /// True where [`Self::trimmed`] does something: bits are few, and there are lobes that can lose weight.
    #[must_use]
    pub fn trims(&self) -> bool {
        self.lobes.is_some() && self.bits.outside() > 0.0
    }

    /// Returns it with narrower ranges, for channels that are spread so.
    ///
    /// Sums of lobes reach far beyond most of their values where a few texels are steep. The outermost values
    /// on either side lie beyond the range then, and their lobes lose weight instead ([`Bits::outside`]).
    #[must_use]
    pub fn trimmed(mut self, spread: &Spread) -> Self {
        let sums = self.lobes.map_or(0, |lobes| 4 * lobes.layers(0));
        let range = |c: usize| match self.ranges[c] {
            // A lobe can lose all of its weight, also one that never does.
            Range { low, high } if self.lobe_of(c).start == c => Range { low: low.min(0.0), high },
            // Attributes that lobes carry do not make them lose any.
            whole if c >= sums => whole,
            _ => spread.within(c, self.bits.outside()),
        };
        self.ranges = (0..self.ranges.len()).map(range).collect();
        self
    }

    /// Form for a map in memory.
    #[must_use]
    pub fn of(bits: Bits, pyramid: &Pyramid, encoding: Encoding) -> Self {
        let mut extent = Extent::new(pyramid.layers());
        layers_of(pyramid, |layer, values| extent.add(layer, values));
        let whole = Self::of_extent(bits, &extent, encoding);
        if !whole.trims() {
            return whole;
        }
        let mut spread = Spread::new(extent);
        layers_of(pyramid, |layer, values| spread.add(layer, values));
        whole.trimmed(&spread)
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
        let of_level = |(level, size): (usize, &Size)| {
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
        let mut spread = Spread::new(extent.clone());
        spread.add(0, &values);
        let one = Encoding::Lobes { kind: LobeKind::Spherical, count: 1, sums: StoredSums::AboutPole };
        let compact = Compact::of_extent(Bits::Eight, &extent, one).trimmed(&spread);
        let [weight, x, ..] = compact.ranges() else { unreachable!() };
        // Weights have their whole range. Five texels may lie beyond that of x, fewer than a part of its
        // extent holds, which is 0.8/4096 wide: its end is that of the part where the others end.
        assert_eq!((weight.low, weight.high, x.low), (0.0, 1.0, 0.0));
        assert!(x.high > 0.0995 && x.high < 0.1003, "{x:?}");
        let stored = rounded(&compact, &texel(100));
        assert_eq!(stored[1], (255.0_f32 * 1e-3 / x.high).round() as u16);
        // The steep one has an eighth of its weight, and goes the same way.
        let stored = rounded(&compact, &texel(STEEP));
        let value = |channel: usize| compact.value(channel, stored[channel]);
        // 32 of 255 steps; half a step of x is a 64th of it.
        assert_eq!(stored[0], 32);
        assert!((value(1) / value(0) - 0.8).abs() < 0.02 && (value(3) / value(0) - 0.4).abs() < 0.02);
        // More bits trim nothing, and neither do channels that are no lobes.
        assert!(!Compact::of_extent(Bits::Ten, &extent, one).trims());
        assert!(!Compact::of_extent(Bits::Eight, &extent, Encoding::MeanNormal).trims());
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
