//! Storage of a map's channels: floats, or integers of 8, 10 or 16 bits.

use std::fmt::{self, Display};
use std::str::FromStr;

use super::Compact;
use crate::ndf::Encoding;
use crate::pyramid::{Precision, Pyramid};
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
