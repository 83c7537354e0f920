//! Texels as textures hold them: plain numbers, bit fields, and blocks of 4 × 4.

use std::path::Path;

use half::f16;
use ndfmap_core::grid::Size;
use rayon::prelude::*;

use crate::{Image, MapError, Samples};

/// Layout of a texture's texels, rows from the top, without padding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Texels {
    /// That many channels of one number each, red first.
    Numbers(Number, usize),
    /// Bit fields of a word.
    Fields(Fields),
    /// Blocks of 4 × 4 texels.
    Blocks(Block),
}

/// Little-endian number that stands for a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    /// 16 bits from 0 to 1.
    Unorm16,
    /// 16 bits from -1 to 1.
    Snorm16,
    /// Half-precision float.
    Half,
    /// Single-precision float.
    Single,
}

/// Little-endian word of up to four bytes that holds a texel, a run of bits for each channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fields {
    /// Bytes of the word.
    pub(super) bytes: usize,
    /// Bits of red, green, blue and alpha; 0 for a channel that is not there.
    pub(super) masks: [u32; 4],
    /// True where channels run from -1 to 1.
    pub(super) signed: bool,
}

/// Block compression (Khronos Data Format Specification 1.3, sections 18 to 20).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    /// RGB, with alpha of one bit where any texel is transparent.
    Bc1,
    /// RGB alone.
    Bc1Opaque,
    /// RGBA, alpha of four bits.
    Bc2,
    /// RGBA, alpha by its own ramp.
    Bc3,
    /// BC3 whose alpha is red.
    Bc3RedInAlpha,
    /// Red.
    Bc4,
    /// Red from -1 to 1.
    Bc4Signed,
    /// Red and green.
    Bc5,
    /// Red and green from -1 to 1.
    Bc5Signed,
    /// RGB of floats that are not negative.
    Bc6h,
    /// RGB of floats.
    Bc6hSigned,
    /// RGBA.
    Bc7,
}

/// Masks of words of 10, 10, 10 and 2 bits, red in the lowest.
pub(super) const RGB10: [u32; 4] = [0x3FF, 0xF_FC00, 0x3FF0_0000, 0xC000_0000];

/// Side of a block.
const SIDE: usize = 4;

impl Fields {
    /// Channels of a byte each, red in the lowest.
    pub(super) const fn of_bytes(channels: usize, signed: bool) -> Self {
        let mut masks = [0; 4];
        let mut channel = 0;
        while channel < channels {
            masks[channel] = 0xFF << (8 * channel);
            channel += 1;
        }
        Self { bytes: channels, masks, signed }
    }

    /// The layout with red and blue exchanged.
    pub(super) const fn blue_first(self) -> Self {
        let [r, g, b, a] = self.masks;
        Self { masks: [b, g, r, a], ..self }
    }

    fn decode(&self, stored: &[u8]) -> Samples {
        let masks: Vec<u32> = self.masks.into_iter().filter(|mask| *mask != 0).collect();
        let words = stored
            .chunks_exact(self.bytes)
            .map(|word| word.iter().rev().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)));
        let codes = words.flat_map(|word| masks.iter().map(move |mask| Code::new(word, *mask)));
        if self.signed {
            Samples::F32(codes.map(Code::signed).collect())
        } else if masks.iter().all(|mask| mask.count_ones() <= 8) {
            Samples::U8(codes.map(|code| code.scaled(255) as u8).collect())
        } else {
            Samples::U16(codes.map(|code| code.scaled(65535) as u16).collect())
        }
    }
}

/// Bits of one channel.
struct Code {
    bits: u32,
    largest: u32,
}

impl Code {
    fn new(word: u32, mask: u32) -> Self {
        let lowest = mask.trailing_zeros();
        Self { bits: (word & mask) >> lowest, largest: mask >> lowest }
    }

    /// Unsigned normalised value over another range, to the nearest.
    fn scaled(self, largest: u64) -> u64 {
        let own = u64::from(self.largest);
        (u64::from(self.bits) * largest + own / 2) / own
    }

    /// Signed normalised value: the largest code is 1, and the two lowest are -1 (Vulkan 1.3, section 3.10).
    fn signed(self) -> f32 {
        let half = self.largest / 2;
        let value = i64::from(self.bits) - if self.bits > half { i64::from(self.largest) + 1 } else { 0 };
        (value as f32 / half.max(1) as f32).max(-1.0)
    }
}

impl Block {
    /// Bytes of a block.
    fn bytes(self) -> usize {
        match self {
            Self::Bc1 | Self::Bc1Opaque | Self::Bc4 | Self::Bc4Signed => 8,
            _ => 16,
        }
    }

    /// Samples that a texel has once it is decoded.
    fn channels(self) -> usize {
        match self {
            Self::Bc4 | Self::Bc4Signed => 1,
            Self::Bc5 | Self::Bc5Signed => 2,
            Self::Bc6h | Self::Bc6hSigned => 3,
            _ => 4,
        }
    }

    /// Samples of a picture. The ramps of BC4 and BC5 have steps finer than a byte: they become 16 bits.
    fn decode(self, stored: &[u8], size: Size) -> Samples {
        use bcdec_rs::{bc1, bc2, bc3, bc4_float, bc5_float, bc6h_float, bc7};
        let bytes = |decode: fn(&[u8], &mut [u8], usize)| Samples::U8(self.texels(stored, size, decode));
        let floats = |decode: fn(&[u8], &mut [f32], usize, bool), signed: bool| -> Vec<f32> {
            self.texels(stored, size, |block, texels, pitch| decode(block, texels, pitch, signed))
        };
        let words = |values: Vec<f32>| {
            Samples::U16(values.into_iter().map(|v| (v * 65535.0).round() as u16).collect())
        };
        match self {
            Self::Bc1 | Self::Bc1Opaque => bytes(bc1),
            Self::Bc2 => bytes(bc2),
            Self::Bc3 | Self::Bc3RedInAlpha => bytes(bc3),
            Self::Bc4 => words(floats(bc4_float, false)),
            Self::Bc4Signed => Samples::F32(floats(bc4_float, true)),
            Self::Bc5 => words(floats(bc5_float, false)),
            Self::Bc5Signed => Samples::F32(floats(bc5_float, true)),
            Self::Bc6h => Samples::F32(floats(bc6h_float, false)),
            Self::Bc6hSigned => Samples::F32(floats(bc6h_float, true)),
            Self::Bc7 => bytes(bc7),
        }
    }

    /// Texels in rows. `decode` writes those of a block, given the samples from one of its rows to the next.
    fn texels<T: Copy + Default + Send>(
        self,
        stored: &[u8],
        size: Size,
        decode: impl Fn(&[u8], &mut [T], usize) + Sync,
    ) -> Vec<T> {
        let (bytes, channels) = (self.bytes(), self.channels());
        let (row, pitch) = (size.width * channels, SIDE * channels);
        let mut texels = vec![T::default(); size.area() * channels];
        let bands = texels.par_chunks_mut(SIDE * row);
        bands.zip(stored.par_chunks_exact(size.width.div_ceil(SIDE) * bytes)).for_each(|(band, blocks)| {
            let mut block = vec![T::default(); SIDE * pitch];
            for (i, stored) in blocks.chunks_exact(bytes).enumerate() {
                decode(stored, &mut block, pitch);
                for (row, texels) in band.chunks_exact_mut(row).zip(block.chunks_exact(pitch)) {
                    let places = &mut row[i * pitch..];
                    let inside = places.len().min(pitch);
                    places[..inside].copy_from_slice(&texels[..inside]);
                }
            }
        });
        texels
    }
}

impl Texels {
    /// Bytes of a picture.
    pub(super) fn bytes(&self, size: Size) -> usize {
        match self {
            Self::Numbers(Number::Unorm16 | Number::Snorm16 | Number::Half, channels) => {
                2 * channels * size.area()
            }
            Self::Numbers(Number::Single, channels) => 4 * channels * size.area(),
            Self::Fields(fields) => fields.bytes * size.area(),
            Self::Blocks(block) => size.width.div_ceil(SIDE) * size.height.div_ceil(SIDE) * block.bytes(),
        }
    }

    /// Picture of these bytes, as many as [`Self::bytes`] says.
    ///
    /// # Errors
    /// [`MapError`] when there are fewer or more.
    pub(super) fn decode(&self, path: &Path, size: Size, stored: &[u8]) -> Result<Image, MapError> {
        let words = || stored.as_chunks::<2>().0.iter().map(|word| u16::from_le_bytes(*word));
        let (channels, signed, samples) = match self {
            Self::Numbers(number, channels) => {
                let samples = match number {
                    Number::Unorm16 => Samples::U16(words().collect()),
                    Number::Snorm16 => {
                        let code = |word: u16| Code { bits: word.into(), largest: 65535 };
                        Samples::F32(words().map(|word| code(word).signed()).collect())
                    }
                    Number::Half => Samples::F32(words().map(|word| f16::from_bits(word).into()).collect()),
                    Number::Single => {
                        let words = stored.as_chunks::<4>().0;
                        Samples::F32(words.iter().map(|word| f32::from_le_bytes(*word)).collect())
                    }
                };
                (*channels, *number == Number::Snorm16, samples)
            }
            Self::Fields(fields) => {
                let channels = fields.masks.iter().filter(|mask| **mask != 0).count();
                (channels, fields.signed, fields.decode(stored))
            }
            Self::Blocks(block) => {
                let signed = matches!(block, Block::Bc4Signed | Block::Bc5Signed);
                (block.channels(), signed, block.decode(stored, size))
            }
        };
        let image = Image { signed, ..Image::new(path, size, channels, samples)? };
        Ok(match self {
            Self::Blocks(Block::Bc1) if (0..size.area()).all(|i| image.samples.get(4 * i + 3) == 1.0) => {
                image.channels(&[0, 1, 2])
            }
            Self::Blocks(Block::Bc1Opaque) => image.channels(&[0, 1, 2]),
            Self::Blocks(Block::Bc3RedInAlpha) => image.channels(&[3, 1, 2]),
            _ => image,
        })
    }
}
