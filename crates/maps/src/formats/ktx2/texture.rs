//! Textures with mips of one's own, as engines load them: plain bytes, UASTC, or a desktop card's own blocks.

use std::path::Path;

use ::ktx2::dfd::{Basic, Block};
use ::ktx2::{Format as VkFormat, SupercompressionScheme};
use ndfmap_core::grid::Grid;
#[cfg(feature = "basis")]
use ndfmap_core::grid::Size;
use ndfmap_core::words;
use rayon::prelude::*;

use super::{Content, Front};
use crate::MapError;
use crate::formats::blocks::Blocks;
use crate::formats::{png, uastc};

/// Encoding of a texture's texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureEncoding {
    /// Basis Universal's UASTC LDR 4 × 4, a byte a texel: the format of glTF's `KHR_texture_basisu`.
    #[default]
    Uastc,
    /// Four bytes a texel, for engines that read Vulkan's formats.
    Rgba8,
    /// BC7, a byte a texel, for desktop cards.
    Bc7,
    /// BC4, half a byte a texel, for desktop cards: one channel, read as red.
    Bc4,
}

words!(TextureEncoding { Uastc => "uastc", Rgba8 => "rgba8", Bc7 => "bc7", Bc4 => "bc4" });

/// Texture of linear values, 8 bits a channel, with all its levels.
#[derive(Clone, Debug)]
pub struct Texture {
    /// RGBA of each level, finest first, each half as large as the one before it.
    pub levels: Vec<Grid<[u8; 4]>>,
    /// Importance of red, green and blue to those who compress: weights of their squared errors.
    pub importance: [f32; 3],
}

/// Descriptor of UASTC with three channels (Khronos Data Format Specification 1.3, section 5.6.16): version
/// 2, 40 bytes, its colour model, no primaries (as `KHR_texture_basisu` asks for data), linear, blocks of 4 ×
/// 4 texels and 16 bytes, one sample of 128 bits, from 0 to all bits.
const UASTC_DESCRIPTOR: [u8; 40] = [
    0,
    0,
    0,
    0,
    2,
    0,
    40,
    0,
    uastc::COLOUR_MODEL,
    0,
    1,
    0,
    3,
    3,
    0,
    0,
    16,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
    127,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
    255,
    255,
    255,
    255,
];

impl Texture {
    /// Stored bytes of a level, before they are compressed.
    fn encoded(&self, level: &Grid<[u8; 4]>, encoding: TextureEncoding) -> Vec<u8> {
        match encoding {
            TextureEncoding::Rgba8 => level.texels().as_flattened().to_vec(),
            TextureEncoding::Uastc => uastc::pack(level, self.importance),
            TextureEncoding::Bc7 => Blocks::Bc7.pack(level),
            TextureEncoding::Bc4 => Blocks::Bc4.pack(level),
        }
    }

    /// Writes a KTX2 file, its levels plain, or compressed by Zstandard at a level from 1 (fast) to 22;
    /// returns its length in bytes.
    ///
    /// # Errors
    /// [`MapError`] when the file cannot be written.
    pub fn save(&self, path: &Path, encoding: TextureEncoding, zstd: Option<i32>) -> Result<u64, MapError> {
        let bytes = self.to_ktx2(path, encoding, zstd)?;
        crate::atomic::write(path, &bytes)?;
        Ok(bytes.len() as u64)
    }

    /// Bytes of that file; the path is for messages.
    ///
    /// # Errors
    /// [`MapError`] when a level cannot be compressed, or holds what its encoding cannot.
    pub fn to_ktx2(
        &self,
        path: &Path,
        encoding: TextureEncoding,
        zstd: Option<i32>,
    ) -> Result<Vec<u8>, MapError> {
        let all = |of: fn(&[u8; 4]) -> bool| self.levels.iter().flat_map(Grid::texels).all(of);
        if encoding != TextureEncoding::Rgba8 && !all(|texel| texel[3] == u8::MAX) {
            let reason =
                format!("has an alpha channel, which is not written as {encoding}; write it as rgba8");
            return Err(MapError::unsupported(path, reason));
        }
        if encoding == TextureEncoding::Bc4 && !all(|[r, g, b, _]| r == g && g == b) {
            let reason = "has channels that differ, and bc4 holds one; write it as bc7";
            return Err(MapError::unsupported(path, reason));
        }
        let levels: Vec<Vec<u8>> = self.levels.iter().map(|level| self.encoded(level, encoding)).collect();
        let content = self.content(path, encoding, &levels)?;
        // At every number of threads the same bytes: a level is one frame, cut by size alone.
        let stored = match zstd {
            None => levels,
            Some(zstd) => {
                let frame = |level: &Vec<u8>| zstd::bulk::compress(level, zstd);
                levels.par_iter().map(frame).collect::<Result<_, _>>().map_err(|e| MapError::io(path, e))?
            }
        };
        let lengths: Vec<u64> = stored.iter().map(|level| level.len() as u64).collect();
        let scheme = zstd.map(|_| SupercompressionScheme::Zstandard);
        let front = Front::new(&content, scheme, &lengths);
        let mut bytes = front.bytes;
        for (level, start) in stored.iter().zip(&front.levels).rev() {
            bytes.resize(*start as usize, 0);
            bytes.extend_from_slice(level);
        }
        Ok(bytes)
    }

    /// PNG file of a level, without alpha where all of it is opaque; the path is for messages.
    ///
    /// # Errors
    /// [`MapError`] when it cannot be encoded.
    ///
    /// # Panics
    /// For a level that there is not.
    pub fn to_png(&self, path: &Path, level: usize) -> Result<Vec<u8>, MapError> {
        let level = &self.levels[level];
        let encoded = if level.texels().iter().all(|texel| texel[3] == u8::MAX) {
            let opaque: Vec<[u8; 3]> = level.texels().iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
            png::encode(&opaque, level.size())
        } else {
            png::encode_rgba(level.texels(), level.size())
        };
        encoded.map_err(|e| MapError::invalid(path, format!("cannot be encoded: {e}")))
    }

    /// Texels of every level as a graphics card reads them, after UASTC became its own blocks; the path is
    /// for messages.
    ///
    /// # Errors
    /// [`MapError`] when a level cannot be packed.
    #[cfg(feature = "basis")]
    pub fn transcoded(&self, path: &Path, blocks: Transcoded) -> Result<Vec<Grid<[u8; 4]>>, MapError> {
        let sizes: Vec<Size> = self.levels.iter().map(Grid::size).collect();
        transcode(path, &self.to_ktx2(path, TextureEncoding::Uastc, None)?, &sizes, blocks)
    }
    fn content(
        &self,
        path: &Path,
        encoding: TextureEncoding,
        levels: &[Vec<u8>],
    ) -> Result<Content, MapError> {
        let (format, descriptor, alignment) = match encoding {
            TextureEncoding::Uastc => (None, UASTC_DESCRIPTOR.to_vec(), uastc::BLOCK_BYTES as u64),
            TextureEncoding::Rgba8 => of_vulkan(path, VkFormat::R8G8B8A8_UNORM, 4)?,
            TextureEncoding::Bc7 => of_vulkan(path, VkFormat::BC7_UNORM_BLOCK, Blocks::Bc7.bytes().get())?,
            TextureEncoding::Bc4 => of_vulkan(path, VkFormat::BC4_UNORM_BLOCK, Blocks::Bc4.bytes().get())?,
        };
        Ok(Content {
            format,
            type_size: 1,
            descriptor,
            size: self.levels[0].size(),
            layers: 0,
            alignment,
            levels: levels.iter().map(|level| level.len() as u64).collect(),
            keys: Vec::new(),
        })
    }
}

/// Format of Vulkan's, its descriptor, and the alignment of its levels.
fn of_vulkan(
    path: &Path,
    format: VkFormat,
    alignment: usize,
) -> Result<(Option<VkFormat>, Vec<u8>, u64), MapError> {
    let (basic, _) = Basic::from_format(format).map_err(|e| MapError::unsupported(path, format!("{e:?}")))?;
    Ok((Some(format), Block::Basic(basic).to_vec(), alignment as u64))
}

/// Blocks that a graphics card reads, and UASTC becomes.
#[cfg(feature = "basis")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transcoded {
    /// ASTC 4 × 4, on phones: as exact as UASTC.
    Astc,
    /// BC7, on desktops.
    Bc7,
    /// ETC1, and ETC2 without alpha: phones before ASTC.
    Etc,
}

/// Texels of the levels of these sizes of a file of Basis Universal, as a graphics card reads them after it
/// became the card's own blocks; the path is for messages.
///
/// # Errors
/// [`MapError`] for a file that cannot be read so.
#[cfg(feature = "basis")]
pub fn transcode(
    path: &Path,
    ktx2: &[u8],
    sizes: &[Size],
    blocks: Transcoded,
) -> Result<Vec<Grid<[u8; 4]>>, MapError> {
    use basisu::{DecodeFlags, TargetFormat, Transcoder};
    let failed = |e: basisu::Error| MapError::invalid(path, format!("cannot be transcoded: {e:?}"));
    let transcoder = Transcoder::new(ktx2).map_err(failed)?;
    let target = match blocks {
        // Its decoder is exact, and UASTC a part of it.
        Transcoded::Astc => TargetFormat::Rgba32,
        Transcoded::Bc7 => TargetFormat::Bc7Rgba,
        Transcoded::Etc => TargetFormat::Etc1Rgb,
    };
    let level = |(i, size): (usize, &Size)| {
        let decoded = transcoder.transcode(i as u32, target, DecodeFlags::NONE).map_err(failed)?;
        let texels = match blocks {
            Transcoded::Astc => decoded.as_chunks().0.to_vec(),
            Transcoded::Bc7 => of_bc7(&decoded, *size),
            Transcoded::Etc => of_etc(&decoded, *size).map_err(|e| MapError::invalid(path, e))?,
        };
        Grid::from_vec(*size, texels).ok_or_else(|| MapError::invalid(path, "was transcoded to another size"))
    };
    sizes.iter().enumerate().map(level).collect()
}

/// Texels of BC7 blocks.
#[cfg(feature = "basis")]
fn of_bc7(blocks: &[u8], size: Size) -> Vec<[u8; 4]> {
    let mut texels = vec![[0; 4]; size.area()];
    let across = size.width.div_ceil(4);
    for (i, block) in blocks.chunks(16).enumerate() {
        let mut decoded = [0; 64];
        bcdec_rs::bc7(block, &mut decoded, 16);
        for (k, texel) in decoded.as_chunks().0.iter().enumerate() {
            let (x, y) = (i % across * 4 + k % 4, i / across * 4 + k / 4);
            if x < size.width && y < size.height {
                texels[y * size.width + x] = *texel;
            }
        }
    }
    texels
}

/// Texels of ETC1 blocks.
#[cfg(feature = "basis")]
fn of_etc(blocks: &[u8], size: Size) -> Result<Vec<[u8; 4]>, &'static str> {
    let mut texels = vec![0; size.area()];
    texture2ddecoder::decode_etc1(blocks, size.width, size.height, &mut texels)?;
    // Blue, green, red, alpha, from the lowest byte.
    let rgba = |texel: u32| {
        let [b, g, r, a] = texel.to_le_bytes();
        [r, g, b, a]
    };
    Ok(texels.into_iter().map(rgba).collect())
}

#[cfg(all(test, feature = "basis"))]
mod tests {
    use super::*;

    /// A ramp of three unlike channels, with some noise by a linear congruence.
    fn level(size: Size, noise: u32) -> Grid<[u8; 4]> {
        let mut state = 1_u32;
        Grid::from_fn(size, |x, y| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let jitter = (state >> 24) * noise / 256;
            let ramp = (3 * x + 5 * y) as u32 % 200;
            [ramp as u8 / 2, (ramp + jitter) as u8, 255 - ramp as u8 / 3, 255]
        })
    }

    fn texture(noise: u32) -> Texture {
        let sizes = ndfmap_core::pyramid::level_sizes(Size { width: 37, height: 22 });
        Texture { levels: sizes.into_iter().map(|size| level(size, noise)).collect(), importance: [1.0; 3] }
    }

    #[test]
    fn an_independent_transcoder_reads_every_level() {
        // Means and largest errors of a byte, measured: 0.22 and 4, 1.31 and 12 as they are; 0.50 and 9, 1.43
        // and 15 as BC7; 3.30 and 117, 5.63 and 121 as ETC, which without hints has 9.95 and 157 where it is
        // smooth.
        for (noise, blocks, mean, most) in [
            (0, Transcoded::Astc, 0.25, 4),
            (40, Transcoded::Astc, 1.4, 13),
            (0, Transcoded::Bc7, 0.55, 10),
            (40, Transcoded::Bc7, 1.5, 16),
            (0, Transcoded::Etc, 3.4, 125),
            (40, Transcoded::Etc, 6.0, 125),
        ] {
            let texture = texture(noise);
            let transcoded = texture.transcoded("t.ktx2".as_ref(), blocks).unwrap();
            let (mut sum, mut count, mut largest) = (0.0, 0.0, 0);
            for (decoded, level) in transcoded.iter().zip(&texture.levels) {
                for (got, due) in decoded.texels().iter().zip(level.texels()) {
                    // Ends of BC7 share their lowest bits.
                    assert!(got[3] == 255 || blocks == Transcoded::Bc7 && got[3] == 254);
                    for (got, due) in got.iter().zip(due).take(3) {
                        let off = (i32::from(*got) - i32::from(*due)).abs();
                        sum += f64::from(off);
                        count += 1.0;
                        largest = largest.max(off);
                    }
                }
            }
            println!("noise {noise}, {blocks:?}: mean {:.2}, largest {largest}", sum / count);
            assert!(sum / count < mean && largest <= most, "{noise}: {} {largest}", sum / count);
        }
    }

    #[test]
    fn flat_blocks_keep_their_colour_as_etc() {
        // Each block has a grey or a colour of its own. Without hints all turn black.
        let level = Grid::from_fn(Size { width: 128, height: 128 }, |x, y| {
            let i = (y / 4 * 32 + x / 4) as u32;
            if i < 256 {
                [i as u8, i as u8, i as u8, 255]
            } else {
                [i as u8, (i * 7 / 3) as u8, (i * 11 / 5) as u8, 255]
            }
        });
        let texture = Texture { levels: vec![level], importance: [1.0; 3] };
        let errors = channel_errors(&texture, Transcoded::Etc);
        // Measured 0.79 at most: modifiers are a few bytes apart.
        assert!(errors.iter().all(|error| *error < 0.85), "{errors:?}");
    }

    /// Mean errors of each channel, in 1/255.
    #[allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]
    fn channel_errors(texture: &Texture, blocks: Transcoded) -> [f64; 3] {
        let transcoded = texture.transcoded("t.ktx2".as_ref(), blocks).unwrap();
        let pairs = || transcoded[0].texels().iter().zip(texture.levels[0].texels());
        let count = pairs().count() as f64;
        [0, 1, 2].map(|c: usize| pairs().map(|(a, b)| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / count)
    }

    #[test]
    fn unrelated_channels_have_planes_of_their_own_and_importance_counts() {
        // A ramp of roughness under a mask of metal that has nothing to do with it.
        let level = Grid::from_fn(Size { width: 64, height: 64 }, |x, y| {
            let metal = if (x * 7 + y * 13) % 5 < 2 { 255 } else { 0 };
            [255, (40 + 2 * x + y % 4 * 3) as u8, metal, 255]
        });
        let texture = |importance| Texture { levels: vec![level.clone()], importance };
        for blocks in [Transcoded::Astc, Transcoded::Bc7] {
            let [red, green, blue] = channel_errors(&texture([1.0; 3]), blocks);
            // With one plane for all, green was off by 3.35: the mask was all that the weights said. Now
            // 1.12.
            assert!(red == 0.0 && green < 1.2 && blue == 0.0, "{blocks:?}: {red} {green} {blue}");
        }
        // Shallow grooves at 45 degrees: red and green run against each other.
        let grooves = Grid::from_fn(Size { width: 64, height: 64 }, |x, y| {
            let slope = ((x + y) % 8 * 10) as u8;
            [80 + slope, 160 - slope, 250, 255]
        });
        let texture = Texture { levels: vec![grooves], importance: [1.0; 3] };
        let [red, green, blue] = channel_errors(&texture, Transcoded::Astc);
        // Rounding of ends: 0.44, 0.69 and 0. A search that misses the axis has 3.8, 3.2 and 2.
        assert!(red < 0.5 && green < 0.75 && blue == 0.0, "{red} {green} {blue}");
        let noisy = Texture { importance: [1.0, 16.0, 1.0], ..self::texture(40) };
        let even = Texture { importance: [1.0; 3], ..noisy.clone() };
        let [weighed, equal] = [&noisy, &even].map(|texture| channel_errors(texture, Transcoded::Astc));
        // Measured 0.62 for 1.46.
        assert!(weighed[1] < 0.5 * equal[1], "{weighed:?} {equal:?}");
    }

    #[test]
    fn one_colour_is_exact_and_plain_bytes_are_as_they_were() {
        let flat = Grid::from_fn(Size { width: 8, height: 8 }, |_, _| [3, 130, 77, 255]);
        let texture = Texture { levels: vec![flat.clone()], importance: [1.0; 3] };
        for encoding in [TextureEncoding::Uastc, TextureEncoding::Rgba8, TextureEncoding::Bc7] {
            let bytes = texture.to_ktx2("t.ktx2".as_ref(), encoding, Some(3)).unwrap();
            let image = crate::formats::read_image("t.ktx2".as_ref(), &bytes).unwrap();
            for (i, texel) in flat.texels().iter().enumerate() {
                for (c, due) in texel.iter().enumerate().take(3) {
                    let got = image.samples.get(i * image.channels + c);
                    // Ends of BC7 share their lowest bits.
                    let most = if encoding == TextureEncoding::Bc7 { 1.0 / 255.0 } else { 0.0 };
                    assert!((got - f32::from(*due) / 255.0).abs() < most + 1e-6, "{encoding:?} {got}");
                }
            }
        }
    }

    #[test]
    fn blocks_of_desktop_cards_come_back() {
        // Means and largest errors of a byte, measured: 0.27 and 2, 1.08 and 8 (BC7); 0.92 and 13, 1.55 and
        // 15 (BC4, whose eight steps span the jumps of the ramp). Edges are no multiples of four.
        for (encoding, noise, mean, most) in [
            (TextureEncoding::Bc7, 0, 0.28, 2),
            (TextureEncoding::Bc7, 40, 1.12, 8),
            (TextureEncoding::Bc4, 0, 0.95, 13),
            (TextureEncoding::Bc4, 40, 1.6, 15),
        ] {
            let mut texture = texture(noise);
            if encoding == TextureEncoding::Bc4 {
                let refused = texture.to_ktx2("t.ktx2".as_ref(), encoding, None).unwrap_err();
                assert!(refused.to_string().contains("channels that differ"), "{refused}");
                let grey = |level: &Grid<[u8; 4]>| {
                    Grid::from_fn(level.size(), |x, y| {
                        let green = level.row(y)[x][1];
                        [green, green, green, 255]
                    })
                };
                texture.levels = texture.levels.iter().map(grey).collect();
            }
            let bytes = texture.to_ktx2("t.ktx2".as_ref(), encoding, Some(3)).unwrap();
            let image = crate::formats::read_image("t.ktx2".as_ref(), &bytes).unwrap();
            let (mut sum, mut count, mut largest) = (0.0, 0.0, 0.0_f32);
            for (i, texel) in texture.levels[0].texels().iter().enumerate() {
                for (c, due) in texel.iter().take(image.channels.min(3)).enumerate() {
                    let off = (255.0 * image.samples.get(i * image.channels + c) - f32::from(*due)).abs();
                    sum += f64::from(off);
                    count += 1.0;
                    largest = largest.max(off);
                }
            }
            println!("{encoding}, noise {noise}: mean {:.2}, largest {largest:.1}", sum / count);
            assert!(sum / count < mean && largest < most as f32 + 0.5, "{encoding} {noise}: {}", sum / count);
        }
    }
}
